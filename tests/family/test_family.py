"""Families: names, values and batches of their members, and what a run makes of failures."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import forks
import numpy as np
import pytest
from checkouts import checkout, snakemake

from lightfield.configuration.family import Family, Member, drawn, member_content, outdated_members
from lightfield.configuration.scene_yaml import check_member
from lightfield.core.errors import UserError
from lightfield.core.files import size_and_time
from lightfield.family.batch import deadly_member, member_at_hand
from lightfield.imaging.images import write_png
from lightfield.stages.checks import Validate
from lightfield.stages.family import BatchSettings
from lightfield.stages.views import RenderShard

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
    with pytest.raises(UserError, match=r"family\.models: is 'models/\*\.glb'"):
        family(models="models/*.glb").members()


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


def test_a_wrong_value_of_a_member_names_the_member_and_the_key():
    content = {"scene": {"builder": "room"}, "render": {"samples": 0}}
    with pytest.raises(UserError, match=r"^rooms\.yaml: member 0007: render\.samples: is 0"):
        check_member(content, "rooms.yaml: member 0007")


def record_of(folder, sources):
    member = folder / "results/0000"
    (member / "LF").mkdir(parents=True)
    (member / "member.json").touch()
    (member / "LF/sha256sums.txt").touch()
    failed = folder / "results/0001"
    failed.mkdir()
    (failed / "member.json").touch()
    members = {
        "0000": {"state": "valid", "datasets": {"LF": {"split": None}}},
        "0001": {"state": "failed"},
    }
    path = folder / "record.json"
    path.write_text(json.dumps({"members": members, "sources": sources}))
    return path


@pytest.mark.parametrize("name", ["0000/member.json", "0000/LF/sha256sums.txt", "0001/member.json"])
def test_a_missing_file_of_a_member_makes_its_batch_outdated(tmp_path, name):
    record = record_of(tmp_path, {})
    assert not outdated_members(record, tmp_path / "results")
    (tmp_path / "results" / name).unlink()
    assert outdated_members(record, tmp_path / "results")


def test_a_changed_or_added_model_file_makes_its_batch_outdated(tmp_path):
    model = tmp_path / "model.obj"
    model.write_text("v 0 0 0")
    status = model.stat()
    texture = tmp_path / "texture.png"
    sources = {str(model): [status.st_size, status.st_mtime_ns], str(texture): None}
    record = record_of(tmp_path, sources)
    assert not outdated_members(record, tmp_path / "results")
    texture.touch()
    assert outdated_members(record, tmp_path / "results")
    texture.unlink()
    os.utime(model, ns=(0, 0))
    assert outdated_members(record, tmp_path / "results")


def test_a_damaged_record_is_outdated(tmp_path):
    record = record_of(tmp_path, {})
    record.write_text("{")
    assert outdated_members(record, tmp_path / "results")


DIED = [{"started": 1}, {"member": "0001", "began": 2}, {"member": "0001", "finished": 3}]
DIED += [{"member": "0002", "began": 3}]


def test_the_journal_says_at_which_member_a_run_died():
    assert member_at_hand(DIED) == "0002"
    assert member_at_hand(DIED[:3]) is None
    assert member_at_hand([*DIED, {"failed": "0002"}]) is None


def test_a_member_has_failed_when_three_runs_died_at_it_and_not_before():
    again = [{"started": 5}, {"member": "0002", "began": 6}]
    assert deadly_member(DIED) is None
    assert deadly_member([*DIED, *again]) is None
    assert deadly_member([*DIED, *again, *again]) == "0002"
    elsewhere = [{"started": 5}, {"member": "0003", "began": 6}]
    assert deadly_member([*DIED, *again, *elsewhere]) is None
    # Another worker of the same run went on.
    assert deadly_member([*DIED, {"failed": "0002"}, *again, *again]) is None


def count(folder, *states):
    members = {
        f"{number:04d}": {"state": state, "failure": {"stage": "render", "cause": "too dark"}}
        for number, state in enumerate(states)
    }
    (folder / "record.json").write_text(json.dumps({"members": members}))
    settings = {"family": "rooms", "records": [str(folder / "record.json")]}
    (folder / "settings.json").write_text(json.dumps(settings))
    paths = {name: str(folder / name) for name in ("settings.json", "failed.txt", "members.json")}
    command = [forks.python(), ROOT / "scripts/count_members.py"]
    command += ["--settings", paths["settings.json"], "--failed", paths["failed.txt"]]
    return subprocess.run(
        [*command, "--output", paths["members.json"]], capture_output=True, text=True, check=False
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

    def batch_settings():
        choice = ("--config", f"scenes=[{','.join(scenes)}]", "rigs=all", "preset=full")
        plan = snakemake(folder, "--dry-run", *choice)
        assert plan.returncode == 0, plan.stderr
        files = {name: folder.glob(f"work/{name}/settings/batches/*.json") for name in scenes}
        return {name: [path.read_text() for path in files[name]] for name in scenes}

    before = batch_settings()
    assert all(before.values())
    text = folder / "scripts/lightfield/configuration/keys.py"
    text.write_text(text.read_text().replace('"softboxes": ', '"softboxes": 1000'))
    after = batch_settings()
    assert [name for name in scenes if before[name] != after[name]] == ["boxes", "drawn"]


# ---- files that change while members are built ------------------------------------------------

FACE = "v 0 0 0\nv 1 0 0\nv 0 0 1\nvt 0 0\nf 1/1 2/1 3/1\n"
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
    from lightfield.family.member import MemberBuild

    return MemberBuild(settings, settings.members[0])


@pytest.mark.slow
def test_a_texture_that_was_missing_makes_its_batch_outdated(face, tmp_path, run_program):
    (tmp_path / "face.obj").write_text(f"mtllib face.mtl\nusemtl red\n{FACE}")
    (tmp_path / "face.mtl").write_text("newmtl red\nmap_Kd red.png\n")
    (tmp_path / "settings.json").write_text(json.dumps(face().as_json()))
    record = tmp_path / "work/faces/batches/models.json"
    arguments = ("--settings", tmp_path / "settings.json", "--record", record, "--device", "cpu")
    run_program("build_members.py", *arguments)
    member = json.loads(record.read_text())["members"]["face"]
    assert member["state"] == "failed" and "red.png" in member["failure"]["cause"]
    assert not outdated_members(record, tmp_path / "results/faces")
    write_png(tmp_path / "red.png", np.zeros((4, 4, 3), np.uint8))
    assert outdated_members(record, tmp_path / "results/faces")
    run_program("build_members.py", *arguments)
    assert json.loads(record.read_text())["members"]["face"]["state"] == "valid"
    assert not outdated_members(record, tmp_path / "results/faces")


@pytest.mark.slow
def test_a_model_that_changes_after_its_import_is_built_again(face, tmp_path, monkeypatch):
    path = tmp_path / "face.obj"
    render = RenderShard.run

    def change_and_render(job):
        path.write_text(FACE.replace("1 0 0", "2 0 0"))
        render(job)

    monkeypatch.setattr(RenderShard, "run", change_and_render)
    build = build_of(face())
    assert build.build("cpu", 1)["state"] == "valid"
    assert not build.is_finished()
    # The batch's record must have the time of the content that was read.
    assert build.source_stamps()[str(path)] != size_and_time(path)
    path.write_text(FACE)
    assert build.is_finished()
    assert build.source_stamps()[str(path)] == size_and_time(path)


@pytest.mark.slow
def test_an_invalid_member_keeps_its_files_and_names_its_validation(face, tmp_path, monkeypatch):
    validate = Validate.run

    def damage_and_validate(job):
        (job.dataset / "exr/view_0000f.exr").write_bytes(b"damaged")
        return validate(job)

    monkeypatch.setattr(Validate, "run", damage_and_validate)
    failure = build_of(face()).build("cpu", 1)["failure"]
    assert failure["stage"] == "validate"
    assert "exr/view_0000f.exr" in failure["cause"]
    validation = tmp_path / "results/faces/face/ring/validation.json"
    assert failure["cause"].endswith(f"see {validation}")
    assert json.loads(validation.read_text())["valid"] is False
    assert not validation.with_name("sha256sums.txt").exists()


@pytest.mark.slow
def test_members_are_kept_without_their_folder_of_work(face, tmp_path):
    build = build_of(face())
    assert build.build("cpu", 1)["state"] == "valid"
    shutil.rmtree(tmp_path / "work")
    assert build.is_finished()
    assert list(build.source_stamps()) == [str(tmp_path / "face.obj")]


@pytest.mark.slow
@pytest.mark.parametrize("damage", ["{}", None])
def test_a_member_with_a_damaged_splits_json_is_built_again(face, tmp_path, damage):
    build = build_of(face(split={"test": ["view_0001f"]}))
    assert build.build("cpu", 1)["state"] == "valid"
    assert build.is_finished()
    splits = tmp_path / "results/faces/face/splits.json"
    splits.unlink()
    if damage:
        splits.write_text(damage)
    assert not build.is_finished()


def test_a_failed_member_keeps_what_its_links_lead_to(face, tmp_path):
    build = build_of(face())
    build.folder.mkdir(parents=True)
    (tmp_path / "disk").mkdir()
    (tmp_path / "disk/mine.txt").write_text("mine")
    (build.folder / "ring").symlink_to(tmp_path / "disk")
    (build.folder / "half").mkdir()
    assert build.fail("render", "out of memory")["state"] == "failed"
    assert [path.name for path in build.folder.iterdir()] == ["member.json"]
    assert (tmp_path / "disk/mine.txt").read_text() == "mine"
