"""A dataset's page in a real browser: it loads, shows the content of the files, and can be used."""

import base64
import io
import json
import math
import re
from types import SimpleNamespace

import accessibility
import numpy as np
import pytest
from conftest import SMALL_WALK
from PIL import Image
from scipy.ndimage import map_coordinates
from sphere import BALL, BALL_RADIUS, RADIUS, colour_of, look, look_at_ball, look_at_ball_alone

from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.export.source import SourceDataset
from lightfield.exporters import EXPORTERS
from lightfield.formats.lightfield import LightField, View
from lightfield.formats.passes import FLOW, PASSES
from lightfield.geometry import lenses, overview, rigs
from lightfield.geometry.depth import z_from_distance
from lightfield.imaging import images, pictures
from lightfield.imaging.tonemap import decode_srgb
from lightfield.products import exports
from lightfield.reading.dataset import OpenDataset
from lightfield.report import (
    contact_sheet,
    dataset_page,
    epipolar,
    faults,
    figures,
    packing,
    page,
    pass_pictures,
)
from lightfield.stages.report import (
    FiguresSettings,
    MeasurementFile,
    PageSettings,
    ReportFigures,
    ReportHtml,
)

SPHERE = {
    "type": "sphere",
    "subdivisions": 1,
    "size": 2.0,
    "center": [0, 0, 0],
    "camera": {"lens": "equidistant", "fov": 180, "resolution": [64, 64]},
}
LINE = {
    "type": "plane",
    "cameras": [5, 3],
    "size": [2, 1, 1],
    "camera": {"lens": "rectilinear", "fov": 90, "resolution": [64, 48]},
}
YAML = "render: {samples: 4}  # <b>\n"
HOSTILE = "<img src=x onerror=\"document.title='broken'\"></script><script>document.title='broken'"


def write_dataset(folder, rig, depth="z", names=(), see=look):
    """Write the views of a rig in a sphere, as the renderer does."""
    lens = lenses.from_camera(rig["camera"])
    keys = {"depth": depth, "frame": 7, "scene": {"name": "ball"}}
    keys["render"] = {"samples": 4, "adaptive_threshold": 0, "denoise": False}
    lightfield = LightField.from_rig(rig, lens, **keys)
    renamed = [
        View.placed(n, v.world_from_camera) for n, v in zip(names, lightfield.views, strict=False)
    ]
    lightfield = lightfield.changed(views=renamed or lightfield.views)
    for view in lightfield.views:
        colour, distance = see(lens, view.world_from_camera)
        z = z_from_distance(distance, lens.pixel_rays())
        channels = channels_of(colour.astype(np.float16), Z=np.where(np.isnan(z), np.inf, z))
        images.write_exr(folder / "exr" / f"{view.name}.exr", channels)
    lightfield.write(folder / "lightfield.json")
    return lightfield


def channels_of(colour, **others):
    planes = dict(zip("RGB", np.moveaxis(colour, -1, 0), strict=True))
    return planes | {name: plane.astype(np.float32) for name, plane in others.items()}


def make_page(folder, rig, *measurements, name="ball/LFSphere", panorama=False):
    output = folder / "report" / "index.html"
    settings = PageSettings(
        rig=rigs.from_settings(rig),
        yaml=YAML,
        command="snakemake --cores all",
        panorama=panorama,
        measurements=[MeasurementFile(file=str(file)) for file in measurements],
    )
    ReportHtml(settings=settings, dataset=folder, dataset_name=name, output=output).run()
    return output


def test_the_list_of_files_names_the_exports(tmp_path):
    lightfield = write_dataset(tmp_path, LINE)
    lightfield.write(tmp_path / "again" / "lightfield.json")
    for name, source, options in (
        ("hci", "", {"disparity": "exr"}),
        ("poses_csv", "again", {}),
    ):
        settings = EXPORTERS[name](sources=[source or "views"], **options)
        folder = tmp_path / source / "exports" / name
        exports.run(SourceDataset(tmp_path, source, ".exr"), settings, folder)
    write_json(tmp_path / "mesh" / "export.json", {})
    write_json(tmp_path / "video" / "export.json", {})
    listed = dict(dataset_page.files(tmp_path, lightfield, valid=True))
    assert "HCI" in listed["exports/hci/"]
    assert "poses" in listed["again/exports/poses_csv/"]
    assert {"mesh/", "video/"} <= listed.keys()
    # Each place is there.
    places = [place for place in listed if not place.endswith("…") and place != "sha256sums.txt"]
    assert [place for place in places if not (tmp_path / place).exists()] == ["validation.json"]


def draw(folder, rig, output, panorama=None):
    settings = FiguresSettings(rig=rigs.from_settings(rig))
    ReportFigures(settings=settings, dataset=folder, panorama=panorama, output=output).run()


# What the time of full size follows from.
FINISHED = "11 finished views of 64 × 64 pixels with 4 samples"


@pytest.fixture(scope="module")
def sphere(tmp_path_factory):
    """The page of a sphere of cameras with every section, and its lightfield.json."""
    folder = tmp_path_factory.mktemp("results") / "ball" / "LFSphere"
    lightfield = write_dataset(folder, SPHERE)
    panorama = lenses.from_camera({"lens": "equirectangular", "resolution": [128, 64]})
    colour, distance = look(panorama, np.eye(4))
    channels = channels_of(colour.astype(np.float32), Z=distance)
    images.write_exr(folder / "panorama.exr", channels)
    draw(folder, SPHERE, folder / "report", folder / "panorama.exr")
    check = {"views": [], "problems": [], "warnings": [], "figures": {"nearest_metres": 0.25}}
    checks = [
        {"name": "views", "passed": True, "detail": "12 of 12 images are there", **check},
        {"name": "perspective/depth", "passed": None, "detail": "no depth", **check},
        {"name": "files", "passed": False, "detail": "1 file", **check, "problems": [HOSTILE]},
    ]
    write_json(folder / "validation.json", {"valid": False, "checks": checks})
    write_json(
        folder / "report" / "costs.json",
        {
            "stages": [{"stage": "render", "jobs": 1, "wall_seconds": 200.0, "bytes": 2_500_000}],
            "energy_kwh": 0.25,
            "extrapolation": {
                "core_hours": 12.03,
                "core_hours_uncertainty": 1.5,
                "rendering": f"full size: rendering 25 views takes 11 h of one core, by {FINISHED}",
                "basis": f"rendering by {FINISHED}; on the processor",
            },
        },
    )
    measured = folder.parent / "benchmarks"
    measured.mkdir()
    (measured / "stability.csv").write_text(
        "group,case,dtype,condition,error,error_bound,verdict\n"
        "lens pair,a to b,float32,5.0,1e-6,2e-6,ok\n"
        "lens pair,b to a,float32,5.0,4e-6,2e-6,FAIL\n"
    )
    page = make_page(folder, SPHERE, *measured.rglob("*.csv"), panorama=True)
    return SimpleNamespace(page=page, lightfield=lightfield, folder=folder)


