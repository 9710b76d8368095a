"""Families: names, values and batches of their members, and what a run makes of failures."""

import contextlib
import itertools
import json
import os
import re
import resource
import shutil
import subprocess
import time
from contextlib import nullcontext
from pathlib import Path

import forks
import numpy as np
import pytest
from checkouts import checkout, snakemake
from conftest import largest_file
from pydantic import ValidationError

from lightfield.configuration.family import Family, Member, drawn, member_content, stand_in
from lightfield.configuration.scene_yaml import check_member
from lightfield.core.errors import UserError
from lightfield.core.files import read_json, write_json
from lightfield.engine import receipts
from lightfield.family import batch as family_batch
from lightfield.family.batch import deadly_members, member_at_hand
from lightfield.family.member import MemberBuild
from lightfield.imaging.images import write_exr, write_png
from lightfield.stages.family import BatchSettings, BuildMembers, Corpus, CorpusSettings
from lightfield.stages.registry import VERSIONS
from lightfield.stages.views import RenderShard
from lightfield.validation.verification import faults
from lightfield.workflow.check import JobCheck

ROOT = Path(__file__).parents[2]


def family(**keys):
    return Family(**keys)


def by_name(members):
    return {member.name: member for member in members}


def test_a_member_is_named_by_its_seed_and_the_same_in_larger_families():
    values = {"render.samples": {"integers": [1, 1000]}}
    small = family(seeds="5-7", values=values)
    large = family(seeds="0-12345", values=values | {"scene.frame": {"integers": [1, 9]}})
    assert [member.name for member in small.members()] == ["0005", "0006", "0007"]
    for name, member in by_name(small.members()).items():
        other = by_name(large.members())[name]
        key = "render.samples"
        assert drawn(small.values, member)[key] == drawn(large.values, other)[key]


def test_drawn_values_are_equal_on_every_machine():
    draws = family(
        seeds="0-1",
        values={
            "a.uniform": {"uniform": [0.5, 1]},
            "a.logarithm": {"log_uniform": [0.01, 100]},
            "a.number": {"integers": [1, 6]},
            "a.word": {"choice": ["city", "forest"]},
        },
    )
    # As the first machine drew them.
    assert [drawn(draws.values, member) for member in draws.members()] == [
        {"a.uniform": 0.888407, "a.logarithm": 0.307865, "a.number": 2, "a.word": "forest"},
        {"a.uniform": 0.813658, "a.logarithm": 0.0278231, "a.number": 3, "a.word": "city"},
    ]


@pytest.mark.parametrize("kind", ["uniform", "log_uniform"])
@pytest.mark.parametrize(
    "bounds", [[0.1234561, 0.1234564], [0.1, 0.1000004], [0.9999997, 0.9999999]]
)
def test_drawn_values_lie_between_their_bounds(kind, bounds):
    draws = family(seeds="0-19", values={"a.value": {kind: bounds}})
    low, high = bounds
    for member in draws.members():
        assert low <= drawn(draws.values, member)["a.value"] <= high


def test_draws_fill_their_ranges():
    draws = family(
        seeds="0-1999",
        values={
            "a.uniform": {"uniform": [-1, 3]},
            "a.logarithm": {"log_uniform": [0.01, 100]},
            "a.number": {"integers": [1, 6]},
            "a.word": {"choice": ["city", "forest", None]},
        },
    )
    rows = [drawn(draws.values, member) for member in draws.members()]
    uniform = [row["a.uniform"] for row in rows]
    assert min(uniform) >= -1 and max(uniform) <= 3
    assert abs(sum(uniform) / len(rows) - 1) < 0.1
    assert sum(row["a.logarithm"] < 1 for row in rows) == pytest.approx(1000, abs=100)
    for number in range(1, 7):
        assert sum(row["a.number"] == number for row in rows) > 250
    for word in ("city", "forest", None):
        assert sum(row["a.word"] == word for row in rows) > 550


def test_models_get_names_that_stay_theirs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for path in ("models/chair.glb", "models/b/chair.glb", "models/b_chair.glb", "models/x y.obj"):
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        Path(path).touch()
    Path("models/notes.txt").touch()
    models = family(models="models/**/*")
    before = {member.model: member.name for member in models.members()}
    assert before["models/chair.glb"] == "chair_glb"
    assert before["models/b_chair.glb"] == "b_chair_glb"
    assert before.keys().isdisjoint({"models/notes.txt"})
    assert len({*before.values()}) == 4
    Path("models/b-chair.glb").touch()
    after = {member.model: member.name for member in models.members()}
    assert before.items() <= after.items()
    assert len({*after.values()}) == 5


