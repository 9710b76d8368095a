"""Programs as a person runs them by hand: what is not meant is refused in one plain line."""

import runpy
import sys

import pytest
from conftest import ROOT, SCRIPTS

from lightfield.core.files import write_json, write_text


@pytest.fixture
def refused(monkeypatch, tmp_path):
    """Run a program that must refuse its arguments; return the line that says why."""

    def run(name, *arguments, folder=ROOT):
        monkeypatch.chdir(folder)
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            runpy.run_path(str(SCRIPTS / name), run_name="__main__")
        said = str(caught.value)
        assert said.startswith("error: ")
        assert "\n" not in said
        return said.removeprefix("error: ")

    return run


ENERGY = '{"watts": 65, "price_per_kwh": 0.3, "currency": "EUR", "cores": 2}'
FULL = '{"views": 6, "resolution": [64, 64], "samples": "file"}'
COSTS = ["--dataset", ".", "--journals", ".", "--benchmarks", ".", "--scene-benchmarks", "."]
COSTS += ["--energy", ENERGY, "--full", FULL, "--inventory"]
VIEWS = ["--scene", "smoke", "--calibration"]
SUMS = ["--page", "page", "--sums", "sums", "--validation"]


@pytest.mark.parametrize("content", [[1, 2], 5, {}, {"frames": []}, None], ids=repr)
@pytest.mark.parametrize(
    ("key", "program", "arguments"),
    [
        ("target_error: is missing; scripts/calibrate.py", "make_lightfield.py", VIEWS),
        ("valid: is missing; scripts/validate.py", "publish_checksums.py", SUMS),
        ("views: is missing; scripts/probe.py", "plan.py", ["--dataset", "scene/rig", "1"]),
        ("blend: is missing; scripts/inventory.py", "costs.py", COSTS),
        ("device: is missing; scripts/try_changes.py", "advise.py", []),
    ],
)
def test_json_of_another_kind_is_named_with_the_key_that_it_lacks(
    refused, tmp_path, content, key, program, arguments
):
    path, made = tmp_path / "other.json", tmp_path / "made"
    write_json(path, content)
    output = [] if program == "advise.py" else ["--output", made]
    assert refused(program, *arguments, path, *output) == f"{path}: {key} writes it"
    assert list(tmp_path.iterdir()) == [path]


def test_a_blend_whose_inventory_is_another_file_is_refused(tmp_path, refused):
    scene = {"scene": {"blend": "a.blend"}, "render": {"samples": 1}}
    camera = {"lens": "equidistant", "fov": 180, "resolution": [8, 8]}
    scene["rigs"] = {"Rig": {"type": "plane", "cameras": [1, 1], "size": 1, "camera": camera}}
    write_json(tmp_path / "configs/scenes/mine.yaml", scene)
    write_text(tmp_path / "other.json", "[]")
    words = ["--scene", "mine", "--inventory", "other.json", "--output", "made"]
    said = refused("make_lightfield.py", *words, folder=tmp_path)
    assert said == "other.json: blend: is missing; scripts/inventory.py writes it"


@pytest.mark.parametrize("program", ["plan.py", "status.py"])
def test_a_count_that_is_none_is_refused(refused, tmp_path, program):
    last = tmp_path / "probe.json" if program == "plan.py" else ""
    write_json(tmp_path / "probe.json", {})
    folders = ["--results", tmp_path, "--work", tmp_path] if program == "status.py" else []
    output = ["--output", tmp_path / "made"] if program == "plan.py" else []
    said = refused(program, "--dataset", "scene/rig", "many", last, *folders, *output)
    assert said == "--dataset: is many; must be 1 or more"


def test_what_a_machine_draws_and_the_full_size_are_checked(refused, tmp_path):
    words = ["--output", tmp_path / "made"]
    for name, content in (("--energy", "[]"), ("--full", "{}"), ("--full", '{"views": 1e400}')):
        given = [*COSTS[:-1], name, content]
        assert refused("costs.py", *given, *words).startswith(f"{name}: ")
