"""Builds whose jobs share no folder, with a storage in a folder."""

import json
import tarfile

import bookkeeping
import pytest
import yaml
from checkouts import PUBLISHED_VIEWS, ROOT
from sphere import write_views
from waiting import wait_until

import cloud
from cloud import Cloud, kill_group
from lightfield.core.errors import UserError
from lightfield.core.files import sha256

PANORAMAS = "smoke/LFLattice_2panos"
WORDS = (
    "--config",
    "scenes=smoke",
    "rigs=LFLattice_2panos",
    "preset=full",
    "--groups",
    "render=shard",
    "reproject=shard",
    "--",
    bookkeeping.shard(PANORAMAS, "perspective", "0-2"),
    f"results/{PANORAMAS}/perspective/transforms.json",
)


def test_without_its_server_the_benchmark_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(cloud, "ROOT", tmp_path)
    with pytest.raises(UserError, match=r"make .*\.venv-s3-server/complete"):
        cloud.check_environment()


def test_a_server_that_cannot_start_is_reported_with_its_own_message(tmp_path, monkeypatch):
    monkeypatch.setattr(cloud, "ROOT", tmp_path)
    python = tmp_path / cloud.SERVER / "bin/python"
    python.parent.mkdir(parents=True)
    python.write_text("#!/bin/sh\necho No module named moto >&2\nexit 1\n")
    python.chmod(0o755)
    with pytest.raises(UserError, match="S3 server does not answer: No module named moto"):
        cloud.serve(tmp_path)


@pytest.mark.slow
@pytest.mark.usefixtures("in_forks")
def test_a_build_in_isolated_folders_goes_on_when_its_jobs_are_killed(smoke, tmp_path):
    folder = tmp_path / "store"
    build = Cloud(tmp_path / "cloud", 2, str(folder))
    run = build.start(*WORDS)
    wait_until(build.render_counts, run)
    for group in build.running():
        kill_group(group)
    # A node is gone.
    build.jobs.rename(tmp_path / "gone")
    build.jobs.mkdir()
    said, _ = run.communicate()
    assert run.returncode == 0, said
    for stage in ("render", "perspective"):
        files = bookkeeping.files_of_shard(folder, PANORAMAS, stage, "0-2")
        assert files == bookkeeping.files_of_shard(smoke, PANORAMAS, stage, "0-2")
        assert {f"results/{PANORAMAS}/{name}" for name in files} <= bookkeeping.packed_files(folder)

    said, _ = build.start("--dry-run", *WORDS).communicate()
    assert "Nothing to be done" in said


@pytest.mark.slow
@pytest.mark.usefixtures("in_forks")
def test_changed_settings_run_their_jobs_again(tmp_path):
    build = Cloud(tmp_path / "cloud", 2, str(tmp_path / "store"))
    target = "results/soak/LFSoak/lightfield.json"
    said, _ = (run := build.start("--", target)).communicate()
    assert run.returncode == 0, said
    assert bookkeeping.has_lock(tmp_path / "cloud", "soak")
    # A fresh clone, beside the same storage.
    (tmp_path / "cloud/.snakemake").rename(tmp_path / "notes")
    shown = ("--dry-run", "--printshellcmds", "--", target)
    said, _ = build.start(*shown).communicate()
    assert "lightfield" not in said.split()
    scene = tmp_path / "cloud/configs/scenes/soak.yaml"
    scene.write_text(scene.read_text().replace("samples: 1", "samples: 2"))
    said, _ = build.start(*shown).communicate()
    assert {"write_settings", "lightfield"} <= set(said.split())
    assert "build_scene" not in said.split()


@pytest.mark.slow
@pytest.mark.usefixtures("in_forks")
def test_the_files_of_an_inertial_sensor_reach_the_job_that_checks_them(tmp_path):
    build = Cloud(tmp_path / "cloud", 2, str(tmp_path / "store"))
    scene = tmp_path / "cloud/configs/scenes/soak.yaml"
    content = yaml.safe_load(scene.read_text())
    rig = {
        "type": "path",
        "count": 2,
        "keys": [{"position": [0, 0, 1.2]}, {"position": [0, 0.3, 1.2]}],
        "camera": {"lens": "rectilinear", "fov": 80, "resolution": [16, 16]},
        "imu": {"seconds": 1},
    }
    kept = {key: content[key] for key in ("licence", "scene") if key in content}
    scene.write_text(json.dumps(kept | {"render": {"samples": 1}, "rigs": {"walk": rig}}))
    sums = "results/soak/walk/sha256sums.txt"
    said, _ = (run := build.start("--", sums)).communicate()
    assert run.returncode == 0, said
    assert "  imu/imu.csv\n" in (tmp_path / "store" / sums).read_text()