def test_a_family_without_models_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("face.obj").touch()
    for models in ("models/*.glb", ["*.obj", "models/*.glb"]):
        with pytest.raises(UserError, match=r"family\.models: is 'models/\*\.glb'"):
            family(models=models).members()
    for models in ([], [""], "", 3, [["*.obj"]]):
        with pytest.raises(ValidationError, match="models"):
            family(models=models)


def test_a_family_takes_models_of_several_paths(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for path in ("chairs/a.glb", "chairs/old/b.glb", "tables/c.obj", "tables/d.ply"):
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        Path(path).touch()
    chairs = by_name(family(models="chairs/**/*.glb").members())
    assert by_name(family(models=["chairs/**/*.glb"]).members()) == chairs
    both = by_name(family(models=["chairs/**/*.glb", "tables/*.obj"]).members())
    # A further path changes no member.
    assert both == chairs | {"c_obj": Member(name="c_obj", model="tables/c.obj")}
    assert len(chairs) == 2


@pytest.mark.parametrize(
    ("models", "said"),
    [
        (["a/*.glb", "a/**/*.glb"], "a/chair.glb matches 'a/*.glb' and 'a/**/*.glb'"),
        (["a/*.glb", "./a/*.glb"], "./a/chair.glb matches 'a/*.glb' and './a/*.glb'"),
        (["a/*.glb", "a/*.glb"], "a/chair.glb matches 'a/*.glb' and 'a/*.glb'"),
        (["a/*.glb", "b/*.glb"], "a/chair.glb and b/chair.glb would both be the member chair_glb"),
    ],
)
def test_a_file_or_name_of_two_members_is_refused(tmp_path, monkeypatch, models, said):
    monkeypatch.chdir(tmp_path)
    for path in ("a/chair.glb", "b/chair.glb"):
        Path(path).parent.mkdir()
        Path(path).touch()
    with pytest.raises(UserError) as caught:
        family(models=models).members()
    assert str(caught.value).startswith(f"family.models: {said}")
    assert len(family(models="*/*.glb").members()) == 2


def test_a_new_seed_changes_one_batch_and_a_new_model_too(tmp_path, monkeypatch):
    before = family(seeds="3-99", batch=10).batches()
    after = family(seeds="3-100", batch=10).batches()
    assert [member.seed for member in before["seeds_0010_0019"]] == [*range(10, 20)]
    assert {name for name, members in after.items() if before.get(name) != members} == {
        "seeds_0100_0109"
    }
    monkeypatch.chdir(tmp_path)
    for number in range(50):
        Path(f"model{number}.obj").touch()
    before = family(models="*.obj", batch=16).batches()
    Path("new.obj").touch()
    after = family(models="*.obj", batch=16).batches()
    assert sum(len(members) for members in after.values()) == 51
    assert sum(before[name] != members for name, members in after.items()) == 1


def test_all_members_show_the_place_that_the_yaml_names():
    scene = {"builder": "room", "parameters": {"place": 3}}
    member = family(seeds="7-7").members()[0]
    made = member_content({"scene": scene, "family": {"seeds": "7-7"}}, member, {})
    assert made["scene"]["parameters"] == {"place": 3, "seed": 7}


def test_a_member_gets_its_seed_and_values_and_the_familys_yaml_stays_as_it_is():
    content = {"scene": {"builder": "room"}, "render": {"samples": 4}, "family": {"seeds": "0-9"}}
    before = json.dumps(content)
    member = family(seeds="7-7").members()[0]
    values = {"render.samples": 2, "rigs.LF.camera.fov": 60}
    made = member_content(content, member, values)
    assert made["scene"] == {"builder": "room", "parameters": {"seed": 7, "place": 7}}
    assert made["render"]["samples"] == 2
    assert made["rigs"]["LF"]["camera"]["fov"] == 60
    assert "family" not in made
    assert json.dumps(content) == before


OF_MODELS = {"render": {"samples": 1}, "rigs": {"ring": {"type": "ring", "count": 2, "size": 3}}}
OF_MODELS["rigs"]["ring"]["camera"] = {"lens": "rectilinear", "fov": 50, "resolution": [8, 8]}


@pytest.mark.parametrize(
    "models", ["models/*.obj", "models/*.PLY", "models/**/*", ["a/*.obj"], ["a/*.glb", "b/*.obj"]]
)
def test_a_family_of_models_takes_the_keys_of_its_format(models):
    scene = {"up": "z", "unit": "metres"}
    content = {"scene": scene, "family": {"models": models}, **OF_MODELS}
    assert check_member(stand_in(content), "models.yaml").scene.up == "z"


def test_a_family_of_gltf_models_says_that_they_know_their_axes():
    content = {"scene": {"up": "z"}, "family": {"models": "models/*.glb"}, **OF_MODELS}
    with pytest.raises(UserError, match=r"up: is only for OBJ, PLY and STL"):
        check_member(stand_in(content), "models.yaml")


def test_a_wrong_value_of_a_member_names_the_member_and_the_key():
    content = {"scene": {"builder": "room"}, "render": {"samples": 0}}
    with pytest.raises(UserError, match=r"^rooms\.yaml: member 0007: render\.samples: is 0"):
        check_member(content, "rooms.yaml: member 0007")


DIED = [{"started": 1}, {"member": "0001", "began": 2}, {"member": "0001", "finished": 3}]
DIED += [{"member": "0002", "began": 3}]


def test_the_history_says_at_which_member_a_run_died():
    assert member_at_hand(DIED) == "0002"
    assert member_at_hand(DIED[:3]) is None
    assert member_at_hand([*DIED, {"failed": "0002"}]) is None


def test_a_member_has_failed_when_three_runs_died_at_it_and_not_before():
    again = [{"started": 5}, {"member": "0002", "began": 6}]
    assert deadly_members(DIED) == set()
    assert deadly_members([*DIED, *again]) == set()
    assert deadly_members([*DIED, *again, *again]) == {"0002"}
    elsewhere = [{"started": 5}, {"member": "0003", "began": 6}]
    assert deadly_members([*DIED, *again, *elsewhere]) == set()
    # Another worker of the same run went on.
    assert deadly_members([*DIED, {"failed": "0002"}, *again, *again]) == set()


def test_a_member_that_an_error_stopped_was_not_killed():
    began = [{"started": 1}, {"member": "0002", "began": 2}]
    stopped = [*began, {"stopped": "0002"}]
    assert member_at_hand(stopped) is None
    assert deadly_members(stopped * 3) == set()
    killed = [*began, {"killed": "0002"}, {"member": "0003", "began": 3}]
    assert deadly_members(killed * 2) == set()
    assert deadly_members([*killed, *began, *killed]) == {"0002"}


def count(folder, *states):
    members = [{"name": f"{number:04d}", "state": state} for number, state in enumerate(states)]
    failures = [
        {"name": member["name"], "stage": "render", "cause": "too dark"}
        for member in members
        if member["state"] == "failed"
    ]
    write_json(folder / "corpus.json", {"members": members, "failures": failures})
    write_json(folder / "settings.json", {"family": "rooms"})
    paths = {
        f"--{Path(name).stem}": folder / name
        for name in ("settings.json", "corpus.json", "failed.txt")
    }
    command = [forks.python(), ROOT / "scripts/count_members.py", *itertools.chain(*paths.items())]
    return subprocess.run(
        [*command, "--output", folder / "members.json"],
        capture_output=True,
        text=True,
        check=False,
    )


def test_failed_members_are_counted_and_listed(tmp_path):
    done = count(tmp_path, "valid", "failed", "valid", "failed")
    assert done.returncode == 1
    assert "2 of 4 members of rooms built, 2 failed:" in done.stderr
    assert done.stderr.count("\n") == 1
    rows = (tmp_path / "failed.txt").read_text().splitlines()
    assert rows == ["0001: render: too dark", "0003: render: too dark"]
    assert not (tmp_path / "members.json").exists()
    done = count(tmp_path, "valid", "valid")
    assert done.returncode == 0
    assert "2 of 2 members of rooms built" in done.stdout
    assert not (tmp_path / "failed.txt").exists()
    assert (tmp_path / "members.json").exists()


MODELS = """
scene: {{light: {light}}}
render: {{samples: 1}}
rigs:
  ring:
    type: ring
    count: 2
    size: 3
    camera: {{lens: rectilinear, fov: 50, resolution: [8, 8]}}
family: {{models: models/*.obj, values: {values}}}
"""


@pytest.mark.slow
def test_wrong_models_are_refused_in_one_line(tmp_path):
    models = MODELS.replace("models/*.obj", '["*.obj", "none/*.obj"]')
    folder = checkout(tmp_path / "plenoforge", faces=models.format(light="city", values="{}"))
    (folder / "face.obj").write_text(FACE)
    run = snakemake(folder, "--dry-run", "--config", "scenes=[faces]", "rigs=all")
    assert run.returncode == 1
    said = [line for line in run.stderr.splitlines() if not line.startswith("Using workflow")]
    assert len(said) == 1
    assert re.match(r"error: configs/scenes/faces\.yaml:\d+: family\.models: is 'none/", said[0])


@pytest.mark.slow
def test_another_light_of_the_softboxes_builds_only_families_in_softboxes_again(tmp_path):
    drawn_light = "{scene.light: {choice: [city, softboxes]}}"
    scenes = {
        "boxes": MODELS.format(light="softboxes", values="{}"),
        "drawn": MODELS.format(light="city", values=drawn_light),
        "city": MODELS.format(light="city", values="{}"),
    }
    folder = checkout(tmp_path / "plenoforge", **scenes)
    (folder / "models").mkdir()
    (folder / "models/face.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n")

    def planned_settings():
        # A plan writes only settings that are missing.
        shutil.rmtree(folder / "work", ignore_errors=True)
        choice = ("--config", f"scenes=[{','.join(scenes)}]", "rigs=all", "preset=full")
        plan = snakemake(folder, "--dry-run", *choice)
        assert plan.returncode == 0, plan.stderr
        files = {name: folder.glob(f"work/{name}/settings/batches/*.json") for name in scenes}
        return {name: [path.read_text() for path in files[name]] for name in scenes}

    before = planned_settings()
    assert all(before.values())
    text = folder / "scripts/lightfield/configuration/keys.py"
    text.write_text(text.read_text().replace('"softboxes": ', '"softboxes": 1000'))
    after = planned_settings()
    assert [name for name in scenes if before[name] != after[name]] == ["boxes", "drawn"]


# ---- files that change while members are built ------------------------------------------------

# It is seen from all sides.
FACE = "v 0 0 0\nv 1 0.5 0\nv 0 0.5 1\nvt 0 0\nf 1/1 2/1 3/1\n"
RING = {"type": "ring", "count": 2, "size": 3}
RING["camera"] = {"lens": "rectilinear", "fov": 50, "resolution": [8, 8]}


@pytest.fixture
def face(tmp_path):
    """Return a function that gives the settings of a family with one model, a face."""
    (tmp_path / "face.obj").write_text(FACE)

    def settings(**rig):
        return BatchSettings(
            family="faces",
            scene={"scene": {}, "render": {"samples": 1}, "rigs": {"ring": RING | rig}},
            members=[Member(name="face", model=str(tmp_path / "face.obj"))],
            results=str(tmp_path / "results"),
            work=str(tmp_path / "work"),
        )

    return settings


def build_of(settings):
    return MemberBuild(settings, settings.members[0])


@pytest.mark.slow
def test_a_model_that_changes_after_its_import_fails_its_batch(face, tmp_path, monkeypatch):
    path = tmp_path / "face.obj"
    render = RenderShard.run

    def change_and_render(job):
        path.write_text(FACE.replace("v 1", "v 2"))
        render(job)

    monkeypatch.setattr(RenderShard, "run", change_and_render)
    build = build_of(face())
    with pytest.raises(UserError, match=r"face\.obj: has changed while this job read it"):
        build.build("cpu", 1)
    assert not build.is_finished()
    monkeypatch.undo()
    assert build.build("cpu", 1)["state"] == "valid"
    assert build.is_finished()


@pytest.mark.slow
def test_an_invalid_member_keeps_its_files_and_names_its_validation(face, tmp_path):
    # A closed box around the cameras, which no light enters.
    corners = [f"v {x} {y} {z}\n" for x in (0, 9) for y in (0, 9) for z in (0, 9)]
    sides = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    box = "".join([*corners, *(f"f {side}\n" for side in sides)])
    (tmp_path / "face.obj").write_text(box)
    failure = build_of(face(size=0.1)).build("cpu", 1)["failure"]
    assert failure["stage"] == "publish_checksums"
    assert "exr/view_0000f.exr: is black" in failure["cause"]
    assert (tmp_path / "results/faces/face/ring/exr/view_0000f.exr").is_file()
    validation = tmp_path / "results/faces/face/ring/validation.json"
    assert failure["cause"].endswith(f"see {validation}")
    assert json.loads(validation.read_text())["valid"] is False
    assert not validation.with_name("sha256sums.txt").exists()


@pytest.mark.slow
def test_a_rig_that_tests_is_placed_as_the_rig_that_trains(face, tmp_path):
    settings = face()
    content = settings.scene | {
        # The rig that tests comes first, and is smaller.
        "rigs": {"a": RING | {"split": "test", "size": 2}, "b": RING | {"split": "train"}},
        "exports": {"instant_ngp": {"sources": ["views"]}},
    }
    build = build_of(settings.model_copy(update={"scene": content}))
    assert build.build("cpu", 1)["state"] == "valid"
    tested, trained = (read_json(build.folder / rig / "transforms.json") for rig in "ab")
    assert (tested["scale"], tested["offset"]) == (trained["scale"], trained["offset"])
    distances = [
        np.linalg.norm(np.array(export["frames"][0]["transform_matrix"])[:3, 3])
        for export in (tested, trained)
    ]
    assert distances[1] == pytest.approx(1.5 * distances[0])


@pytest.mark.slow
def test_views_of_members_are_kept_without_their_folder_of_work(face, tmp_path):
    """Their published checksums tell which are intact."""
    build = build_of(face())
    assert build.build("cpu", 1)["state"] == "valid"
    assert rendered_views(build) == ["view_0000f", "view_0001f"]
    before = files_of(build.folder)
    shutil.rmtree(tmp_path / "work")
    assert not build.is_finished()
    assert build.build("cpu", 1)["state"] == "valid"
    assert rendered_views(build) == []
    assert files_of(build.folder) == before
    assert build.is_finished()


def rendered_views(build):
    """Return the views that processes have rendered of a member, by its receipt."""
    return [line["view"] for line in receipts.history(build.receipt) if "render_seconds" in line]


def files_of(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


LARGE = {"camera": RING["camera"] | {"resolution": [400, 400]}}


@pytest.mark.slow
@pytest.mark.parametrize(("largest", "rig"), [(8192, {}), (200_000, LARGE)], ids=["scene", "view"])
def test_a_limit_of_file_sizes_is_no_failure_of_a_member(face, largest, rig):
    build = build_of(face(**rig))
    with largest_file(largest), pytest.raises(UserError, match=r"limit|free some space"):
        build.build("cpu", 1)
    assert not build.record.exists()
    assert not build.is_finished()
    assert build.build("cpu", 1)["state"] == "valid"


@pytest.mark.slow
@pytest.mark.parametrize("target", [None, "/proc/self/mem"], ids=["missing", "an I/O error"])
def test_a_model_that_cannot_be_read_is_no_failure_of_a_member(face, tmp_path, target):
    build = build_of(face())
    model = tmp_path / "face.obj"
    model.unlink()
    if target:
        model.symlink_to(target)
    with pytest.raises(UserError, match=re.escape(str(model))):
        build.build("cpu", 1)
    assert not build.record.exists()
    assert not build.is_finished()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("error", "state"),
    [("MemoryError()", None), ("OSError(28, 'No space left')", None), ("ValueError()", "failed")],
)
def test_only_an_error_of_an_own_builder_itself_is_a_failure(tmp_path, monkeypatch, error, state):
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(f"def build(parameters):\n    raise {error}\n")
    settings = BatchSettings(
        family="mine",
        scene={"scene": {"builder": "mine.py"}, "render": {"samples": 1}, "rigs": {"ring": RING}},
        members=[Member(name="0001", seed=1)],
    )
    build = build_of(settings)
    with nullcontext() if state else pytest.raises(UserError, match=r"^mine\.py:2: "):
        build.build("cpu", 1)
    assert build.record.exists() == bool(state)


def flip_at_the_old_time(path):
    """Change a bit of a file, and keep its size and time."""
    status = path.stat()
    content = bytearray(path.read_bytes())
    content[-40] ^= 1
    path.write_bytes(content)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


@pytest.mark.slow
@pytest.mark.parametrize("damage", [flip_at_the_old_time, Path.unlink], ids=["flipped", "removed"])
def test_a_view_that_is_damaged_while_its_member_is_built_is_made_again(
    face, tmp_path, monkeypatch, damage
):
    build = build_of(face())
    build.build("cpu", 1)
    before = files_of(build.folder)
    shutil.rmtree(tmp_path / "results")
    shutil.rmtree(tmp_path / "work")
    render = RenderShard.run
    damages = iter([damage])

    def render_and_damage(job):
        render(job)
        for damage in itertools.islice(damages, 1):
            damage(job.output / "view_0001f.exr")

    monkeypatch.setattr(RenderShard, "run", render_and_damage)
    assert build.build("cpu", 1)["state"] == "valid"
    assert files_of(build.folder) == before
    assert rendered_views(build) == ["view_0000f", "view_0001f", "view_0001f"]


@pytest.mark.slow
def test_a_failed_member_keeps_what_is_whole_and_moves_the_rest(face, tmp_path, monkeypatch):
    build = build_of(face())
    build.build("cpu", 1)
    before = files_of(build.folder)
    dataset = build.folder / "ring"
    (dataset / "notes.txt").write_text("mine")
    flip_at_the_old_time(dataset / "lightfield.json")

    def refuse(job):
        raise UserError("nothing to see")

    changed = build_of(face(split={"test": ["view_0001f"]}))
    with monkeypatch.context() as patch:
        patch.setattr(RenderShard, "run", refuse)
        assert changed.build("cpu", 1)["failure"]["cause"] == "nothing to see"
    view = dataset / "exr/view_0000f.exr"
    assert view.read_bytes() == before[view]
    assert not (dataset / "sha256sums.txt").exists()
    removed = tmp_path / "work/removed" / dataset.relative_to("/")
    assert (removed / "notes.txt").read_text() == "mine"
    assert (removed / "lightfield.json").exists()
    assert build.build("cpu", 1)["state"] == "valid"
    assert files_of(build.folder) == before
    assert rendered_views(build) == ["view_0000f", "view_0001f"]


def test_a_failed_member_keeps_what_its_links_lead_to(face, tmp_path):
    build = build_of(face())
    build.folder.mkdir(parents=True)
    (tmp_path / "disk").mkdir()
    (tmp_path / "disk/mine.txt").write_text("mine")
    (build.folder / "ring").symlink_to(tmp_path / "disk")
    (build.folder / "half").mkdir()
    build.note_death("out of memory")
    record = read_json(build.record)
    assert record["state"] == "failed"
    assert record["failure"]["cause"] == "out of memory"
    assert [path.name for path in build.folder.iterdir()] == ["member.json"]
    assert (tmp_path / "disk/mine.txt").read_text() == "mine"


# ---- what members took -------------------------------------------------------------------------


def listed_members(build):
    """Collect the family of a member. Return the lines of its members by their names."""
    settings = CorpusSettings(family="faces", inputs=[str(build.record)])
    receipt = build.receipt.parents[1] / "corpus.jsonl"
    Corpus(
        settings=settings,
        folder=build.folder.parent,
        cache=build.work.parent / "looks.json",
        receipt=receipt,
    ).run()
    lines = (build.folder.parent / "report/members.jsonl").read_text().splitlines()
    return {row["name"]: row for row in map(json.loads, lines)}


@pytest.mark.slow
def test_the_list_of_members_has_what_the_last_build_of_each_took(face, tmp_path):
    build = build_of(face())
    began, cpu_began = time.time(), time.process_time()
    build.build("cpu", 1)
    seconds, cpu_seconds = time.time() - began, time.process_time() - cpu_began
    row = listed_members(build)["face"]
    assert 0 < row["seconds"] <= seconds + 0.001
    assert row["seconds"] == pytest.approx(seconds, abs=0.5)
    assert row["cpu_seconds"] == pytest.approx(cpu_seconds, abs=0.5)
    assert began <= row["built"] <= time.time()
    assert row["stage_cpu_seconds"].keys() >= {"import_model", "render_shard", "validate"}
    assert sum(row["stage_cpu_seconds"].values()) <= row["cpu_seconds"] + 0.01

    # A failed member has its cause, and the time until it failed.
    (tmp_path / "face.obj").write_text("nothing")
    build.build("cpu", 1)
    failed = listed_members(build)["face"]
    assert (failed["state"], failed["failed_stage"]) == ("failed", "import_model")
    assert "face.obj" in failed["error"]
    assert failed["built"] > row["built"]
    assert failed["stage_cpu_seconds"].keys() == {"import_model"}

    # Nobody knows what a process took that died.
    build.note_death("killed by SIGSEGV")
    died = listed_members(build)["face"]
    assert (died["error"], died["seconds"], died["cpu_seconds"]) == (
        "killed by SIGSEGV",
        None,
        None,
    )


# ---- batches, as a run finds them --------------------------------------------------------------

BATCH = Path("work/receipts/faces/batches/models.jsonl")
RED = f"mtllib face.mtl\nusemtl red\n{FACE}"


def batch_settings(samples=1, **split):
    """Return the settings of a family of two models, a face and a side."""
    return BatchSettings(
        family="faces",
        scene={"scene": {}, "render": {"samples": samples}, "rigs": {"ring": RING | split}},
        members=[Member(name=name, model=f"{name}.obj") for name in ("face", "side")],
    )


@pytest.fixture(scope="module")
def run_batch(run_program):
    """Return a function that runs the job of a batch in the present folder."""

    def run(settings):
        write_json(Path("settings.json"), settings.as_json())
        run_program("build_members.py", "--settings", "settings.json", "--receipt", BATCH)

    return run


def verdict(settings):
    """Return what the check before a plan finds about the batch."""
    check = JobCheck(Path("work"), Path("results"), lambda _: None, VERSIONS)
    return check.verdict(str(BATCH), settings.as_json())


def begun():
    return [line["member"] for line in receipts.history(BATCH) if "began" in line]


SPLIT = {"split": {"test": ["view_0001f"]}}


@pytest.fixture(scope="module")
def finished_batch(tmp_path_factory, run_batch):
    """A finished batch of two members."""
    folder = tmp_path_factory.mktemp("batch")
    with contextlib.chdir(folder):
        Path("face.obj").write_text(FACE)
        Path("side.obj").write_text(FACE.replace("0.5 1", "1 1"))
        run_batch(batch_settings(**SPLIT))
    return folder


@pytest.fixture
def batch(finished_batch, tmp_path, monkeypatch):
    """A copy of the batch, as the present folder. Returns its settings."""
    shutil.copytree(finished_batch, tmp_path / "batch")
    monkeypatch.chdir(tmp_path / "batch")
    assert verdict(batch_settings(**SPLIT)).is_fine
    return batch_settings(**SPLIT)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "damage"), [("member.json", "{}"), ("splits.json", None), ("ring/sha256sums.txt", "")]
)
def test_a_plan_finds_a_damaged_member_and_its_batch_mends_it_alone(run_batch, batch, name, damage):
    path = Path("results/faces/face", name)
    before = files_of(Path("results"))
    times = {each: each.stat().st_mtime_ns for each in before if "side" in each.parts}
    views = receipts.read(Path("work/receipts/faces/face/member.jsonl")).history
    path.unlink()
    if damage is not None:
        path.write_text(damage)
    assert verdict(batch).damaged == [str(path)]
    run_batch(batch)
    assert verdict(batch).is_fine
    assert begun() == ["face", "side", "face"]
    assert files_of(Path("results")) == before
    assert {each: each.stat().st_mtime_ns for each in times} == times
    history = receipts.read(Path("work/receipts/faces/face/member.jsonl")).history
    assert not [line for line in history[len(views) :] if "render_seconds" in line]