# Read a copy, because the page's own canvases are made for drawing.
COPY = """
(name) => {
  const canvas = document.getElementById(name);
  const copy = document.createElement("canvas");
  copy.width = canvas.width;
  copy.height = canvas.height;
  const context = copy.getContext("2d", { willReadFrequently: true });
  context.drawImage(canvas, 0, 0);
  const { data } = context.getImageData(0, 0, copy.width, copy.height);
  return data.some((value) => value) ? copy.toDataURL() : null;
}
"""


def pixels(tab, canvas):
    """Return the pixels (height, width, 4) of a canvas after it was drawn."""
    tab.wait_for_function(COPY, arg=canvas)
    tab.evaluate("() => new Promise((done) => requestAnimationFrame(() => setTimeout(done, 50)))")
    _, _, encoded = tab.evaluate(COPY, canvas).partition(",")
    return np.array(Image.open(io.BytesIO(base64.b64decode(encoded))).convert("RGBA")).astype(int)


def frame_of(tab, canvas):
    """Scroll until all of a canvas is in the window. Return its place."""
    tab.evaluate(
        "(name) => document.getElementById(name).scrollIntoView({block: 'center'})", canvas
    )
    return tab.locator(f"#{canvas}").bounding_box()


def test_the_page_loads_completely_from_one_file(sphere, show):
    tab = show(sphere.page, width=1280, walk_scale=1)
    pixels(tab, "viewer")
    widths = tab.eval_on_selector_all("img", "all => all.map((image) => image.naturalWidth)")
    assert len(widths) == 4
    assert min(widths) > 0
    text = tab.inner_text("main")
    for part in ("not valid", "equidistant fisheye, 180°", "12 of 12 images", "snakemake"):
        assert part in text
    # The costs are in words, also those at full size, with no more digits than are known.
    for part in ("3 min 20 s", "2.5 MB", "0.25 kWh", "12 h"):
        assert part in text
    assert "±" not in text
    assert text.count(FINISHED) == 1
    for part in ("180° × 180°", "Frame\n7", "Pixels without a hit\n0 %", "snakemake --cores all"):
        assert part in text
    assert YAML.strip() in tab.text_content("#rebuild pre >> nth=1")
    # The worst case, as part of its bound, comes first.
    assert text.index("200%") < text.index("50%")


@pytest.mark.slow
def test_the_page_is_the_same_each_time(sphere):
    before = sphere.page.read_bytes()
    assert make_page(sphere.folder, SPHERE).read_bytes() != before
    measured = (sphere.folder.parent / "benchmarks").rglob("*.csv")
    assert make_page(sphere.folder, SPHERE, *measured, panorama=True).read_bytes() == before


def test_the_viewer_steps_exposes_and_shows_depth(sphere, show):
    tab = show(sphere.page)
    first = pixels(tab, "viewer")
    name = tab.inner_text("#view-name")
    tab.click("[data-step=right]")
    assert tab.inner_text("#view-name") != name
    assert (pixels(tab, "viewer") != first).any()
    tab.focus("#viewer")
    tab.keyboard.press("ArrowLeft")
    assert tab.inner_text("#view-name") == name
    assert (pixels(tab, "viewer") == first).all()

    tab.evaluate(
        "() => { const s = document.getElementById('exposure'); s.value = -3;"
        " s.dispatchEvent(new Event('input')); }"
    )
    darker = pixels(tab, "viewer")
    lit = first[..., :3].sum(axis=-1) > 60
    assert (darker[lit][:, :3].sum(axis=-1) < first[lit][:, :3].sum(axis=-1)).all()
    tab.click("#show-depth")
    assert tab.is_visible("#depth-scale")
    assert (pixels(tab, "viewer")[lit] != darker[lit]).any()


def test_the_viewer_shows_a_view_clean_and_as_the_sensor_sees_it(tmp_path, show):
    rig = {**LINE, "cameras": [2, 1]}
    lightfield = write_dataset(tmp_path, rig)
    page_without = make_page(tmp_path, rig).read_text()
    # A picture that no light of the views is like: stripes.
    codes = np.zeros((48, 64, 3), np.uint8)
    codes[:, ::16] = codes[:, 1::16] = codes[:, 2::16] = codes[:, 3::16] = (250, 120, 20)
    for stops, pixels_of_bracket in ((-2, 255 - codes), (0, codes), (2, 255 - codes)):
        folder = tmp_path / f"sensor_ev{stops}"
        content = {"reprojection": {"sensor": {"noise": {"a": 0.1}, "bracket": stops}}}
        lightfield.changed(**content).write(folder / "lightfield.json")
        for view in lightfield.views:
            images.write_png(folder / f"{view.name}.png", pixels_of_bracket)
    tab = show(make_page(tmp_path, rig))
    clean = pixels(tab, "viewer")
    tab.click("#show-sensor")
    sensed = pixels(tab, "viewer")[..., :3].astype(int)
    # The packing is lossy.
    assert np.abs(sensed - codes).mean() < 12
    assert "sensor_ev0/" in tab.inner_text("#explore")
    tab.click("#show-sensor")
    assert (pixels(tab, "viewer") == clean).all()
    assert "show-sensor" not in page_without.replace('element("show-sensor")', "")


def test_the_viewer_shows_dark_colours_as_they_are_beside_a_fire(tmp_path, show):
    rig = {**LINE, "cameras": [2, 1]}
    lightfield = write_dataset(tmp_path, rig)
    colour = np.empty((48, 64, 3), np.float16)
    # Leaves in the shade, in the sun, and a fire.
    colour[:24] = (0.03, 0.004, 0.0005)
    colour[24:] = (0.02, 0.3, 0.05)
    colour[40:, :8] = (6000, 2500, 400)
    for view in lightfield.views:
        distance = np.ones(colour.shape[:2], np.float32)
        images.write_exr(tmp_path / "exr" / f"{view.name}.exr", channels_of(colour, Z=distance))
    tab = show(make_page(tmp_path, rig))
    shown = pixels(tab, "viewer")[..., :3]
    exposure = pictures.exposure_for(colour.astype(np.float32))
    expected = pictures.develop(colour.astype(np.float32), exposure).astype(int)
    # The packing is lossy at edges.
    middle = (slice(4, 20), slice(20, 60)), (slice(28, 44), slice(20, 60))
    for part in middle:
        assert np.abs(shown[part] - expected[part]).max() <= 6


def test_the_readout_shows_the_files_values(sphere, show):
    tab = show(sphere.page)
    pixels(tab, "viewer")
    frame = frame_of(tab, "viewer")
    tab.mouse.move(
        frame["x"] + frame["width"] * 40.5 / 64, frame["y"] + frame["height"] * 20.5 / 64
    )
    place, colour, depth = tab.locator("#readout b").all_inner_texts()
    assert place == "40, 20"
    stored = images.read_image(
        sphere.folder / "exr" / f"{tab.inner_text('#view-name')}.exr"
    ).channels
    truth = [float(stored[name][20, 40]) for name in "RGBZ"]
    # Light has lossy compression and 8 bits. Depth has three digits.
    np.testing.assert_allclose([float(word) for word in colour.split()], truth[:3], rtol=0.15)
    assert float(depth.removesuffix(" m")) == pytest.approx(truth[3], rel=0.006)


