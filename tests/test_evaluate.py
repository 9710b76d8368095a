"""Renders beside the truth: errors that are known beforehand, and none of the truth itself."""

import csv
import math
import shutil

import numpy as np
import pytest
from sphere import write_views

from lightfield.core.errors import UserError
from lightfield.dataset.lightfield import LightField
from lightfield.export.source import Source
from lightfield.geometry.depth import z_from_distance
from lightfield.imaging import images
from lightfield.measurement import evaluation

RIG = {"type": "plane", "cameras": [2, 2], "size": 0.4, "split": "odd"}
LENSES = {
    "perspective": {"lens": "rectilinear", "fov": 70, "resolution": [64, 48]},
    "fisheye": {"lens": "equidistant", "fov": 180, "resolution": [48, 48]},
}
TESTS = ("view_0001f", "view_0003f")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder = tmp_path_factory.mktemp("evaluate") / "dataset"
    for name, camera in LENSES.items():
        write_views(folder / name, camera, RIG)
        for view in LightField.read(folder / name / "lightfield.json").views:
            size = camera["resolution"][::-1]
            up = {channel: np.full(size, channel == "B", np.float32) for channel in "RGB"}
            images.write_exr(folder / name / "normal" / f"{view.name}.exr", up)
    return folder


def rows_of(dataset, name, shown, mask=True, view="view_0001f"):
    """Return the errors of a render by region."""
    source = Source(dataset, name, ".exr")
    found = next(each for each in source.lightfield.views if each.name == view)
    rendered = evaluation.rendered(shown, source)
    true = evaluation.truth(source, found, shown)
    counted = np.broadcast_to(mask, rendered.colour.shape[:2])
    parts = evaluation.regions(source, found, counted, true.depth)
    return dict(evaluation.errors(rendered, true, parts))


