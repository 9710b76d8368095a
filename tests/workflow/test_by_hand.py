"""Programs run by hand: each refuses a mistake with one plain line."""

import json
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT, SCRIPTS

from lightfield.core.errors import UserError
from lightfield.core.files import Stamp, absolute_path, read_json, write_json, write_text
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.report import tables


@pytest.fixture
def refused(monkeypatch, capsys):
    """Return a function that runs a program that must refuse its arguments, and its message."""

    def run(name, *arguments, folder=ROOT):
        monkeypatch.chdir(folder)
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            runpy.run_path(str(SCRIPTS / name), run_name="__main__")
        # argparse writes its own messages below the usage.
        said = str(caught.value) if caught.value.code != 2 else capsys.readouterr().err
        assert caught.value.code == 2 or "\n" not in said
        return said.partition("error: ")[2].strip()

    return run


@pytest.fixture
def run_in_process(monkeypatch):
    """Return a function that runs a program that must succeed."""

    def run(name, *arguments):
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        runpy.run_path(str(SCRIPTS / name), run_name="__main__")

    return run


RIG = {
    "type": "plane",
    "cameras": [1, 1],
    "size": 1,
    "camera": {"lens": "equidistant", "fov": 180, "resolution": [8, 8]},
}
COSTS = ["--dataset", ".", "--receipts", ".", "--benchmarks", ".", "--scene-benchmarks", "."]
FULL = {"views": 6, "resolution": [64, 64], "samples": "file"}
VIEWS = ["--scene", "smoke", "--calibration"]
SUMS = ["--page", "page", "--output", "sums", "--validation"]


@pytest.mark.parametrize("content", [[1, 2], 5, {}, {"frames": []}, None], ids=repr)
@pytest.mark.parametrize(
    ("key", "program", "arguments"),
    [
        ("target_error: is missing; scripts/calibrate.py", "make_lightfield.py", VIEWS),
        ("valid: is missing; scripts/validate.py", "publish_checksums.py", SUMS),
        ("views: is missing; scripts/probe.py", "plan.py", ["--dataset", "scene/rig", "1"]),
    ],
)
def test_json_of_another_kind_is_named_with_the_missing_key(
    refused, tmp_path, content, key, program, arguments
):
    path, made = tmp_path / "other.json", tmp_path / "made"
    write_json(path, content)
    assert refused(program, *arguments, path, "--output", made) == f"{path}: {key} writes it"
    assert list(tmp_path.iterdir()) == [path]


def test_a_blend_whose_inventory_is_another_file_is_refused(tmp_path, refused):
    scene = {"scene": {"blend": "a.blend"}, "render": {"samples": 1}}
    camera = {"lens": "equidistant", "fov": 180, "resolution": [8, 8]}
    scene["rigs"] = {"Rig": {"type": "plane", "cameras": [1, 1], "size": 1, "camera": camera}}
    write_json(tmp_path / "configs/scenes/mine.yaml", scene)
    write_text(tmp_path / "other.json", "[]")
    arguments = ["--scene", "mine", "--output", "made"]
    said = refused("make_lightfield.py", *arguments, folder=tmp_path)
    assert said == "--inventory: is missing; scripts/inventory.py writes it for a .blend"
    said = refused("make_lightfield.py", *arguments, "--inventory", "other.json", folder=tmp_path)
    assert said == "other.json: blend: is missing; scripts/inventory.py writes it"


@pytest.mark.parametrize("program", ["plan.py", "status.py"])
def test_an_invalid_count_is_refused(refused, tmp_path, program):
    last = tmp_path / "probe.json" if program == "plan.py" else ""
    write_json(tmp_path / "probe.json", {})
    folders = ["--results", tmp_path, "--work", tmp_path] if program == "status.py" else []
    output = ["--output", tmp_path / "made"] if program == "plan.py" else []
    for count in ("many", "0"):
        said = refused(program, "--dataset", "scene/rig", count, last, *folders, *output)
        assert said.startswith("--dataset: is ")


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ({"energy": []}, "settings.json: energy: is []; must be a mapping"),
        ({}, "other.json: blend: is missing; scripts/inventory.py writes it"),
    ],
)
def test_energy_settings_and_full_size_are_checked(refused, tmp_path, content, problem):
    write_json(tmp_path / "settings.json", {"energy": {}, "full": FULL, **content})
    write_json(tmp_path / "other.json", {})
    arguments = ["--settings", tmp_path / "settings.json", "--inventory", tmp_path / "other.json"]
    said = refused("costs.py", *COSTS, *arguments, "--output", tmp_path / "made")
    assert said.startswith(f"{tmp_path}/{problem}")
    assert not (tmp_path / "made").exists()