# A room with a texture on its walls, and a box from a linked library with another texture.
BLEND = """
import sys
import bpy
folder, scripts = sys.argv[1:]
sys.path.insert(0, scripts)
from scenes import room

def paint(name, colour):
    image = bpy.data.images.new(name, 4, 4)
    image.pixels = [*colour, 1] * 16
    image.filepath_raw, image.file_format = f"{folder}/textures/{name}.png", "PNG"
    image.save()
    image.source = "FILE"
    tree = bpy.data.materials[name].node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    tree.links.new(texture.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])

bpy.ops.wm.read_factory_settings(use_empty=True)
room.build({})
paint("box", (0.9, 0.1, 0.1))
bpy.ops.wm.save_as_mainfile(filepath=f"{folder}/blends/parts/box.blend")
bpy.ops.file.make_paths_relative()
bpy.ops.wm.save_mainfile()

bpy.ops.wm.read_factory_settings(use_empty=True)
room.build({})
paint("walls", (0.1, 0.9, 0.1))
bpy.data.objects.remove(bpy.data.objects["box"])
bpy.ops.wm.save_as_mainfile(filepath=f"{folder}/blends/mine.blend")
with bpy.data.libraries.load(f"{folder}/blends/parts/box.blend", link=True) as (_, wanted):
    wanted.objects = ["box"]
bpy.context.scene.collection.objects.link(wanted.objects[0])
bpy.ops.file.make_paths_relative()
bpy.ops.wm.save_mainfile()
"""
CAMERA = {"lens": "equidistant", "fov": 180, "resolution": [16, 16]}
PLANE = {"type": "plane", "cameras": [2, 1], "size": [0.5, 0, 0], "center": [0, 0, 1.5]}
BROUGHT = f"""
scene: {{blend: blends/mine.blend}}
render: {{samples: 1}}
report: {{panorama: false}}
rigs: {{LFPlane: {PLANE | {"camera": CAMERA}}}}
"""
PUBLISH = yaml.safe_load(PUBLISHED_VIEWS)["publish"] | {"date": "2026-11-30"}
# A model at two frames, which is exported as a sequence, packed and published.
MODELLED = f"""
description: A ball
licence: CC-BY-4.0
publish: {PUBLISH}
scene: {{model: models/ball.obj}}
render: {{samples: 1}}
report: {{panorama: false}}
rigs:
  LFPair:
    type: plane
    cameras: [2, 1]
    size: [0.5, 0, 0]
    center: [0, -2, 0.5]
    look_at: [0, 0, 0.5]
    frames: {{first: 1, last: 2}}
    camera: {{lens: rectilinear, fov: 90, resolution: [16, 16]}}
exports:
  dnerf: {{sources: [views], points: 20}}
"""
BALL = """
import bpy, sys
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, location=(0, 0, 0))
bpy.ops.wm.obj_export(filepath=sys.argv[1])
"""
PUBLISHED = "results/modelled/published/modelled_LFPair"
BROUGHT_WORDS = (
    "--config",
    "scenes=[brought,theirs,modelled]",
    "rigs=all",
    "preset=full",
    "--",
    *(f"results/{name}/LFPlane/validation.json" for name in ("brought", "theirs")),
    "results/modelled/modelled_LFPair.tar",
    "results/modelled/LFPair/report/sequence.html",
    f"{PUBLISHED}/croissant.json",
)