def test_the_rig_turns_and_its_cameras_open_their_views(sphere, show):
    tab = show(sphere.page)
    before = pixels(tab, "rig")
    drawn = before[..., 3] > 0
    assert 0.005 < drawn.mean() < 0.9
    frame = frame_of(tab, "rig")
    tab.mouse.move(frame["x"] + 200, frame["y"] + 200)
    tab.mouse.down()
    tab.mouse.move(frame["x"] + 300, frame["y"] + 230, steps=3)
    tab.mouse.up()
    turned = pixels(tab, "rig")
    assert (turned != before).any(axis=-1).sum() > 0.1 * drawn.sum()

    closed = tab.evaluate(
        "() => rig.screen.map(([x, y, depth], number) => ({x, y, depth, number}))"
        ".filter((camera) => camera.number !== DATA.embedded[viewer.current].view)"
        ".sort((a, b) => a.depth - b.depth)[0]"
    )
    tab.mouse.move(frame["x"] + closed["x"], frame["y"] + closed["y"])
    tab.wait_for_selector("#rig-name:visible")
    name = sphere.lightfield.views[closed["number"]].name
    assert tab.inner_text("#rig-name") == name
    tab.mouse.click(frame["x"] + closed["x"], frame["y"] + closed["y"])
    assert tab.inner_text("#view-name") == name


def test_the_epipolar_image_is_drawn_and_pointed_at(sphere, show):
    tab = show(sphere.page, width=1280)
    level = pixels(tab, "epi")
    tab.click("#epi-depth")
    assert (pixels(tab, "epi") != level).any()
    tab.hover("#epi", position={"x": 5, "y": 100})
    assert "distance" in tab.inner_text("#epi-readout")


@pytest.mark.parametrize("width", [320, 390])
def test_a_phone_does_not_scroll_sideways(sphere, show, width):
    tab = show(sphere.page, width, walk_scale=SMALL_WALK)
    pixels(tab, "viewer")
    assert tab.evaluate("() => document.documentElement.scrollWidth") <= width
    # A part that scrolls by itself cannot be reached with keys, and shows half a line.
    scrolls = """all => all.filter((one) => one.scrollWidth > one.clientWidth + 1)
        .filter((one) => /auto|scroll/.test(getComputedStyle(one).overflowX))
        .map((one) => one.outerHTML.slice(0, 80))"""
    assert tab.eval_on_selector_all("*", scrolls) == []
    cut = "all => all.filter((table) => table.scrollWidth > table.clientWidth).length"
    assert tab.eval_on_selector_all(".scroll, pre, nav", cut) == 0


@pytest.mark.parametrize("width", accessibility.WIDTHS)
def test_axe_finds_no_fault_in_a_page(sphere, show, width):
    tab = show(sphere.page, width, walk_scale=SMALL_WALK)
    pixels(tab, "viewer")
    assert accessibility.faults(tab) == []


def test_axe_finds_a_picture_without_a_description(sphere, show):
    tab = show(sphere.page)
    tab.evaluate("document.querySelector('img').removeAttribute('alt')")
    assert [rule for rule, _ in accessibility.faults(tab)] == ["image-alt"]


def test_names_are_text_whatever_they_hold(show, tmp_path):
    rig = {**LINE, "cameras": [2, 1]}
    names = ["a\"<b>&'", "<i>"]
    write_dataset(tmp_path, rig, depth=None, names=names)
    tab = show(make_page(tmp_path, rig, name=f"{HOSTILE}/{HOSTILE}"))
    pixels(tab, "viewer")
    assert tab.title() != "broken"
    assert tab.inner_text("#view-name") in names
    # Without depth, validation, costs, measurements or a row of cameras, there is no section.
    titles = tab.locator("h2, h3").all_inner_texts()
    expected = ["Explore", "Views", "Quality", "Samples and noise", "Rebuild", "Files", "In Python"]
    assert titles == expected
    links = tab.locator("nav a").all_inner_texts()
    assert links == ["All datasets", "Explore", "Views", "Quality", "Rebuild", "Files"]
    assert tab.locator("#show-points").count() == 0
    assert tab.is_disabled("#show-depth")


def test_the_scenes_points_are_drawn_in_the_views_directions(sphere, show):
    tab = show(sphere.page)
    shown = pixels(tab, "rig")
    places = tab.evaluate("() => rig.points.map((point) => point.at)")
    assert len(places) > 4000
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), RADIUS, rtol=0.02)
    tab.click("#show-points")
    assert (pixels(tab, "rig") != shown).any(axis=-1).sum() > 1000


def test_cameras_have_the_colour_of_their_part_of_the_dataset(show, tmp_path):
    rig = {**LINE, "split": "odd"}
    lightfield = write_dataset(tmp_path, rig)
    parts = [view.split for view in lightfield.views]
    picture = tmp_path / "report/rig"
    figures.draw_rig(picture, rigs.from_settings(rig), lightfield.world_from_cameras, parts)
    tab = show(make_page(tmp_path, rig))
    pixels(tab, "viewer")
    assert "15 (8 train, 7 test)" in tab.inner_text("main")
    colours = tab.evaluate("() => DATA.views.map((_, number) => colourOf(number))")
    # The middle row has one colour, except for its test views.
    expected = ["--row" if 5 <= number < 10 else "--shown" for number in range(15)]
    assert colours == ["--test" if n % 2 else colour for n, colour in enumerate(expected)]
    assert tab.locator(".keys .dot.test").count() == 1


def test_each_reprojection_is_shown(show, tmp_path):
    rig = {**LINE, "cameras": [2, 1]}
    lightfield = write_dataset(tmp_path, rig)
    for view in lightfield.views:
        picture = np.full((4, 4, 3), 200, np.uint8)
        images.write_png(tmp_path / "small" / f"{view.name}.png", picture)
    lens = lenses.from_camera({"lens": "rectilinear", "fov": 90, "resolution": [4, 4]})
    lightfield.changed(lens).write(tmp_path / "small/lightfield.json")
    tab = show(make_page(tmp_path, rig))
    source = tab.get_attribute("img[alt='The views as small']", "src")
    # It is developed already, so it is shown unchanged.
    assert abs(decoded(source)[50, 50].astype(int) - 200).max() <= 2


