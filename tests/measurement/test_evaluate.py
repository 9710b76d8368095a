"""Renders compared with the truth: errors that are known beforehand, and none for the truth."""

import csv
import math
import shutil

import accessibility
import exr_windows
import numpy as np
import pytest
from sphere import write_views

from lightfield.core.errors import UserError
from lightfield.export.source import SourceDataset
from lightfield.formats.lightfield import LightField
from lightfield.geometry.depth import z_from_distance
from lightfield.imaging import images
from lightfield.imaging.tonemap import to_16_bit
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


BLACK, WHITE = np.zeros(3), np.ones(3)


def rows_of(dataset, name, shown, mask=True, view="view_0001f"):
    """Return the errors of a render by region."""
    source = SourceDataset(dataset, name, ".exr")
    chosen_view = next(each for each in source.lightfield.views if each.name == view)
    render = evaluation.rendered(shown, source, BLACK)
    rendered = render.pictures
    true = evaluation.truth(source, chosen_view, render.largest, BLACK)
    counted = np.broadcast_to(mask, rendered.colour.shape[:2])
    parts = evaluation.regions(source, chosen_view, counted, true.depth)
    return dict(evaluation.errors(rendered, true, parts, source.lens))


@pytest.mark.parametrize("name", LENSES)
def test_a_render_is_compared_as_viewers_show_it(dataset, tmp_path, name):
    """An EXR may store more than it shows, or less. What it does not store is black and a miss."""
    for folder in ("whole", "wide", "cropped", "black"):
        shutil.copytree(dataset / name, tmp_path / folder)
    view = f"{TESTS[0]}.exr"
    rows, columns = np.s_[5:40], np.s_[9:30]
    for path in (tmp_path / "wide" / view, tmp_path / "wide" / "normal" / view):
        exr_windows.widen(path)
    exr_windows.crop(tmp_path / "cropped" / view, rows, columns)
    stored = images.read_image(dataset / name / view)
    black = {}
    for channel, plane in stored.channels.items():
        black[channel] = np.full_like(plane, np.inf if channel == "Z" else 0)
        black[channel][rows, columns] = plane[rows, columns]
    images.write_exr(tmp_path / "black" / view, black, stored.attributes)
    errors = {
        folder: rows_of(dataset, name, tmp_path / folder / view)
        for folder in ("whole", "wide", "cropped", "black")
    }
    assert errors["wide"] == errors["whole"]
    assert errors["cropped"] == errors["black"]
    assert errors["cropped"]["all"]["psnr"] < 20


@pytest.mark.parametrize("name", LENSES)
def test_the_truth_has_no_error(dataset, tmp_path, name, run_program):
    renders = tmp_path / "renders"
    shutil.copytree(dataset / name, renders)
    source = SourceDataset(dataset, name, ".exr")
    second = next(view for view in source.lightfield.views if view.name == TESTS[1])
    (renders / f"{second.name}.exr").unlink()
    images.write_png(renders / f"{second.name}.png", source.colour(second))
    arguments = [renders, "--dataset", dataset, "--source", name, "--output", tmp_path / "page"]
    result = run_program("evaluate.py", *arguments)
    assert "no LPIPS" in result.stdout
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
        assert float(row["ws_psnr"]) == pytest.approx(100)
        assert row["iv_psnr"] == ("100.0" if row["region"] == "all" else "")
    html = (tmp_path / "page" / "index.html").read_text()
    assert all(name in html for name in TESTS)
    assert html.count("data:image/webp") == 2
    assert "train" not in html


def named(dataset, tmp_path, folder):
    """Return the source of a copy of the perspective views in a folder with that name."""
    shutil.copytree(dataset / "perspective", tmp_path / folder / "perspective")
    path = tmp_path / folder / "perspective" / "lightfield.json"
    LightField.read(path).changed(scene={"name": "ball"}).write(path)
    return SourceDataset(tmp_path / folder, "perspective", ".exr")