PAGE = ["--dataset", ".", "--name", "a/b", "--output", "made.html"]
FRAMES = ["--rig", ".", *PAGE[2:]]
CAPTURE = {"scene": "a", "source": {"builder": "room"}, "render": {}, "rig": RIG}
PACK = ["--folder", ".", "--output", "../made.tar"]
PUBLISH = ["--folder", ".", "--output", "../made"]
GPU = ["--blend", "a", "--inventory", "b", "--lightfield", "c", "--cache", "d", "--output", "e"]


@pytest.mark.parametrize(
    ("program", "arguments", "content", "problem"),
    [
        ("report_figures.py", PAGE[:2] + PAGE[-2:], {"rig": 1}, "rig: is 1; must be a mapping"),
        ("make_lightfield.py", PAGE[-2:], CAPTURE | {"rig": {"type": "x"}}, "rig.type: is"),
        ("make_lightfield.py", PAGE[-2:], CAPTURE | {"source": {"frame": 1}}, "source: must"),
        ("report_html.py", PAGE, {"rig": RIG, "yaml": ""}, "is missing the key command"),
        ("report_sequence.py", FRAMES, {"rig": RIG, "frames": []}, "frames: is []; must"),
        ("package.py", PACK, {"gigabytes": 0}, "gigabytes: is 0; must be a number above 0"),
        ("package.py", PACK, {"scene": {"licence": 1}}, "scene.licence: is 1; must be a text"),
        ("publish.py", PUBLISH, {"scene": {"publish": {}}}, "scene.publish.licence: is missing"),
        ("validate.py", ["."], {"inputs": {}}, "inputs: is {}; must be a list"),
        (
            "validate_sequence.py",
            ["."],
            {"frames": "f00001"},
            'frames: is "f00001"; must be a list',
        ),
        ("synthesis_quality.py", PAGE[1:2] + PAGE[-2:], {"views": 0}, "views: is 0; must be"),
        ("gpu_check.py", GPU, {"full": {"a": {"views": 1}}}, "full.a: is missing the key"),
    ],
)
def test_a_mistake_in_a_settings_file_is_named(
    refused, tmp_path, program, arguments, content, problem
):
    path = tmp_path / "settings.json"
    write_json(path, content)
    said = refused(program, *arguments, "--settings", path, folder=tmp_path)
    assert said.startswith(f"{path}: {problem}")
    assert [*tmp_path.iterdir()] == [path]


@pytest.mark.parametrize(
    ("program", "arguments", "flag"),
    [
        ("make_lightfield.py", PAGE[-2:], ["--rig", "LFSphere"]),
        ("package.py", PACK, ["--gigabytes", "1"]),
        ("publish.py", PUBLISH, ["--gigabytes", "1"]),
        ("validate.py", ["."], ["--reprojection", "a"]),
        ("validate_sequence.py", ["."], ["--exports", "a"]),
        ("synthesis_quality.py", [".", "--output", "a"], ["--truth", "b"]),
    ],
)
def test_a_flag_beside_a_settings_file_is_refused(refused, tmp_path, program, arguments, flag):
    path = tmp_path / "settings.json"
    write_json(path, {})
    said = refused(program, *arguments, *flag, "--settings", path, folder=tmp_path)
    assert said == f"--settings: excludes {flag[0]}; write it into the file"


@pytest.fixture
def lightfield(tmp_path):
    """A lightfield.json of one perspective view without its image."""
    lens = {"lens": "rectilinear", "fov": 90, "resolution": [8, 8]}
    rig = {"type": "plane", "cameras": [1, 1], "size": 1, "camera": lens}
    path = tmp_path / "lightfield.json"
    LightField.from_rig(rig, lenses.from_camera(lens)).write(path)
    return path