@pytest.mark.slow
def test_a_damaged_view_is_mended_when_its_batch_runs(run_batch, batch):
    view = Path("results/faces/side/ring/exr/view_0000f.exr")
    content = view.read_bytes()
    view.write_bytes(content[:-1])
    # A plan looks at a few files of each member alone.
    assert verdict(batch).is_fine
    run_batch(batch)
    assert begun() == ["face", "side", "side"]
    assert view.read_bytes() == content


@pytest.mark.slow
def test_a_flipped_view_costs_no_member_when_its_settings_change(run_batch, batch):
    def with_points(count):
        exports = {"colmap": {"sources": ["views"], "points": count}}
        return batch.model_copy(update={"scene": batch.scene | {"exports": exports}})

    run_batch(with_points(90))
    before = files_of(Path("results"))
    run_batch(with_points(100))
    build = build_of(with_points(90))
    rendered = rendered_views(build)
    view = Path("results/faces/face/ring/exr/view_0000f.exr")
    flip_at_the_old_time(view)
    damaged = view.read_bytes()

    run_batch(with_points(90))
    assert read_json(build.record)["state"] == "valid"
    assert files_of(Path("results")) == before
    assert Path("work/removed", view).read_bytes() == damaged
    assert rendered_views(build) == [*rendered, "view_0000f"]
    assert faults(Path("results/faces"), Path("work")) == {}