@pytest.mark.parametrize("name", LENSES)
def test_the_truth_scores_perfectly(dataset, tmp_path, name, run_program):
    renders = tmp_path / "renders"
    shutil.copytree(dataset / name, renders)
    source = Source(dataset, name, ".exr")
    second = next(view for view in source.lightfield.views if view.name == TESTS[1])
    (renders / f"{second.name}.exr").unlink()
    images.write_png(renders / f"{second.name}.png", source.colour(second))
    words = [renders, "--dataset", dataset, "--source", name, "--output", tmp_path / "page"]
    result = run_program("evaluate.py", *words)
    assert "LPIPS is left out" in result.stdout
    with (tmp_path / "page" / "evaluation.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["view"] for row in rows} == {*TESTS, "mean"}
    # The wall of a ball has no edges.
    assert {row["region"] for row in rows} == {"all", "centre", "rim"}
    for row in rows:
        assert (row["psnr"], row["ssim"], row["flip"], row["normal"]) == (
            "inf",
            "1.0",
            "0.0",
            "0.0",
        )
        assert row["depth"] == ("" if row["view"] == second.name else "0.0")
    html = (tmp_path / "page" / "index.html").read_text()
    assert all(name in html for name in TESTS)
    assert html.count("data:image/webp") == 2
    assert "train" not in html


def named(dataset, tmp_path, folder):
    """Return the source of a copy of the perspective views in a folder of that name."""
    shutil.copytree(dataset / "perspective", tmp_path / folder / "perspective")
    path = tmp_path / folder / "perspective" / "lightfield.json"
    LightField.read(path).changed(scene={"name": "ball"}).write(path)
    return Source(tmp_path / folder, "perspective", ".exr")


@pytest.mark.parametrize(
    ("folder", "prefix"),
    [
        ("spiral", "spiral_"),
        ("spiral/f00002", "spiral_"),
        ("ball_spiral", "spiral_"),
        ("ball_preview_low_spiral", "low_spiral_"),
    ],
)
def test_a_render_is_found_by_the_name_that_exports_give_it(dataset, tmp_path, folder, prefix):
    source = named(dataset, tmp_path, folder)
    view = source.lightfield.views[1]
    # The name of each rig's view in a folder of several rigs' views.
    for name in (view.name, f"high_{view.name}", f"{prefix}{view.name}"):
        images.write_png(tmp_path / f"{name}.png", np.zeros((48, 64, 3), np.uint8))
        found = evaluation.find(tmp_path, source, view)
        assert found.name == f"{prefix if name.startswith(prefix) else ''}{view.name}.png"


def test_renders_and_masks_under_exported_names_are_compared(dataset, tmp_path, run_program):
    source = named(dataset, tmp_path, "spiral")
    for view in source.lightfield.views:
        if view.name in TESTS:
            name = f"spiral_{view.name}.png"
            images.write_png(tmp_path / "renders" / name, source.colour(view))
            images.write_png(tmp_path / "masks" / name, np.eye(48, 64, dtype=np.uint8))
    words = [
        "--source",
        "perspective",
        "--masks",
        tmp_path / "masks",
        "--output",
        tmp_path / "page",
    ]
    run_program("evaluate.py", tmp_path / "renders", "--dataset", source.dataset, *words)
    with (tmp_path / "page" / "evaluation.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["region"] == "all"]
    assert [row["view"] for row in rows] == [*TESTS, "mean"]
    assert {(row["psnr"], float(row["pixels"])) for row in rows} == {("inf", 48)}


def test_errors_are_those_that_were_made(dataset, tmp_path):
    path = dataset / "perspective" / "view_0001f.exr"
    image = images.read_image(path)
    source = Source(dataset, "perspective", ".exr")
    view = source.lightfield.views[1]
    pixels = source.colour(view)
    pixels[:, :32] += 10
    shown = tmp_path / "view_0001f.png"
    images.write_png(shown, pixels)
    left = np.zeros((48, 64), bool)
    left[:, :32] = True
    expected = -20 * math.log10(10 / 255)
    assert rows_of(dataset, "perspective", shown, left)["all"]["psnr"] == pytest.approx(expected)
    assert rows_of(dataset, "perspective", shown, ~left)["all"]["psnr"] == math.inf
    both = rows_of(dataset, "perspective", shown)["all"]
    assert both["psnr"] == pytest.approx(expected + 10 * math.log10(2))
    assert both["ssim"] < 1
    assert both["flip"] > 0
    assert both["pixels"] == 48 * 64
    deeper = image.channels | {"Z": image.channels["Z"] * np.float32(1.25)}
    # Unknown depth is as wrong as can be.
    deeper["Z"][:, 16:32] = np.nan
    images.write_exr(tmp_path / "view_0001f.exr", deeper)
    turned = {"R": np.full((48, 64), 1, np.float32), "B": np.full((48, 64), 1, np.float32)}
    turned["G"] = np.zeros((48, 64), np.float32)
    images.write_exr(tmp_path / "normal" / "view_0001f.exr", turned)
    found = rows_of(dataset, "perspective", tmp_path / "view_0001f.exr")["all"]
    assert found["psnr"] == math.inf
    assert found["depth"] == pytest.approx(0.75 * 0.25 + 0.25, abs=1e-6)
    assert found["normal"] == pytest.approx(45)


def test_regions_are_where_the_lens_sees_and_where_depth_jumps(dataset):
    source = Source(dataset, "fisheye", ".exr")
    distance = np.ones((48, 48))
    distance[:, 24:], distance[:10] = 2, np.inf
    depth = z_from_distance(distance, source.lens.pixel_rays())
    whole = np.ones((48, 48), bool)
    parts = evaluation.regions(source, source.lightfield.views[1], whole, depth)
    assert parts["all"].sum() == pytest.approx(math.pi * 24**2, rel=0.02)
    assert parts["centre"].sum() == pytest.approx(math.pi * 12**2, rel=0.02)
    assert (parts["centre"] ^ parts["rim"] == parts["all"]).all()
    assert np.flatnonzero(parts["edges"][30]).tolist() == [22, 23, 24, 25]
    assert np.flatnonzero(parts["background"][:, 24]).tolist() == list(range(10))


def test_what_is_missing_or_of_another_size_is_named(dataset, tmp_path, run_program):
    words = ["--dataset", dataset, "--source", "perspective", "--output", tmp_path / "page"]
    result = run_program("evaluate.py", tmp_path, *words, check=False)
    assert result.returncode == 1
    assert "has no view_0001f.exr or .png, nor dataset_view_0001f.exr or .png" in result.stderr
    renders = tmp_path / "renders"
    for number, view in enumerate(TESTS):
        light = {name: np.full((48, 64), 0.5, np.float32) for name in "RGB"}
        light["G"][3, 3] = np.nan if number else 0.5
        images.write_exr(renders / f"{view}.exr", light)
    result = run_program("evaluate.py", renders, *words, check=False)
    problem = f"{TESTS[1]}.exr: has colour that is no number where it is compared"
    assert (result.returncode, result.stderr.splitlines()[-1].endswith(problem)) == (1, True)
    assert [path.name for path in tmp_path.iterdir()] == ["renders"]
    source = Source(dataset, "perspective", ".exr")
    images.write_png(tmp_path / "small.png", np.zeros((4, 6, 3), np.uint8))
    images.write_png(tmp_path / "grey.png", np.zeros((48, 64), np.uint8))
    images.write_exr(tmp_path / "grey.exr", {"Z": np.ones((48, 64), np.float32)})
    for name, problem in (
        ("small.png", r"is 6 × 4, but .*lightfield\.json says 64 × 48"),
        ("grey.png", "has the channels Y; must have RGB"),
        ("grey.exr", "has the channels Z; must have RGB"),
    ):
        with pytest.raises(UserError, match=problem):
            evaluation.rendered(tmp_path / name, source)
    mask = tmp_path / "view_0001f.png"
    for pixels, problem in (
        (np.ones((48, 64, 3), np.uint8), "has no channel Y; it has R, G, B"),
        (np.ones((4, 6), np.uint8), r"is 6 × 4, but .*lightfield\.json says 64 × 48"),
    ):
        images.write_png(mask, pixels)
        with pytest.raises(UserError, match=problem):
            evaluation.mask(mask, source)
    images.write_png(mask, np.eye(48, 64, dtype=np.uint8))
    assert evaluation.mask(mask, source).sum() == 48