@pytest.mark.slow
@pytest.mark.usefixtures("in_forks")
def test_a_users_files_reach_jobs_in_isolated_folders(run_program, tmp_path):
    folder, root, given = (tmp_path / name for name in ("store", "cloud", "dataset"))
    build = Cloud(root, 2, str(folder), ("published/LFPlane/lightfield.json",))
    for name in ("blends/parts", "textures", "published", "models"):
        (root / name).mkdir(parents=True)
    (tmp_path / "ball.py").write_text(BALL)
    run_program(tmp_path / "ball.py", root / "models/ball.obj")
    (tmp_path / "make.py").write_text(BLEND)
    run_program(tmp_path / "make.py", root, ROOT / "scripts")
    write_views(given, CAMERA, {**PLANE, "center": [0, 0, 0]})
    given.rename(root / "published/LFPlane")
    scenes = {"brought": BROUGHT, "theirs": "scene: {dataset: published}", "modelled": MODELLED}
    for name, text in scenes.items():
        (root / f"configs/scenes/{name}.yaml").write_text(text)
    said, _ = (run := build.start(*BROUGHT_WORDS)).communicate()
    assert run.returncode == 0, said

    work = folder / "work"
    arguments = (
        "--blend",
        root / "blends/mine.blend",
        "--inventory",
        work / "brought/inventory.json",
    )
    arguments += ("--lightfield", folder / "results/brought/LFPlane/lightfield.json")
    run_program("render_shard.py", *arguments, "--output", tmp_path / "exr")
    files = bookkeeping.files_of_shard(folder, "brought/LFPlane", "render", "0-2")
    assert len(files) == 2
    for name, (_, digest) in files.items():
        assert digest == sha256(tmp_path / name)

    files = bookkeeping.files_of_shard(folder, "theirs/LFPlane", "render", "0-2")
    for name, (_, digest) in files.items():
        assert digest == sha256(root / "published/LFPlane" / name)
    assert {f"results/theirs/LFPlane/{name}" for name in files} <= bookkeeping.packed_files(folder)

    frames = [f"results/modelled/LFPair/f{number:05}" for number in (1, 2)]
    for path in (*frames, "results/modelled/LFPair", PUBLISHED):
        run_program("take_dataset.py", "--store", folder, path, cwd=tmp_path)
    rig = tmp_path / "results/modelled/LFPair"
    assert bookkeeping.problems([rig], work=None) == {}
    assert len([*rig.glob("exports/dnerf/*/f0000?_view_*.png")]) == 4
    assert (rig / "report/sequence.html").is_file()
    (shard,) = (tmp_path / PUBLISHED).glob("modelled_LFPair-*.tar")
    with tarfile.open(shard) as archive:
        # Four samples, each with its pose, its view and a thumbnail.
        assert len(archive.getnames()) == 12
    with tarfile.open(tmp_path / PUBLISHED / "other_files.tar") as archive:
        assert "modelled_LFPair/exports/dnerf/transforms_train.json" in archive.getnames()

    verify = (*BROUGHT_WORDS[:4], "--", "verify")
    said, _ = (run := build.start(*verify)).communicate()
    assert run.returncode == 0, said
    shard = bookkeeping.shard("modelled/LFPair/f00001", "render", "0-2")
    bookkeeping.damage_packed(folder, shard)
    said, _ = (run := build.start("--retries", "0", *verify)).communicate()
    assert run.returncode == 1, said
    assert f"{frames[0]}/exr/view_0000f.exr" in (work / "logs/verify.log").read_text()


ROOMS = """
scene: {builder: room}
render: {samples: 1}
rigs:
  LFPlane:
    type: plane
    cameras: [2, 1]
    size: 0.5
    center: [0, 0, 1.2]
    split: {every: 2}
    camera: {lens: equidistant, fov: 180, resolution: [32, 32]}
family: {seeds: 0-2}
"""
# A builder that raises an error for seed 2.
BROKEN = """

built = build


def build(parameters):
    if parameters["seed"] == 2:
        raise ValueError("no walls")
    built(parameters)
"""


@pytest.mark.slow
@pytest.mark.usefixtures("in_forks")
def test_members_in_isolated_folders_are_built_again_when_their_job_is_killed(
    run_program, tmp_path
):
    folder = tmp_path / "store"
    build = Cloud(tmp_path / "cloud", 2, str(folder))
    (tmp_path / "cloud/configs/scenes/rooms.yaml").write_text(ROOMS)
    with (tmp_path / "cloud/program/scripts/scenes/room/__init__.py").open("a") as builder:
        builder.write(BROKEN)
    run = build.start("--config", "scenes=rooms", "rigs=all", "preset=full")
    nodes = build.jobs
    wait_until(
        lambda: any("0001" in bookkeeping.begun_members(job, "rooms") for job in nodes.iterdir()),
        run,
    )
    for group in build.running():
        kill_group(group)
    # The node is gone, with all that it had on its disk.
    build.jobs.rename(tmp_path / "gone")
    build.jobs.mkdir()
    said, _ = run.communicate()
    assert run.returncode == 1, said
    assert "2 of 3 members of rooms built, 1 failed" in said
    assert "results/rooms/0002/member.json" in bookkeeping.packed_files(folder)
    for member in ("0000", "0001"):
        dataset = f"results/rooms/{member}/LFPlane"
        run_program("take_dataset.py", "--store", folder, dataset, cwd=tmp_path)
        lines = (tmp_path / dataset / "sha256sums.txt").read_text().splitlines()
        sums = {name: digest for digest, _, name in (line.partition("  ") for line in lines)}
        assert {"exr/view_0000f.exr", "exr/view_0001f.exr", "validation.json"} <= sums.keys()
        assert sums == {name: sha256(tmp_path / dataset / name) for name in sums}
    corpus = json.loads((folder / "results/rooms/corpus.json").read_text())
    (failure,) = corpus["failures"]
    assert failure["cause"] == "ValueError: no walls"