@pytest.mark.slow
def test_a_limit_of_file_sizes_ends_a_batch_in_one_line_and_the_next_run_goes_on(
    run_program, batch
):
    settings = batch.model_copy(update={"scene": batch.scene | {"rigs": {"ring": RING | LARGE}}})
    write_json(Path("settings.json"), settings.as_json())
    job = ("build_members.py", "--settings", "settings.json", "--receipt", BATCH)

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, resource.RLIM_INFINITY))

    run = run_program(*job, check=False, in_fork=False, preexec_fn=limit)
    assert run.returncode == 1
    assert run.stderr.splitlines()[-1].startswith("error: ")
    assert "Traceback" not in run.stderr
    assert not [*Path("results").rglob("member.json")]
    run_program(*job)
    states = [read_json(path)["state"] for path in Path("results").rglob("member.json")]
    assert states == ["valid", "valid"]


@pytest.mark.slow
def test_a_changed_model_builds_its_member_again(run_batch, batch):
    Path("side.obj").write_text(FACE.replace("0.5 1", "2 1"))
    assert verdict(batch).outdated == ["side.obj"]
    run_batch(batch)
    assert begun() == ["face", "side", "side"]
    assert verdict(batch).is_fine


@pytest.mark.slow
def test_changed_poses_build_the_members_again(run_batch, batch):
    Path("poses.csv").write_text("name,x,y,z,rx,ry,rz\na,0,-3,0,1.5,0,0\n")
    rig = {"type": "poses", "file": "poses.csv", "camera": RING["camera"]}
    posed = batch.model_copy(update={"scene": batch.scene | {"rigs": {"ring": rig}}})
    run_batch(posed)
    assert read_json(Path("results/faces/face/member.json"))["state"] == "valid"
    assert verdict(posed).is_fine
    Path("poses.csv").write_text("name,x,y,z,rx,ry,rz\na,0,-4,0,1.5,0,0\n")
    assert verdict(posed).outdated == ["poses.csv"]