@pytest.mark.parametrize(
    ("folder", "prefix"),
    [
        ("spiral", "spiral_"),
        ("spiral/f00002", "spiral_"),
        ("ball_spiral", "spiral_"),
        ("ball_preview_low_spiral", "low_spiral_"),
    ],
)
def test_a_render_is_found_by_its_name_in_exports(dataset, tmp_path, folder, prefix):
    source = named(dataset, tmp_path, folder)
    view = source.lightfield.views[1]
    # A view's name in a folder with several rigs' views starts with its rig.
    for name in (view.name, f"high_{view.name}", f"{prefix}{view.name}"):
        images.write_png(tmp_path / f"{name}.png", np.zeros((48, 64, 3), np.uint8))
        path_of_render = evaluation.find(tmp_path, source, view)
        assert path_of_render.name == f"{prefix if name.startswith(prefix) else ''}{view.name}.png"


def test_renders_and_masks_under_exported_names_are_compared(dataset, tmp_path, run_program):
    source = named(dataset, tmp_path, "spiral")
    for view in source.lightfield.views:
        if view.name in TESTS:
            name = f"spiral_{view.name}.png"
            images.write_png(tmp_path / "renders" / name, source.colour(view))
            images.write_png(tmp_path / "masks" / name, np.eye(48, 64, dtype=np.uint8))
    arguments = [
        "--source",
        "perspective",
        "--masks",
        tmp_path / "masks",
        "--output",
        tmp_path / "page",
    ]
    run_program("evaluate.py", tmp_path / "renders", "--dataset", source.dataset, *arguments)
    with (tmp_path / "page" / "evaluation.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["region"] == "all"]
    assert [row["view"] for row in rows] == [*TESTS, "mean"]
    assert {(row["psnr"], float(row["pixels"])) for row in rows} == {("inf", 48)}


def test_errors_are_those_of_the_changed_renders(dataset, tmp_path):
    path = dataset / "perspective" / "view_0001f.exr"
    image = images.read_image(path)
    source = SourceDataset(dataset, "perspective", ".exr")
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
    # An unknown depth counts as the largest error.
    deeper["Z"][:, 16:32] = np.nan
    images.write_exr(tmp_path / "view_0001f.exr", deeper)
    turned = {"R": np.full((48, 64), 1, np.float32), "B": np.full((48, 64), 1, np.float32)}
    turned["G"] = np.zeros((48, 64), np.float32)
    images.write_exr(tmp_path / "normal" / "view_0001f.exr", turned)
    row = rows_of(dataset, "perspective", tmp_path / "view_0001f.exr")["all"]
    assert row["psnr"] == math.inf
    assert row["depth"] == pytest.approx(0.75 * 0.25 + 0.25, abs=1e-6)
    assert row["normal"] == pytest.approx(45)


def test_what_a_mask_leaves_out_changes_no_error(dataset, tmp_path):
    """SSIM, FLIP and IV-PSNR look at the pixels around, too."""
    shown = tmp_path / "shown.exr"
    shutil.copy(dataset / f"perspective/{TESTS[0]}.exr", shown)
    mask = np.ones((48, 64), bool)
    mask[:, 40:] = False
    without = rows_of(dataset, "perspective", shown, mask)["all"]
    channels = dict(images.read_image(shown).channels)
    for name in "RGB":
        channels[name] = channels[name].copy()
        channels[name][:, 40:] = 3.0
    images.write_exr(shown, channels, {images.DEPTH_ATTRIBUTE: "z"})
    spoilt = rows_of(dataset, "perspective", shown, mask)["all"]
    assert spoilt == without
    assert (spoilt["psnr"], spoilt["ssim"], spoilt["flip"]) == (math.inf, 1, 0)


@pytest.mark.parametrize("missing", [0, np.nan, np.inf])
def test_missing_normals_count_as_perpendicular(dataset, tmp_path, missing):
    render = tmp_path / "view_0001f.exr"
    shutil.copy(dataset / "perspective" / render.name, render)
    up = {channel: np.full((48, 64), channel == "B", np.float32) for channel in "RGB"}
    for channel in up.values():
        channel[:, :16] = missing
    images.write_exr(tmp_path / "normal" / render.name, up)
    row = rows_of(dataset, "perspective", render)["all"]
    assert row["normal"] == pytest.approx(90 / 4)


def test_normals_of_another_size_are_named(dataset, tmp_path):
    render = tmp_path / "view_0001f.exr"
    shutil.copy(dataset / "perspective" / render.name, render)
    normals = tmp_path / "normal" / render.name
    images.write_exr(normals, dict.fromkeys("RGB", np.ones((24, 64), np.float32)))
    with pytest.raises(UserError, match=rf"{normals}: is 64 × 24, but .* says 64 × 48"):
        rows_of(dataset, "perspective", render)


@pytest.mark.parametrize("suffix", [".exr", ".png"])
def test_the_truth_has_no_error_in_16_bits(dataset, tmp_path, suffix):
    light = images.read_image(dataset / "perspective" / "view_0001f.exr").colour
    pixels = to_16_bit(light)
    shutil.copytree(dataset / "perspective", tmp_path / "copy" / "perspective")
    images.write_png(tmp_path / "copy" / "perspective" / "view_0001f.png", pixels)
    render = tmp_path / "view_0001f.png"
    source = SourceDataset(tmp_path / "copy", "perspective", suffix)
    view = source.lightfield.views[1]
    parts = {"all": np.ones((48, 64), bool)}
    # A step of 16 bits is less than a rounding to 8 bits would hide.
    for step, expected in ((0, math.inf), (1, 20 * math.log10(65535))):
        images.write_png(render, pixels + np.uint16(step))
        shown = evaluation.rendered(render, source, BLACK)
        true = evaluation.truth(source, view, shown.largest, BLACK)
        ((_, errors),) = evaluation.errors(shown.pictures, true, parts, source.lens)
        assert errors["psnr"] == pytest.approx(expected)


@pytest.fixture
def transparent(tmp_path):
    """The source of views of a grey wall. Its alpha falls from 1 at the left to 0."""
    folder = tmp_path / "spiral"
    write_views(folder / "views", LENSES["perspective"], RIG)
    (folder / "views").rename(folder / "exr")
    path = folder / "exr" / "lightfield.json"
    LightField.read(path).changed(render={"transparent": True}).write(folder / "lightfield.json")
    alpha = np.tile(np.clip(np.linspace(1.5, -0.5, 64), 0, 1), (48, 1)).astype(np.float32)
    for view in TESTS:
        channels = dict.fromkeys("RGB", np.float32(0.25) * alpha) | {"A": alpha, "Z": 1 + alpha}
        images.write_exr(folder / "exr" / f"{view}.exr", channels)
    return SourceDataset(folder, "", ".exr")


def compared(source, path, background):
    """Return a render's errors over a background, and the problem with its own background."""
    view = next(view for view in source.lightfield.views if path.stem.endswith(view.name))
    shown = evaluation.rendered(path, source, background)
    true = evaluation.truth(source, view, shown.largest, background)
    parts = {"all": np.ones((48, 64), bool)}
    ((_, errors),) = evaluation.errors(shown.pictures, true, parts, source.lens)
    problem = evaluation.background_problem(shown.pictures, true, parts["all"], background)
    return errors, problem


def on(background, alpha):
    """Return the wall's sRGB colour, 0 to 255, blended with an sRGB background as trainers do."""
    wall = 0.5371  # Light of 0.25, by IEC 61966-2-1.
    alpha = alpha[..., None].astype(np.float64)
    return np.rint(255 * (alpha * wall + (1 - alpha) * background)).astype(np.uint8)


@pytest.mark.parametrize("background", [BLACK, WHITE, np.array([1, 0.5, 0])])
def test_renders_without_alpha_are_compared_over_their_background(
    transparent, tmp_path, background
):
    alpha = images.read_image(transparent.path(transparent.lightfield.views[1])).channels["A"]
    path = tmp_path / "spiral_view_0001f.png"
    images.write_png(path, on(background, alpha))
    errors, problem = compared(transparent, path, background)
    # At most a step of 8 bits.
    assert errors["psnr"] > -20 * math.log10(1 / 255)
    assert problem is None
    errors, problem = compared(transparent, path, np.array([0, 0, 1]))
    assert errors["psnr"] < 10
    code = {0: "#000000", 3: "#ffffff"}.get(background.sum(), "#ff8000")
    assert f"has no alpha, and is {code} where the truth is transparent" in problem


# The light of the grey 0.5 in sRGB, by IEC 61966-2-1.
@pytest.mark.parametrize(("background", "light"), [(0, 0), (0.5, 0.2140411), (1, 1)])
def test_linear_renders_are_composited_as_light(background, light, transparent, tmp_path):
    alpha = images.read_image(transparent.path(transparent.lightfield.views[1])).channels["A"]
    path = tmp_path / "view_0001f.exr"
    colour = np.float32(0.25) * alpha + np.float32(light) * (1 - alpha)
    images.write_exr(path, dict.fromkeys("RGB", colour))
    assert compared(transparent, path, np.full(3, float(background)))[0]["psnr"] > 100


@pytest.mark.parametrize("background", [BLACK, WHITE])
def test_linear_renders_are_composited_as_the_truth_in_png(background, transparent, tmp_path):
    for view in transparent.lightfield.views:
        if view.name in TESTS:
            transparent.write_image(view, transparent.path(view).with_suffix(".png"))
    developed = SourceDataset(transparent.dataset, "", ".png")
    path = tmp_path / "view_0001f.exr"
    shutil.copy(transparent.dataset / "exr" / path.name, path)
    errors, problem = compared(developed, path, background)
    assert problem is None
    # Colour and alpha of 8 bits are rounded, each by up to half a step.
    assert errors["psnr"] > 45


@pytest.mark.parametrize("background", [BLACK, WHITE])
def test_renders_with_alpha_are_composited_over_the_background_too(
    transparent, tmp_path, background
):
    view = transparent.lightfield.views[1]
    for path in (tmp_path / f"{view.name}.png", transparent.path(view)):
        if path.suffix == ".png":
            transparent.write_image(view, path)
        errors, problem = compared(transparent, path, background)
        assert (errors["psnr"], problem) == (math.inf, None)
    pixels = np.dstack([transparent.colour(view), np.full((48, 64), 255, np.uint8)])
    images.write_png(tmp_path / f"{view.name}.png", pixels)
    _, problem = compared(transparent, tmp_path / f"{view.name}.png", background)
    # It differs by more than 0.1 in all but 16 columns, and three at the ramp's upper end.
    assert "has another alpha than the truth in 70% of its pixels" in problem


def test_16_bit_renders_with_alpha_are_composited_as_the_truth(transparent, tmp_path):
    view = transparent.lightfield.views[1]
    alpha = images.read_image(transparent.path(view)).channels["A"].astype(np.float64)
    wall = np.rint(65535 * (1.055 * 0.25 ** (1 / 2.4) - 0.055))
    colour = np.where(alpha[..., None] > 0, np.full(3, wall), 0)
    pixels = np.dstack([colour, np.rint(65535 * alpha)]).astype(np.uint16)
    path = tmp_path / f"{view.name}.png"
    images.write_png(path, pixels)
    errors, problem = compared(transparent, path, WHITE)
    assert problem is None
    # At most a step of 16 bits: the light divided by its alpha is rounded.
    assert errors["psnr"] >= 20 * math.log10(65535)


def test_holes_in_renders_of_opaque_views_are_warned_of(dataset, tmp_path):
    source = SourceDataset(dataset, "perspective", ".exr")
    view = source.lightfield.views[1]
    alpha = np.full((48, 64), 255, np.uint8)
    path = tmp_path / f"{view.name}.png"
    for hole, expected in ((0, None), (12, "has another alpha than the truth in 25% of")):
        alpha[:hole] = 0
        images.write_png(path, np.dstack([source.colour(view), alpha]))
        _, problem = compared(source, path, BLACK)
        assert problem is None if expected is None else expected in problem


def test_white_renders_are_warned_of_until_their_background_is_given(
    transparent, tmp_path, run_program
):
    alpha = images.read_image(transparent.path(transparent.lightfield.views[1])).channels["A"]
    for view in TESTS:
        images.write_png(tmp_path / "renders" / f"spiral_{view}.png", on(WHITE, alpha))
    arguments = [
        tmp_path / "renders",
        "--dataset",
        transparent.dataset,
        "--output",
        tmp_path / "page",
    ]
    result = run_program("evaluate.py", *arguments)
    assert f"spiral_{TESTS[0]}.png: has no alpha, and is #ffffff where" in result.stderr
    assert "--background" in result.stderr
    assert "(and 1 more of 2)" in result.stderr
    assert "#ffffff" in (tmp_path / "page" / "index.html").read_text()
    result = run_program("evaluate.py", *arguments, "--background", "white")
    assert "warning" not in result.stderr
    with (tmp_path / "page" / "evaluation.csv").open() as file:
        assert min(float(row["psnr"]) for row in csv.DictReader(file)) > 48
    result = run_program("evaluate.py", *arguments, "--background", "sky", check=False)
    assert result.returncode == 1
    assert '--background: is "sky"; must be black, white or rrggbb' in result.stderr


def test_regions_follow_the_lens_and_the_jumps_of_depth(dataset):
    source = SourceDataset(dataset, "fisheye", ".exr")
    distance = np.ones((48, 48))
    distance[:, 24:], distance[:10] = 2, np.inf
    depth = z_from_distance(distance, source.lens.pixel_rays())
    everywhere = np.ones((48, 48), bool)
    parts = evaluation.regions(source, source.lightfield.views[1], everywhere, depth)
    assert parts["all"].sum() == pytest.approx(math.pi * 24**2, rel=0.02)
    assert parts["centre"].sum() == pytest.approx(math.pi * 12**2, rel=0.02)
    assert (parts["centre"] ^ parts["rim"] == parts["all"]).all()
    assert np.flatnonzero(parts["edges"][30]).tolist() == [22, 23, 24, 25]
    assert np.flatnonzero(parts["background"][:, 24]).tolist() == list(range(10))


def test_a_missing_picture_or_one_of_another_size_is_named(dataset, tmp_path, run_program):
    arguments = ["--dataset", dataset, "--source", "perspective", "--output", tmp_path / "page"]
    result = run_program("evaluate.py", tmp_path, *arguments, check=False)
    assert result.returncode == 1
    assert "has no view_0001f.exr or .png, nor dataset_view_0001f.exr or .png" in result.stderr
    renders = tmp_path / "renders"
    for number, view in enumerate(TESTS):
        light = {name: np.full((48, 64), 0.5, np.float32) for name in "RGB"}
        light["G"][3, 3] = np.nan if number else 0.5
        images.write_exr(renders / f"{view}.exr", light)
    result = run_program("evaluate.py", renders, *arguments, check=False)
    problem = f"{TESTS[1]}.exr: has colour that is not a number where it is compared"
    assert (result.returncode, result.stderr.splitlines()[-1].endswith(problem)) == (1, True)
    assert [path.name for path in tmp_path.iterdir()] == ["renders"]
    source = SourceDataset(dataset, "perspective", ".exr")
    images.write_png(tmp_path / "small.png", np.zeros((4, 6, 3), np.uint8))
    images.write_png(tmp_path / "grey.png", np.zeros((48, 64), np.uint8))
    images.write_exr(tmp_path / "grey.exr", {"Z": np.ones((48, 64), np.float32)})
    for name, problem in (
        ("small.png", r"is 6 × 4, but .*lightfield\.json says 64 × 48"),
        ("grey.png", "has the channels Y; must have RGB"),
        ("grey.exr", "has the channels Z; must have RGB"),
    ):
        with pytest.raises(UserError, match=problem):
            evaluation.rendered(tmp_path / name, source, BLACK)
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


@pytest.mark.parametrize("width", accessibility.WIDTHS)
def test_axe_finds_no_fault_in_a_page_of_errors(dataset, tmp_path, run_program, show, width):
    renders = dataset / "perspective"
    arguments = [renders, "--dataset", dataset, "--source", "perspective", "--output", tmp_path]
    run_program("evaluate.py", *arguments)
    tab = show(tmp_path / "index.html", width)
    assert accessibility.faults(tab) == []
    assert tab.evaluate("document.documentElement.scrollWidth") <= width


def test_a_mean_is_over_the_views_that_have_a_number():
    rows = [
        {"view": "a", "region": "all", "psnr": 20.0, "depth": None, "normal": None},
        {"view": "b", "region": "all", "psnr": 30.0, "depth": 0.5, "normal": None},
    ]
    (mean,) = evaluation.means(rows)
    assert mean == {"view": "mean", "region": "all", "psnr": 25.0, "depth": 0.5, "normal": None}