def test_each_pass_of_the_middle_view_is_shown(show, tmp_path):
    rig = {**LINE, "cameras": [2, 1]}
    lightfield = write_dataset(tmp_path, rig).with_flow()
    lens, shown = lightfield.lens, ["normal", "object", "cryptomatte", "motion", "albedo", "flow"]
    render = lightfield.render.changed(passes=shown[:-1])
    lightfield.changed(render=render.to_json()).write(tmp_path / "lightfield.json")
    left = (np.indices((lens.height, lens.width))[1] < lens.width / 2).astype(float)
    # All other values are 0.
    holds = {
        "normal": {"B": left},
        "object": {"Y": 2 - left},
        "cryptomatte": {"CryptoObject00.R": 7, "CryptoObject00.G": left / 2},
        "motion": {"next.X": left},
        "albedo": {"R": left},
        "flow": {"X": 1, "V": left},
    }
    for view in lightfield.views:
        for render_pass in (*(PASSES[name] for name in shown[:-1]), FLOW):
            name = view.flow if render_pass == FLOW else view.name
            planes = {
                channel: (0 * left + holds[render_pass.name].get(channel, 0)).astype(
                    render_pass.dtype
                )
                for channel in render_pass.channels
            }
            images.write_exr(render_pass.path(tmp_path, name), planes)
    tab = show(make_page(tmp_path, rig))
    pictures = {
        name: decoded(tab.get_attribute(f"img[alt^='{name} of view']", "src"))[4, [4, -4]].tolist()
        for name in shown
    }
    assert tab.locator(".passes img").count() == len(shown)
    assert pictures["normal"] == [[128, 128, 255], [0, 0, 0]]
    first, second = pictures["object"]
    assert first != second and max(first) > 100 and max(second) > 100
    assert max(pictures["cryptomatte"][0]) > 40 and pictures["cryptomatte"][1] == [0, 0, 0]
    assert pictures["motion"] == [[255, 0, 0], [255, 255, 255]]
    assert pictures["albedo"] == [[255, 0, 0], [0, 0, 0]]
    assert pictures["flow"] == [[255, 0, 0], [102, 0, 0]]
    assert "normal/" in tab.locator("#files").inner_text()


def test_the_noise_is_the_error_that_the_variance_says(tmp_path):
    """All colours are equal, so that middle grey is 0.18. The standard deviation is a tenth."""
    grey = np.full((48, 64, 3), 3.0, np.float32)
    lightfield = write_dataset(tmp_path, LINE, see=lambda lens, pose: (grey, look(lens, pose)[1]))
    render = lightfield.render.changed(passes=["variance"])
    lightfield.changed(render=render.to_json()).write(tmp_path / "lightfield.json")
    for view in lightfield.views:
        planes = dict.fromkeys("RGB", np.full(grey.shape[:2], 0.3**2, np.float32))
        images.write_exr(PASSES["variance"].path(tmp_path, view.name), planes)
    text = make_page(tmp_path, LINE).read_text()
    # 0.018² / (0.18² + 0.01)
    assert "relative mean squared error 0.0076" in text


def test_a_scene_at_rest_has_a_white_picture_of_motion(tmp_path):
    lightfield = write_dataset(tmp_path, LINE)
    render = lightfield.render.changed(passes=["motion"])
    lightfield = lightfield.changed(render=render.to_json())
    lightfield.write(tmp_path / "lightfield.json")
    view, motion = OpenDataset.in_folder(tmp_path).views[0], PASSES["motion"]
    noise = np.full((lightfield.lens.height, lightfield.lens.width), 1e-5, np.float32)
    images.write_exr(motion.path(tmp_path, view.name), dict.fromkeys(motion.channels, noise))
    ((_, _, picture),) = pass_pictures.collect(view, 0)
    assert (decoded(picture) >= 252).all()


def test_an_index_leads_to_every_page(sphere, run_program, show):
    results = sphere.folder.parents[1]
    output = results / "index.html"
    run_program("report_index.py", "--results", results, "--output", output)
    tab = show(output)
    tab.click(".cards a")
    assert tab.inner_text("h1").replace(" ", "") == "ball/LFSphere"
    tab.click(".home")
    assert tab.url == output.as_uri()


def write_many(results, count):
    """Write an index's datasets: fisheyes of one scene, and a panorama of another one."""
    for number in range(count):
        folder = results / ("ball" if number else "garden") / f"rig{number}"
        (folder / "report").mkdir(parents=True)
        camera = {"lens": "equidistant", "fov": 180, "resolution": [8, 8]}
        if not number:
            camera = {"lens": "equirectangular", "resolution": [16, 8]}
        rig = {**LINE, "cameras": [1, 1], "camera": camera}
        write_dataset(folder, rig, depth="z" if number else "distance")
        (folder / "report/index.html").write_text("")


@pytest.mark.parametrize("width", accessibility.WIDTHS)
def test_axe_finds_no_fault_in_an_index(run_program, show, tmp_path, width):
    write_many(tmp_path, 12)
    output = tmp_path / "index.html"
    run_program("report_index.py", "--results", tmp_path, "--output", output)
    assert accessibility.faults(show(output, width)) == []


@pytest.mark.parametrize(("count", "has_search"), [(11, False), (12, True)])
def test_an_index_of_many_datasets_can_be_searched(count, has_search, run_program, show, tmp_path):
    write_many(tmp_path, count)
    output = tmp_path / "index.html"
    run_program("report_index.py", "--results", tmp_path, "--output", output)
    tab = show(output)
    cards = tab.locator(".cards li:visible")
    assert cards.count() == count
    search = tab.get_by_label("Search")
    assert search.count() == has_search
    if not has_search:
        return
    search.fill("Ball rig1")
    assert cards.locator("p:first-of-type").all_inner_texts() == ["rig1", "rig10", "rig11"]
    search.fill("")
    tab.get_by_label("Lens").select_option("equirectangular panorama")
    assert cards.locator("h2").all_inner_texts() == ["garden"]
    assert tab.inner_text("#count") == "1 of 12 shown"
    tab.get_by_label("State").select_option("not validated")
    assert cards.count() == 1


@pytest.mark.parametrize(
    ("file", "text", "expected"),
    [
        ("lightfield.json", "{}", "lightfield.json: camera: is missing"),
        ("lightfield.json", "[", "lightfield.json: is not JSON"),
        ("lightfield.json", '{"frames": []}', "lightfield.json: camera: is missing"),
        ("validation.json", "{}", "validation.json: is not what"),
        ("report/costs.json", "[]", "costs.json: is not what scripts/costs.py writes"),
        ("report/overview.png", "no", "overview.png: is not an image"),
        ("exr/view_0001f.exr", "no", "view_0001f.exr: is not an image"),
    ],
)
def test_an_unreadable_file_is_an_error_of_one_line(tmp_path, file, text, expected):
    rig = {**LINE, "cameras": [2, 1]}
    write_dataset(tmp_path, rig)
    (tmp_path / file).parent.mkdir(exist_ok=True)
    (tmp_path / file).write_text(text)
    with pytest.raises(UserError, match=expected) as caught:
        make_page(tmp_path, rig)
    assert "\n" not in str(caught.value)