@pytest.mark.slow
def test_a_changed_calibration_builds_the_members_again(run_batch, batch):
    Path("cameras.txt").write_text("1 SIMPLE_PINHOLE 16 16 14 8 8\n")
    ring = batch.scene["rigs"]["ring"] | {"camera": {"lens": "calibrated", "file": "cameras.txt"}}
    calibrated = batch.model_copy(update={"scene": batch.scene | {"rigs": {"ring": ring}}})
    run_batch(calibrated)
    assert read_json(Path("results/faces/face/member.json"))["state"] == "valid"
    assert verdict(calibrated).is_fine
    Path("cameras.txt").write_text("1 SIMPLE_PINHOLE 16 16 15 8 8\n")
    assert verdict(calibrated).outdated == ["cameras.txt"]


@pytest.mark.slow
def test_a_changed_light_builds_the_members_again(run_batch, batch):
    lit = batch.model_copy(update={"scene": batch.scene | {"scene": {"light": "sky.exr"}}})
    write_exr(Path("sky.exr"), {name: np.ones((2, 4), np.float32) for name in "RGB"})
    run_batch(lit)
    assert read_json(Path("results/faces/face/member.json"))["state"] == "valid"
    assert verdict(lit).is_fine
    write_exr(Path("sky.exr"), {name: np.zeros((2, 4), np.float32) for name in "RGB"})
    assert verdict(lit).outdated == ["sky.exr"]
    # The light may be why a process died.
    build = build_of(lit)
    build.note_death("killed")
    assert receipts.read(build.receipt).inputs.keys() >= {"face.obj", "sky.exr"}


