"""Pruning: members that a family no longer has are named, and removed on request."""

import shutil
import subprocess
from pathlib import Path

import families
import forks
import pytest
from checkouts import ROOT, checkout, snakemake

from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.stages.family import Prune

CAMERA = {"lens": "rectilinear", "fov": 50, "resolution": [8, 8]}
SCENE = {
    "scene": {"builder": "room"},
    "render": {"samples": 1},
    "rigs": {"plane": {"type": "plane", "cameras": [2, 1], "size": 1, "camera": CAMERA}},
    "family": {"seeds": "0-1", "batch": 1},
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The folder of a family of two seeds, which once had more: its results and its receipts."""
    monkeypatch.chdir(tmp_path)
    write_json(Path("configs/scenes/chairs.yaml"), SCENE)
    write_json(Path("configs/scenes/table.yaml"), {k: v for k, v in SCENE.items() if k != "family"})
    for number in range(3):
        families.add_member(Path("results/chairs"), f"{number:04d}")
        touch(f"work/receipts/chairs/{number:04d}/member.jsonl", f"work/chairs/{number:04d}/log")
        touch(f"work/receipts/chairs/batches/seeds_{number:04d}_{number:04d}.jsonl")
    return tmp_path


def touch(*names):
    for name in names:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).touch()


def prune(*scenes):
    Prune(
        results=Path("results"), work=Path("work"), family=[(each, each) for each in scenes]
    ).run()


def below(*folders):
    return {str(path) for folder in folders for path in Path(folder).rglob("*")}


def test_only_what_belongs_to_former_members_is_removed(folder, capsys):
    # Killed while it was built: it has no record.
    touch("results/chairs/0003/plane/lightfield.json", "work/receipts/chairs/0003/member.part")
    touch("results/chairs/thumbnails/0000.webp", "results/chairs/my notes/read me.txt")
    before = below("results", "work")
    prune("chairs")
    gone = before - below("results", "work")
    former = {path for path in before if {"0002", "0003"} & {*Path(path).parts}}
    assert gone == former | {"work/receipts/chairs/batches/seeds_0002_0002.jsonl"}
    assert capsys.readouterr().out.splitlines() == [
        "results/chairs/0002: removed",
        "results/chairs/0003: removed",
        "chairs: 2 former folders removed",
    ]
    prune("chairs")
    assert capsys.readouterr().out == "chairs: 0 former folders removed\n"


def test_what_links_of_a_former_member_lead_to_stays(folder, tmp_path):
    families.add_member(tmp_path / "elsewhere", "0004")
    Path("results/chairs/0004").symlink_to(tmp_path / "elsewhere/0004")
    touch("outside/view.exr")
    Path("results/chairs/0002/more").symlink_to(tmp_path / "outside")
    kept = below("elsewhere", "outside")
    prune("chairs")
    assert sorted(path.name for path in Path("results/chairs").iterdir()) == ["0000", "0001"]
    assert below("elsewhere", "outside") == kept


def test_datasets_of_a_rig_that_is_gone_are_removed(folder, capsys):
    for number in (0, 1):
        shutil.copytree(f"results/chairs/{number:04d}/plane", f"results/chairs/{number:04d}/ring")
        touch(f"work/chairs/{number:04d}/ring/cameras.json")
    touch("results/chairs/0000/my notes/read me.txt")
    before = below("results", "work")
    prune("chairs")
    gone = before - below("results", "work")
    of_2 = {path for path in before if "0002" in Path(path).parts}
    of_2.add("work/receipts/chairs/batches/seeds_0002_0002.jsonl")
    assert gone == of_2 | {path for path in before if "ring" in Path(path).parts}
    assert "results/chairs/0001/ring: removed\n" in capsys.readouterr().out


def test_a_scene_without_a_family_is_refused(folder):
    before = below("results", "work")
    with pytest.raises(UserError, match="--family: table has no block family"):
        prune("table")
    assert below("results", "work") == before


MODELS = """
scene: {}
render: {samples: 1}
rigs:
  ring:
    type: ring
    count: 2
    size: 3
    camera: {lens: rectilinear, fov: 50, resolution: [8, 8]}
family: {models: models/*.obj, batch: 2, corpus: {shards: true}}
"""
FACE = "v 0 0 0\nv 1 0.{0} 0\nv 0 0.5 1\nvt 0 0\nf 1/1 2/1 3/1\n"


def verify(folder, *arguments):
    command = [forks.python(), ROOT / "scripts/verify.py", "results/faces", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_removed_model_is_named_until_its_member_is_pruned(tmp_path):
    folder = checkout(tmp_path / "plenoforge", faces=MODELS)
    (folder / "models").mkdir()
    # Two batches, of which one remains.
    for number in range(3):
        (folder / f"models/face{number}.obj").write_text(FACE.format(number + 1))
    choice = ("--config", "scenes=[faces]", "rigs=all", "preset=full")
    run = snakemake(folder, *choice)
    assert run.returncode == 0, run.stderr
    assert "prune" not in run.stderr
    (folder / "models/face1.obj").unlink()

    run = snakemake(folder, *choice)
    assert run.returncode == 0, run.stderr
    (note,) = [line for line in run.stderr.splitlines() if "prune" in line]
    assert note.startswith("note: results/faces has what the family no longer has: face1_obj; ")
    checked = verify(folder)
    assert checked.returncode == 1
    (fault,) = checked.stdout.splitlines()
    assert fault.startswith("results/faces/face1_obj: is not in corpus.json any more")

    plan = snakemake(folder, "prune", "--dry-run", *choice)
    assert plan.returncode == 0, plan.stderr
    assert "would be removed: results/faces/face1_obj\n" in plan.stderr
    assert (folder / "results/faces/face1_obj/member.json").is_file()

    run = snakemake(folder, "prune", *choice)
    assert run.returncode == 0, run.stderr
    assert "results/faces/face1_obj: removed" in run.stdout
    assert not [path for path in folder.rglob("*") if path.name == "face1_obj"]
    for arguments in ((), ("--work", "work")):
        checked = verify(folder, *arguments)
        assert checked.returncode == 0, checked.stdout
    assert "Nothing to be done" in snakemake(folder, "--dry-run", *choice).stderr