def test_the_programs_make_pictures_and_page(run_program, tmp_path):
    rig = {**LINE, "cameras": [2, 1]}
    write_dataset(tmp_path, rig)
    figures, page = (tmp_path / name for name in ("figures.json", "page.json"))
    figures.write_text(json.dumps({"rig": rig}))
    page.write_text(json.dumps({"rig": rig, "yaml": YAML, "command": "make <it>"}))
    arguments = ("--dataset", tmp_path, "--settings")
    run_program("report_figures.py", *arguments, figures, "--output", tmp_path / "report")
    arguments = (*arguments, page, "--name", "a/b")
    run_program("report_html.py", *arguments, "--output", tmp_path / "x.html")
    text = (tmp_path / "x.html").read_text()
    for part in (
        "view_0001f, the view in the middle",
        "make &lt;it&gt;",
        "samples: 4}  # &lt;b&gt;",
    ):
        assert part in text


# These are the inputs of the page.


def test_pictures_of_a_fault_mark_every_wrong_pixel(tmp_path):
    channels = {name: np.full((300, 520), 0.2, np.float32) for name in "RGBZ"}
    channels["G"][100, 201] = np.nan
    channels["Z"][151] = (-1, np.inf, *np.linspace(1, 9, 518))
    images.write_exr(tmp_path / "a.exr", channels)
    images.write_png(tmp_path / "b.png", np.full((8, 8, 3), 90, np.uint8))
    (tmp_path / "c.exr").write_text("no image")
    first, second = faults.collect(tmp_path, ["a", "b", "c", "missing"])
    assert (first.name, second.name, second.depth) == ("a.exr", "b.png", None)
    colour, depth = decoded(first.colour), decoded(first.depth)
    # Each pixel is enlarged to 3 × 3.
    assert colour.shape == depth.shape == (100, 174, 3)
    assert np.argwhere((colour == faults.WRONG).all(axis=-1)).tolist() == [[33, 67]]
    assert np.argwhere((depth == faults.WRONG).all(axis=-1)).tolist() == [[50, 0]]
    assert (decoded(second.colour) == 90).all()


@pytest.mark.parametrize("size", [(1, 1), (5, 64), (64, 5)])
def test_few_pixels_have_no_estimate_of_noise(size, tmp_path):
    colour, depth = np.full((*size, 3), 0.5, np.float32), np.ones(size, np.float32)
    figures.draw_noise(tmp_path / "noise", figures.Overview(colour, depth, False, "distance"))
    assert {path.suffix for path in tmp_path.iterdir()} == {".svg", ".png"}


def test_a_picture_of_16_bits_is_shown_with_8(tmp_path):
    pixels = np.arange(8 * 8 * 3, dtype=np.uint8).reshape(8, 8, 3)
    images.write_png(tmp_path / "a.png", pixels)
    images.write_png(tmp_path / "b.png", pixels * np.uint16(257))
    for fault in faults.collect(tmp_path, ["a", "b"]):
        assert (decoded(fault.colour) == pixels).all()
    first, second = (contact_sheet.small_view(tmp_path / f"{name}.png", 8, 8) for name in "ab")
    assert (first == pixels).all() and (second == pixels).all()


@pytest.mark.parametrize(("views", "width", "height"), [(120, 1, 999), (1, 1, 999), (3, 999, 1)])
def test_a_contact_sheet_never_exceeds_the_page(tmp_path, views, width, height):
    images.write_png(tmp_path / "a.png", np.full((height, width, 3), 200, np.uint8))
    sheet = contact_sheet.sheet([tmp_path / "a.png"] * views, width, height)
    assert max(sheet.shape) <= 2000
    assert (sheet == 200).all(axis=-1).any()


def test_shrunk_pictures_stay_white_beside_edges(tmp_path):
    pixels = np.zeros((64, 600, 3), np.uint8)
    pixels[:, 300:] = 255
    images.write_png(tmp_path / "a.png", pixels)
    small = contact_sheet.small_view(tmp_path / "a.png", 250, 24)
    assert small.dtype == np.uint8 and small[:, 126:].min() > 240
    assert decoded(page.photo(tmp_path / "a.png", 250))[:, 126:].min() > 230


def decoded(uri):
    content = base64.b64decode(uri.partition(",")[2])
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB"))


@pytest.mark.parametrize("view", ["view_0001f", "view_0007f"])
def test_an_unreadable_view_is_no_error_of_the_page(tmp_path, view):
    write_dataset(tmp_path, LINE)
    (tmp_path / "exr" / f"{view}.exr").write_text("no image")
    problem = f"exr/{view}.exr: is not an image"
    check = {"detail": "", "warnings": [], "figures": {}, "problems": [problem]}
    check |= {"name": "images", "passed": False, "views": [view]}
    write_json(tmp_path / "validation.json", {"valid": False, "checks": [check]})
    assert problem in make_page(tmp_path, LINE).read_text()


def test_stills_are_the_same_each_time(sphere, tmp_path):
    draw(sphere.folder, SPHERE, tmp_path, sphere.folder / "panorama.exr")
    made = sorted(tmp_path.iterdir())
    assert len(made) == 8
    for path in made:
        assert path.read_bytes() == (sphere.folder / "report" / path.name).read_bytes()


FISHEYE, NARROW, PANORAMA = (
    {"lens": "equidistant", "fov": 180, "resolution": [8, 8]},
    {"lens": "rectilinear", "fov": 90, "resolution": [8, 8]},
    {"lens": "equirectangular", "resolution": [8, 4]},
)
WIDEST = {"lens": "equidistant", "fov": 359, "resolution": [8, 8]}
LATTICE = {"type": "lattice", "cameras": [2, 2, 2]}
KEYS = [{"position": [0, 0, 0]}, {"position": [0, 3, 0.5]}]


@pytest.mark.parametrize(
    ("rig", "camera", "expected"),
    [
        (SPHERE, FISHEYE, True),
        ({**SPHERE, "subdivisions": 3}, NARROW, True),
        ({"type": "cuboid", "cameras": [20, 20, 20]}, FISHEYE, True),
        ({**SPHERE, "face_inside": True}, FISHEYE, False),
        ({**SPHERE, "look_at": [0, 0, 0]}, NARROW, False),
        ({"type": "hemisphere", "count": 20}, FISHEYE, False),
        ({"type": "ring", "count": 20}, NARROW, False),
        # The panorama would lie inside the object that they look at.
        ({"type": "hemisphere", "count": 20}, WIDEST, False),
        ({"type": "ring", "count": 20}, WIDEST, False),
        ({**SPHERE, "face_inside": True}, WIDEST, False),
        ({**SPHERE, "look_at": [1, 2, 3]}, PANORAMA, False),
        (SPHERE, WIDEST, True),
        (LINE, FISHEYE, False),
        (LATTICE, FISHEYE, False),
        (LATTICE, PANORAMA, True),
        ({**LATTICE, "cube_map": True}, NARROW, True),
        ({"type": "poses", "file": "unused.csv"}, PANORAMA, False),
        ({"type": "random", "count": 9}, PANORAMA, False),
        ({"type": "path", "count": 9, "keys": KEYS}, PANORAMA, False),
    ],
)
def test_a_panorama_needs_views_that_see_all_round(rig, camera, expected):
    rig = {**rig, "camera": camera, "center": [1, 2, 3]}
    assert overview.sees_all_round(rigs.from_settings(rig)) is expected