def test_numbers_are_read_however_they_are_written(run_in_process, lightfield, tmp_path):
    placed = ["--scale", "1e-05", "--offset", "-1e-05", "-2.5", "3E-7"]
    box = ["--render-aabb", "-1e-05", "-.5", "0", "1", "+1e2", "1"]
    made = tmp_path / "transforms.json"
    arguments = ["--input-cfg", lightfield, *placed, *box, "--output", made]
    run_in_process("export_instant_ngp.py", *arguments)
    options = read_json(made)["options"]
    assert (options["scale"], options["offset"]) == (1e-05, [-1e-05, -2.5, 3e-7])
    assert options["render_aabb"] == [[-1e-05, -0.5, 0], [1, 100, 1]]
    arguments = ["--input-cfg", lightfield, "-i", tmp_path, "-o", tmp_path, "--png", "--dry-run"]
    arguments += ["--no-reproject", "--output-cfg", made]
    run_in_process("reproject.py", *arguments, "--rotation", "-1e-05,2,-3", "--exposure", "-1e-05")
    done = read_json(made)["reprojection"]
    assert (done["rotation"], done["exposure"]) == ([-1e-05, 2, -3], -1e-05)


# The flags without which a stage does not look at the others.
REQUIRED = {
    "export_instant_ngp.py": ["--input-cfg", "a", "--output", "b"],
    "evaluate.py": [".", "--dataset", "a", "--output", "b"],
    "reproject.py": ["--output-dir", "a"],
    "package.py": [*PACK, "--scene", "smoke"],
    "publish.py": [*PUBLISH, "--scene", "smoke"],
}


@pytest.mark.parametrize(
    ("program", "flag", "values"),
    [
        ("evaluate.py", "--reinhard", ["0", "-1", "-1e-05", "1e-30", "nan", "inf", "1e400"]),
        ("evaluate.py", "--exposure", ["101", "-1e+03", "nan", "inf", "-1e400"]),
        ("reproject.py", "--reinhard", ["0", "nan", "1e400"]),
        ("reproject.py", "--scale", ["0", "-1e-05", "nan", "inf"]),
        ("reproject.py", "--depth-png", ["0", "-1e-05", "nan", "inf"]),
        ("export_instant_ngp.py", "--scale", ["0", "-1e-05", "nan", "inf"]),
        ("package.py", "--gigabytes", ["0", "-1e-05", "nan", "inf"]),
        ("publish.py", "--gigabytes", ["0", "-1e-05", "nan", "inf"]),
    ],
)
def test_a_number_that_would_spoil_everything_is_refused(refused, program, flag, values):
    for value in values:
        said = refused(program, *REQUIRED.get(program, ()), flag, value)
        assert said.removeprefix("argument ").startswith(f"{flag}: is ")
        assert "; must be " in said


def test_no_program_overwrites_its_input(refused, lightfield, tmp_path):
    views = tmp_path / "exr"
    write_text(views / "view_0000f.exr", "rendered in an hour")
    write_text(views / "view_0000f.png", "rendered in an hour")
    folder = ["--input-cfg", lightfield]
    (tmp_path / "link").symlink_to(views)
    lens = ["--rectilinear", "18,36"]
    link = tmp_path / "link"
    exr_views = ["-i", views, "--filter-suffix", "exr"]
    exr = [
        *folder,
        "--image-dir",
        views,
        "--image-suffix",
        ".exr",
        "--output",
        tmp_path / "t.json",
    ]
    png = [*folder, "--image-dir", views, "--output", tmp_path / "t.json"]
    for said in (
        refused("synthesize.py", tmp_path, "--output", views / ".."),
        refused("synthesize.py", views, "--poses", lightfield, "--output", tmp_path),
        refused("reproject.py", *exr_views, *folder, *lens, "-o", link, "--exr"),
        refused(
            "reproject.py",
            "--single",
            views / "view_0000f.png",
            *folder,
            *lens,
            "-o",
            tmp_path / "link",
            "--png",
        ),
        refused(
            "reproject.py",
            "-i",
            views,
            *folder,
            *lens,
            "-o",
            tmp_path / "made",
            "--png",
            "--filter-suffix",
            "png",
            "--output-cfg",
            lightfield,
        ),
        refused("export_instant_ngp.py", *exr, "--exr-dir", tmp_path / "link"),
        refused("export_instant_ngp.py", *png, "--depth-dir", tmp_path / "link"),
        refused("export_instant_ngp.py", *folder, "--output", lightfield),
    ):
        assert "is an input" in said or "replace the input" in said, said
    assert {path.read_text() for path in views.iterdir()} == {"rendered in an hour"}
    assert LightField.read(lightfield).views
    assert not (tmp_path / "made").exists()