@pytest.mark.slow
def test_a_new_description_builds_no_member_again(run_batch, batch):
    described = batch.model_copy(update={"scene": batch.scene | {"description": "Two faces."}})
    assert verdict(described).outdated == ["setting scene"]
    run_batch(described)
    assert begun() == ["face", "side"]
    run_batch(batch_settings(samples=2, **SPLIT))
    assert begun() == ["face", "side", "face", "side"]


@pytest.mark.slow
def test_a_missing_texture_and_later_its_file_make_a_batch_outdated(run_batch, batch):
    Path("face.obj").write_text(RED)
    Path("face.mtl").write_text("newmtl red\nmap_Kd red.png\n")
    # Blender reads a library with the name of the OBJ, so its arrival counts, too.
    assert verdict(batch).outdated == ["face.obj", "face.mtl"]
    run_batch(batch)
    member = read_json(Path("results/faces/face/member.json"))
    assert member["state"] == "failed"
    assert "red.png" in member["failure"]["cause"]
    assert verdict(batch).is_fine
    write_png(Path("red.png"), np.zeros((4, 4, 3), np.uint8))
    assert verdict(batch).outdated == ["red.png"]
    run_batch(batch)
    assert read_json(Path("results/faces/face/member.json"))["state"] == "valid"
    assert verdict(batch).is_fine


@pytest.mark.slow
def test_a_failed_member_is_tried_again_whenever_its_batch_starts(run_batch, batch):
    Path("face.obj").write_text("nothing")
    run_batch(batch)
    assert verdict(batch).is_fine
    run_batch(batch)
    assert begun() == ["face", "side", "face", "face"]


@pytest.mark.slow
def test_a_model_that_changes_while_its_batch_runs_is_named(run_batch, batch, monkeypatch):
    """The batch is then not finished: the next run builds the member again."""
    Path("face.obj").write_text(FACE.replace("v 1", "v 2"))

    def build_and_change(job, *_):
        for member in job.settings.members:
            MemberBuild(job.settings, member).build("cpu", 1)
        Path("face.obj").write_text(FACE.replace("v 1", "v 3"))
        return 0

    monkeypatch.setattr(family_batch, "_work", build_and_change)
    with pytest.raises(UserError, match=r"^face\.obj: has changed since face was built"):
        BuildMembers(settings=batch, receipt=BATCH).run()
    assert verdict(batch).outdated == ["face.obj"]
    run_batch(batch)
    assert verdict(batch).is_fine