@pytest.mark.parametrize(
    ("rig", "expected"),
    [
        ({"type": "plane", "cameras": [5, 3]}, 7),
        ({"type": "hemisphere", "count": 9}, 4),
        # The camera of the middle ring that looks ahead.
        ({"type": "cylinder", "cameras": [8, 3]}, 8),
        ({**LATTICE, "cameras": [3, 1, 1], "cube_map": True}, 6),
    ],
)
def test_the_middle_view_is_in_the_middle_of_the_row_or_the_order(rig, expected):
    assert overview.middle_view(rigs.from_settings(rig)) == expected


def test_a_rig_in_words_has_no_size_unless_it_is_given():
    places = np.array([[0, 0, 0], [0, 3, 0.5]])
    path = rigs.from_settings({"type": "path", "count": 2, "keys": KEYS})
    assert dataset_page.rig_text(path, places) == "path, 0 × 3 × 0.5 m"
    assert dataset_page.rig_text(rigs.from_settings(SPHERE), places) == "sphere, ⌀ 2 m"
    assert dataset_page.rig_text(rigs.from_settings(LINE), places) == "plane 5 × 3, 2 × 1 × 1 m"


def test_a_rig_at_one_place_has_no_size_in_words():
    one = rigs.from_settings({"type": "plane", "cameras": [1, 1]})
    assert dataset_page.rig_text(one, np.zeros((1, 3))) == "plane 1 × 1"
    poses = rigs.from_settings({"type": "poses", "file": "unused.csv"})
    assert dataset_page.rig_text(poses, np.ones((1, 3))) == "poses"
    assert dataset_page.rig_text(poses, np.ones((4, 3))) == "poses, all at one place"


def test_a_page_of_one_view_speaks_of_one_camera(tmp_path, show):
    rig = {"type": "plane", "cameras": [1, 1], "camera": LINE["camera"]}
    write_dataset(tmp_path, rig)
    text = show(make_page(tmp_path, rig)).locator("main").inner_text()
    for wrong in ("0 × 0", "between the cameras", "Every camera", "cameras enclose"):
        assert wrong not in text


def test_numbers_on_a_page_have_few_digits(tmp_path, show):
    field = write_dataset(tmp_path, LINE)
    # Blender keeps numbers in 32 bits.
    render = {"samples": 64, "adaptive_threshold": 0.009999999776482582, "denoise": False}
    field.changed(render=render).write(tmp_path / "lightfield.json")
    text = show(make_page(tmp_path, LINE)).locator("main").inner_text()
    assert "below 0.01." in text
    assert re.findall(r"\d\.\d{6,}", text) == []


def test_the_contact_sheet_of_a_plane_has_its_rows_and_columns(tmp_path):
    write_dataset(tmp_path, LINE)
    draw(tmp_path, LINE, tmp_path / "report")
    sheet = images.read_image(tmp_path / "report/contact_sheet.png").srgb
    step = contact_sheet.GAP + 96
    assert sheet.shape[1] == contact_sheet.GAP + 5 * step
    page = make_page(tmp_path, LINE).read_text()
    assert "in the rows and columns of the rig" in page


@pytest.mark.parametrize(
    ("rig", "count", "columns"),
    [
        ({"type": "plane", "cameras": [9, 9]}, 81, 9),
        ({"type": "plane", "cameras": [21, 21]}, 49, 7),
        ({"type": "plane", "cameras": [40, 3]}, 14, 14),
        ({"type": "plane", "cameras": [3, 2], "stereo": {"distance": 0.1}}, 12, 6),
        ({"type": "cylinder", "cameras": [8, 3]}, 24, 8),
        ({"type": "plane", "cameras": [30, 1]}, 30, None),
        ({"type": "ring", "count": 150}, 75, None),
    ],
)
def test_a_contact_sheet_of_many_views_keeps_whole_rows_and_columns(rig, count, columns):
    rig = rigs.from_settings(rig)
    layout = contact_sheet.layout(rig, rig.view_count)
    assert len(layout.views) == count
    assert layout.columns == columns
    if columns and not rig.stereo:
        places = np.array([pose.position for pose in rig.poses()])[layout.views]
        rows = places.reshape(-1, columns, 3)
        # A row is at one height, and all rows have the same columns.
        np.testing.assert_allclose(np.ptp(rows[..., 2], axis=1), 0, atol=1e-9)
        np.testing.assert_allclose(np.ptp(rows[..., :2], axis=0), 0, atol=1e-9)


def test_the_drawing_of_a_rig_shows_the_box_of_what_its_cameras_see(tmp_path):
    around = {"type": "hemisphere", "count": 6, "size": 3, "center": BALL.tolist()}
    around |= {"camera": {"lens": "rectilinear", "fov": 50, "resolution": [48, 48]}}
    write_dataset(tmp_path, around, see=look_at_ball_alone)
    draw(tmp_path, around, tmp_path / "report")
    assert 'id="scene"' in (tmp_path / "report/rig.svg").read_text()
    low, high = figures.scene_box(OpenDataset.in_folder(tmp_path))
    np.testing.assert_allclose(high[:2] - BALL[:2], [BALL_RADIUS] * 2, atol=0.05)
    np.testing.assert_allclose(BALL[:2] - low[:2], [BALL_RADIUS] * 2, atol=0.05)


def test_the_drawing_of_a_rig_in_a_large_scene_has_no_box(tmp_path):
    small = {**LINE, "size": 0.1}
    write_dataset(tmp_path, small)
    draw(tmp_path, small, tmp_path / "report")
    assert 'id="scene"' not in (tmp_path / "report/rig.svg").read_text()


@pytest.mark.slow
def test_without_a_panorama_the_overview_is_the_view_in_the_middle(tmp_path):
    write_dataset(tmp_path, LINE)
    draw(tmp_path, LINE, tmp_path / "report")
    page = make_page(tmp_path, LINE).read_text()
    assert "view_0007f, the view in the middle of the rig" in page
    middle = images.read_image(tmp_path / "exr/view_0007f.exr").colour
    shown = images.read_image(tmp_path / "report/overview.png").colour
    np.testing.assert_array_equal(shown, pictures.develop(middle, pictures.exposure_for(middle)))
    # An unreadable view is black. Validation will report it.
    (tmp_path / "exr/view_0007f.exr").write_text("no image")
    draw(tmp_path, LINE, tmp_path / "report")
    assert not images.read_image(tmp_path / "report/overview.png").colour.any()