def test_an_invalid_rig_is_named_by_its_file(refused, lightfield, tmp_path):
    write_text(tmp_path / "rig.yaml", "scenes: [garden]")
    arguments = ["--poses", tmp_path / "rig.yaml", "--output", tmp_path / "made"]
    said = refused("synthesize.py", lightfield.parent, *arguments)
    assert said == f"{tmp_path}/rig.yaml: is missing the key type"


def test_splits_are_listed_for_any_path_to_a_dataset(
    run_in_process, refused, lightfield, tmp_path, monkeypatch
):
    rig = tmp_path / "Rig"
    rig.mkdir()
    lightfield.rename(rig / "lightfield.json")
    content = read_json(rig / "lightfield.json")
    content["frames"][0]["split"] = "test"
    write_json(rig / "lightfield.json", content)
    output, read = tmp_path / "splits.json", rig / "lightfield.json"
    for folder, arguments in (
        (rig, ["lightfield.json", "--output", "../splits.json"]),
        (rig, ["../Rig/./lightfield.json", "--output", output]),
        (tmp_path, [read, "--output", "splits.json"]),
        (tmp_path, ["Rig/lightfield.json", "--output", "./splits.json"]),
    ):
        monkeypatch.chdir(folder)
        run_in_process("splits.py", *arguments)
        assert read_json(output)["test"] == ["Rig/view_0000f"]
        output.unlink()
    said = refused("splits.py", read, "--output", rig / "x/splits.json")
    assert said == f"{read}: must be in {rig}/x, where --output is"


def test_the_index_leaves_out_a_dataset_that_cannot_be_read(
    run_in_process, lightfield, tmp_path, capsys
):
    kept, lost = tmp_path / "results/a/Kept", tmp_path / "results/b/Lost"
    for folder in (kept, lost):
        write_text(folder / "report/index.html", "<p>")
    lightfield.rename(kept / "lightfield.json")
    arguments = ["--results", tmp_path / "results", "--output", tmp_path / "results/index.html"]
    run_in_process("report_index.py", *arguments)
    text = (tmp_path / "results/index.html").read_text()
    assert "a/Kept/report/index.html" in text
    assert "Lost" not in text
    said = capsys.readouterr().err
    assert said.startswith(f"warning: left out: {lost}/lightfield.json: cannot be read")


@pytest.mark.parametrize("within", [True, False])
def test_views_are_compared_with_their_receipt_for_any_path(refused, lightfield, tmp_path, within):
    view = tmp_path / "dataset/exr/view_0000f.exr"
    place = view.parent if within else tmp_path
    images.write_exr(view, dict.fromkeys("RGB", np.ones((8, 8), np.float16)))
    header = {"job": "s/r/render/0-1", "stage": "render_shard", "version": None}
    header |= {"settings": {}, "inputs": {}}
    stamp = Stamp.of(view)._replace(sha256="0" * 64)
    line = {"file": str(view.relative_to(place)), **stamp._asdict(), "key": "0"}
    receipts = tmp_path / "work/receipts/s/r"
    receipt = receipts / "render/0-1.jsonl"
    write_text(receipt, "".join(json.dumps(each) + "\n" for each in (header, line)))
    arguments = ["--input-cfg", lightfield, "--source-receipt", receipt, "--exr"]
    arguments += ["--receipt", receipts / "perspective/0-1.jsonl"]
    arguments += ["--rectilinear", "18,36", "-o", tmp_path / "made"]
    said = refused("reproject.py", "-i", view.parent, *arguments, folder=place)
    assert "view_0000f.exr: is not as its job made it" in said


def test_a_receipt_of_another_kind_is_named(refused, lightfield, tmp_path):
    path = tmp_path / "work/receipts/s/r/render/0-1.jsonl"
    write_json(path, [])
    arguments = ["-i", tmp_path, "--input-cfg", lightfield, "--source-receipt", path]
    arguments += ["--receipt", path.with_name("0-2.jsonl")]
    said = refused("reproject.py", *arguments, "--no-reproject", "--exr", "-o", tmp_path / "made")
    assert said == f"{path}: is missing or damaged; the next run makes it again"