@pytest.mark.parametrize("rig", [SPHERE, LINE])
@pytest.mark.parametrize("tilt", [-30, 0, 20])
def test_epipolar_images_hold_the_light_and_depth_of_the_scene(rig, tilt):
    lens = lenses.from_camera({**rig["camera"], "resolution": [256, 192]})
    poses = np.array([pose.world_from_camera() for pose in rigs.from_settings(rig).poses()])
    row = epipolar.find_row(rigs.from_settings(rig), poses)
    rays = epipolar.directions(row, tilt, 90)
    seen = 0
    for number in row.views:
        colour, distance = look(lens, poses[number])
        z = z_from_distance(distance, lens.pixel_rays())
        light, reach = epipolar.sample(lens, poses[number], colour, z, "z", rays)
        points = poses[number, :3, 3] + reach[:, None] * rays
        hit = np.isfinite(reach)
        # At the rim of a fisheye, Z-depth is so short that half a pixel changes it a lot.
        hit &= -(rays @ poses[number, :3, :3])[:, 2] > 0.2 * np.linalg.norm(rays, axis=-1)
        seen += hit.sum()
        np.testing.assert_allclose(np.linalg.norm(points[hit], axis=-1), RADIUS, rtol=0.06)
        on_ball = points[hit] * (RADIUS / np.linalg.norm(points[hit], axis=-1))[:, None]
        expected = decode_srgb(colour_of(on_ball) / 255)
        np.testing.assert_allclose(light[hit], expected, rtol=0.12)
    assert seen > 40


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"type": "plane", "cameras": [5, 3]}, range(5, 10)),
        ({"type": "plane", "cameras": [5, 3], "face_inside": True}, range(5, 10)),
        ({"type": "cuboid", "cameras": [4, 3, 1]}, range(4)),
        # The left side comes after front and back, each of 2 × 3 cameras.
        ({"type": "cuboid", "cameras": [2, 5, 3]}, range(12 + 5, 12 + 10)),
        ({"type": "lattice", "cameras": [3, 1, 1], "cube_map": True}, (0, 6, 12)),
        ({"type": "cylinder", "cameras": [6, 2]}, range(6, 12)),
        ({"type": "lattice", "cameras": [2, 2, 2]}, None),
        ({"type": "poses", "file": "unused.csv"}, None),
    ],
)
def test_the_row_is_the_middle_one(change, expected):
    rig = {"size": 1.0, "center": [1, 2, 3], "rotation": [0, 0, 30]} | change
    rig = rigs.from_settings(rig)
    unread = change["type"] == "poses"
    poses = (
        np.tile(np.eye(4), (9, 1, 1)) if unread else [p.world_from_camera() for p in rig.poses()]
    )
    row = epipolar.find_row(rig, np.array(poses))
    assert (sorted(row.views) if row else None) == (list(expected) if expected else None)
    if row:
        # The first camera is the leftmost, as the cameras themselves see it.
        assert (np.diff(row.places) > 0).all()
    if row and row.kind == "line":
        first, last = (poses[row.views[end]] for end in (0, -1))
        assert first[:3, 0] @ (last - first)[:3, 3] > 0


def test_a_spheres_row_is_its_equator():
    rig = {**SPHERE, "subdivisions": 3, "center": [0, 0, 1]}
    poses = rigs.from_settings(rig).poses()
    row = epipolar.find_row(
        rigs.from_settings(rig), np.array([pose.world_from_camera() for pose in poses])
    )
    assert len(row.views) == 20
    assert all(poses[view].position[2] == pytest.approx(1, abs=1e-4) for view in row.views)
    assert (np.diff(row.places) > 0).all()


def test_light_and_depth_survive_packing():
    random = np.random.default_rng(1)
    light = np.exp2(random.uniform(-6, 6, (40, 3)))
    light[3] = 0
    scale = packing.light_scale(light)
    codes = packing.pack_light(light, scale).astype(float)
    assert (codes[3] == 0).all()
    toe, highest = scale
    back = toe * ((1 + highest / toe) ** (codes / 255) - 1)
    step = packing.light_step(scale)
    assert step < 0.06
    np.testing.assert_allclose(back, light, rtol=step / 2 + 1e-9, atol=step / 2 * toe)

    depth = np.exp2(random.uniform(-3, 9, 500))
    depth[:2] = np.inf, np.nan
    near, far = packing.depth_range(depth)
    high_byte, low_byte, _ = np.moveaxis(packing.pack_depth(depth, (near, far)).astype(int), -1, 0)
    codes = (high_byte * 256 + low_byte) / 16
    assert codes[0] == packing.MISS
    assert codes[1] == packing.NO_DEPTH
    back = 2 ** (near + (codes[2:] - 1) / (packing.MISS - 2) * (far - near))
    np.testing.assert_allclose(back, depth[2:], rtol=2e-3)


@pytest.fixture(scope="module")
def lit(tmp_path_factory):
    """The page of views whose colour is the sum of two light groups, and their lightfield.json."""
    folder = tmp_path_factory.mktemp("results") / "ball" / "LFSphere"
    lightfield = write_dataset(folder, SPHERE)
    groups = {"lamp": ["Lamp"], "World": ["World"]}
    lightfield = lightfield.changed(render=lightfield.render.changed(light_groups=groups).to_json())
    lightfield.write(folder / "lightfield.json")
    for view in lightfield.views:
        colour = images.read_image(folder / "exr" / f"{view.name}.exr").colour
        for group, part in (("lamp", 0.75), ("World", 0.25)):
            path = folder / f"Combined_{group}" / f"{view.name}.exr"
            images.write_exr(path, channels_of((part * colour).astype(np.float16)))
    return make_page(folder, SPHERE)


def brightness(tab):
    """Return the mean of each channel of the relit picture."""
    return tab.evaluate(
        """async () => {
          const canvas = document.getElementById("lit");
          for (let frame = 0; frame < 2; frame++) await new Promise(requestAnimationFrame);
          const copy = new OffscreenCanvas(canvas.width, canvas.height);
          const context = copy.getContext("2d");
          context.drawImage(canvas, 0, 0);
          const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
          const sums = [0, 0, 0];
          data.forEach((value, place) => { if (place % 4 < 3) sums[place % 4] += value; });
          return sums.map((sum) => (4 * sum) / data.length);
        }"""
    )


def move(tab, slider, value):
    tab.evaluate(
        """([id, value]) => {
          const input = document.getElementById(id);
          input.value = value;
          input.dispatchEvent(new Event("input"));
        }""",
        [slider, value],
    )


def test_a_page_relights_a_view(lit, show):
    tab = show(lit)
    assert tab.locator("#relight code").all_inner_texts()[:2] == ["lamp", "World"]
    tab.locator("#lit[aria-busy=false]").wait_for()
    rendered = brightness(tab)
    # The viewer shows the same light, developed in the same way.
    assert min(rendered) > 20
    tab.locator("#light-only-0").click()
    lamp = brightness(tab)
    tab.locator("#light-only-1").click()
    world = brightness(tab)
    assert all(w < one < both for w, one, both in zip(world, lamp, rendered, strict=True))
    # Four times a quarter of the light is all of it.
    move(tab, "light-1", 4)
    np.testing.assert_allclose(brightness(tab), rendered, rtol=0.02)
    move(tab, "light-colour-1", "#ff0000")
    red, green, blue = brightness(tab)
    assert red == pytest.approx(rendered[0], rel=0.02) and green == blue == 0
    tab.locator("#lit-reset").click()
    np.testing.assert_allclose(brightness(tab), rendered, rtol=1e-6)


def test_a_page_without_light_groups_relights_nothing(sphere):
    text = sphere.page.read_text()
    assert 'id="lit"' not in text and "drawLit" not in text


PLANE = {
    "type": "plane",
    "cameras": [7, 5],
    "size": [0.6, 0, 0.4],
    "center": [0, -0.5, 0],
    "camera": {"lens": "rectilinear", "fov": 60, "resolution": [96, 72]},
}


FISHEYE_PLANE = PLANE | {"camera": {"lens": "equidistant", "fov": 120, "resolution": [96, 96]}}


@pytest.fixture(scope="module")
def focused(tmp_path_factory):
    """The page of a plane of cameras before a ball in a sphere, and the dataset's folder."""
    folder = tmp_path_factory.mktemp("results") / "ball" / "LFPlane"
    write_dataset(folder, PLANE, see=look_at_ball)
    return folder, make_page(folder, PLANE, name="ball/LFPlane")


@pytest.fixture(scope="module")
def focused_fisheye(tmp_path_factory):
    """The same through a fisheye, whose depth is the distance."""
    folder = tmp_path_factory.mktemp("results") / "ball" / "LFPlane"
    write_dataset(folder, FISHEYE_PLANE, see=look_at_ball)
    return folder, make_page(folder, FISHEYE_PLANE, name="ball/LFPlane")


def seen_by_pinhole(directions):
    """Return where views of PLANE see directions (..., 3): pixels' numbers down and across."""
    right, up, back = np.moveaxis(directions, -1, 0)
    focal = 48 / math.tan(math.radians(30))
    return 35.5 - focal * up / -back, 47.5 + focal * right / -back


def seen_by_fisheye(directions):
    """Return where views of FISHEYE_PLANE see directions. Its radius grows with the angle."""
    right, up, back = np.moveaxis(directions, -1, 0)
    aside = np.hypot(right, up)
    radius = 48 * np.arctan2(aside, -back) / math.radians(60) / aside
    return 47.5 - radius * up, 47.5 + radius * right


def refocused(folder, distance, size, tangent, seen):
    """Return the mean light of the views, in which a plane at a distance is sharp.

    The picture has this ``size``, and the ``tangent`` of half its angle across. ``seen`` returns
    where a view sees directions.
    """
    width, height = size
    step = 2 * tangent / width
    y, x = np.mgrid[:height, :width] + 0.5
    plane = np.stack([step * (x - width / 2), step * (height / 2 - y), -np.ones_like(x)], -1)
    total, count = np.zeros((height, width, 3)), np.zeros((height, width, 1))
    for view in LightField.read(folder / "lightfield.json").views:
        colour = images.read_image(folder / "exr" / f"{view.name}.exr").colour
        right, _, up = view.position - np.array(PLANE["center"])
        at = seen(distance * plane - [right, up, 0])
        ends = colour.shape[0] - 1, colour.shape[1] - 1
        inside = np.all([(a >= 0) & (a <= end) for a, end in zip(at, ends, strict=True)], axis=0)
        for channel in range(3):
            sampled = map_coordinates(colour[..., channel], at, order=1, mode="nearest")
            total[..., channel] += inside * sampled
        count += inside[..., np.newaxis]
    return total / count


@pytest.mark.parametrize(
    ("page_of", "size", "tangent", "seen"),
    [
        ("focused", (96, 72), math.tan(math.radians(30)), seen_by_pinhole),
        ("focused_fisheye", (96, 96), 1.0, seen_by_fisheye),
    ],
)
def test_the_page_of_a_plane_has_a_slider_of_the_focus(page_of, size, tangent, seen, request, show):
    folder, html = request.getfixturevalue(page_of)
    tab = show(html, width=1280)
    tab.locator("#focused[aria-busy=false]").wait_for()
    data = json.loads(tab.text_content("#data"))
    distances = data["focus"]["distances"]
    assert data["focus"]["size"] == [*size]
    # From the ball to the wall behind it, without the nearest and the farthest 1 %.
    assert len(distances) == 12
    assert 0.9 * (RADIUS + 0.5) < max(distances) < RADIUS + 0.5
    assert BALL[1] - BALL_RADIUS + 0.5 < min(distances) < 1.1 * (BALL[1] - BALL_RADIUS + 0.5)
    np.testing.assert_allclose(np.diff(1 / np.array(distances), 2), 0, atol=1e-3)
    light = light_of_codes(data)
    for number in (0, 6, 11):
        move(tab, "focus", number)
        written = tab.inner_text("#focus-value")
        assert written == tab.get_attribute("#focus", "aria-valuetext")
        assert float(written.removesuffix(" m")) == pytest.approx(distances[number], rel=0.01)
        codes = decoded(data["focus"]["pictures"][number])
        # Steps of light, the loss of the picture's file, and linear interpolation.
        expected = refocused(folder, distances[number], size, tangent, seen)
        assert np.abs(light[codes] - expected)[2:-2, 2:-2].mean() < 0.01
        shown = pixels(tab, "focused")[..., :3]
        developed = pictures.develop(np.float32(light[codes]), data["exposure"])
        assert np.abs(shown - developed.astype(int)).max() <= 1
    # The exposure chosen above applies here, too.
    before = pixels(tab, "focused")[..., :3].mean()
    move(tab, "exposure", 1)
    assert pixels(tab, "focused")[..., :3].mean() > before + 10


def light_of_codes(data):
    """Return the light of each code."""
    toe, highest = data["light"]
    return toe * np.expm1(np.arange(256) / 255 * math.log1p(highest / toe))


def test_the_focus_is_chosen_with_keys(focused, show):
    tab = show(focused[1], width=1280)
    tab.locator("#focused[aria-busy=false]").wait_for()
    before, distance = pixels(tab, "focused"), tab.inner_text("#focus-value")
    tab.focus("#focus")
    tab.keyboard.press("ArrowLeft")
    assert float(tab.inner_text("#focus-value").split()[0]) < float(distance.split()[0])
    assert (pixels(tab, "focused") != before).any()


@pytest.mark.parametrize("width", accessibility.WIDTHS)
def test_axe_finds_no_fault_in_a_page_with_a_focus(focused, show, width):
    tab = show(focused[1], width, walk_scale=SMALL_WALK)
    tab.locator("#focused[aria-busy=false]").wait_for()
    assert accessibility.faults(tab) == []


def test_the_page_of_another_rig_has_no_focus(sphere):
    text = sphere.page.read_text()
    assert 'id="focused"' not in text and "drawFocused" not in text and '"focus"' not in text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"),
        (-0.0, "0"),
        (0.00123456, "0.001235"),
        (0.0009, "9.00·10⁻⁴"),
        (9999.4, "9999"),
        (9999.6, "10000"),
        (12345, "12345"),
        (-42000.4, "-42000"),
        (99999.4, "99999"),
        (99999.6, "1.00·10⁵"),
        (123456, "1.23·10⁵"),
        (float("inf"), "∞"),
        (float("nan"), "–"),
    ],
)
def test_a_number_on_a_page_is_read_as_people_write_it(value, text):
    assert page.cell(value) == text
    assert page.cell(str(value)) == text