def test_the_current_folder_has_its_own_name(tmp_path, monkeypatch):
    (tmp_path / "scene/rig/exr").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "scene/rig/exr")
    for path in (Path(".."), Path("../../rig/"), Path("../exr/.."), tmp_path / "scene/rig"):
        assert absolute_path(path).parts[-2:] == ("scene", "rig")


def test_an_image_is_refused_as_text(refused, tmp_path):
    other = tmp_path / "view.exr"
    other.write_bytes(bytes([0x76, 0x2F, 0x31, 0x01, 0x80]))
    said = refused("splits.py", other, "--output", tmp_path / "splits.json")
    assert said == f"{other}: is not text in UTF-8"


@pytest.mark.parametrize(
    ("name", "read", "column"),
    [
        ("reprojection.csv", tables.reprojection, "scenario"),
        ("stability.csv", tables.stability, "group"),
        ("synthesis/a/b.csv", lambda files: tables.synthesis(files, "a/b"), "truth"),
    ],
)
def test_a_table_of_another_kind_is_named(tmp_path, name, read, column):
    path = tmp_path / name
    for text, why in (("", "has no row"), ("x,y\n1,2\n", f"{column}: is missing")):
        write_text(path, text or "\n")
        with pytest.raises(UserError, match=rf"{path}: {why}"):
            read([path])


def test_slopes_that_are_not_numbers_are_named(tmp_path):
    path = tmp_path / "error_vs_time/scene.json"
    write_json(path, {"slopes": {"plain": {"over_time": {"slope": "steep"}}}})
    with pytest.raises(UserError, match=r"scene.json: slopes: is not what"):
        tables.error_vs_time([path], "scene")


@pytest.mark.parametrize("content", [[], {"extrapolation": 5}])
def test_costs_of_another_kind_are_named(tmp_path, content):
    write_json(tmp_path / "costs.json", content)
    with pytest.raises(UserError, match=r"costs.json: is not what scripts/costs.py writes"):
        tables.costs(tmp_path / "costs.json")


def test_an_index_of_a_missing_folder_is_refused(refused, tmp_path):
    arguments = ["--results", tmp_path / "none", "--output", tmp_path / "index.html"]
    assert refused("report_index.py", *arguments) == f"{tmp_path}/none: no such folder"
    assert not [*tmp_path.iterdir()]


def test_a_lens_from_a_missing_blend_is_refused(refused, lightfield, tmp_path):
    camera = '{"lens": "file", "resolution": [8, 8]}'
    write_text(tmp_path / "flat.json", f'{{"camera": {camera}, "formats": ["exr"]}}')
    arguments = ["-i", tmp_path, "--input-cfg", lightfield, "-o", tmp_path / "made"]
    said = refused("reproject.py", *arguments, "--settings", tmp_path / "flat.json")
    assert said == f"{tmp_path}/flat.json: camera.lens: file is only for a rig of type blend_camera"
    rig = '{"type": "plane", "cameras": [1, 1], "size": 1, "camera": ' + camera + "}"
    write_text(tmp_path / "rig.yaml", rig)
    arguments = [tmp_path, "--poses", tmp_path / "rig.yaml", "--output", tmp_path / "made"]
    assert "lens: is file" in refused("synthesize.py", *arguments)


def test_a_report_of_another_rig_is_refused(refused, lightfield, tmp_path):
    rig = RIG | {"cameras": [5, 5]}
    figures, page = (tmp_path / name for name in ("figures.json", "page.json"))
    write_json(figures, {"rig": rig})
    write_json(page, {"rig": rig, "yaml": "scene: {}", "command": "c"})
    arguments = ["--dataset", tmp_path, "--output", tmp_path / "made", "--settings"]
    why = f"{lightfield}: frames: are 1, but its rig has 25"
    assert refused("report_figures.py", *arguments, figures) == why
    assert refused("report_html.py", *arguments, page, "--name", "a/b") == why
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize(
    ("output", "why"),
    [("../rig.json", "must end in .tar; .json lies beside it"), ("./rig.tar", "must not be in")],
)
def test_a_package_must_be_an_archive_outside_itself(refused, lightfield, tmp_path, output, why):
    rig = tmp_path / "rig"
    rig.mkdir()
    lightfield.rename(rig / "lightfield.json")
    arguments = ["--scene", "smoke", "--folder", rig, "--output", rig / output]
    assert why in refused("package.py", *arguments)
    assert [path.name for path in tmp_path.rglob("*.*")] == ["lightfield.json"]
