"""The walk inside a light field in a real browser: what its canvas shows, and how the eye moves."""

import base64
import io
import math
import shutil
from functools import partial

import accessibility
import mirrors
import numpy as np
import pytest
from conftest import SMALL_WALK, error_listeners
from PIL import Image
from sphere import (
    BALL,
    BALL_RADIUS,
    RADIUS,
    look,
    look_at_ball,
    look_at_ball_alone,
    write_views,
)

from lightfield.core.errors import UserError
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses, rigs
from lightfield.geometry.depth import z_from_distance
from lightfield.imaging import pictures
from lightfield.reading.dataset import OpenDataset
from lightfield.stages.report import PageSettings, ReportHtml, ReportWalk
from lightfield.synthesis.view import Sources, reader

RIG = {
    "type": "sphere",
    "subdivisions": 2,
    "size": 1.0,
    "camera": {"lens": "equidistant", "fov": 180, "resolution": [128, 128]},
}
# Few small views, for what does not depend on them. A pixel is this wide, in radians.
SMALL_CAMERA = RIG["camera"] | {"resolution": [32, 32]}
SMALL_RIG = RIG | {"subdivisions": 1, "camera": SMALL_CAMERA}
SMALL_PIXEL = math.pi / 32
WIDTH, HEIGHT = 160, 90
EYE = {"lens": "rectilinear", "fov": 80, "resolution": [WIDTH, HEIGHT]}
VIEWS = 6


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The folder of a dataset of few small views, with a page."""
    folder = tmp_path_factory.mktemp("walk") / "dataset"
    written_page(folder, SMALL_CAMERA, SMALL_RIG, look_at_ball)
    return folder


@pytest.fixture
def show(show):
    """Open pages with their walks, as `show` of conftest.py does."""
    return partial(show, walk_scale=SMALL_WALK)


@pytest.fixture
def tab(small, show):
    """Return a function that opens the small page and waits until all its views are loaded.

    Its pictures are small from then on.
    """

    def tab(**options):
        tab = show(small / "index.html", **options)
        wait(tab)
        tab.evaluate("(size) => walk.size = size", [WIDTH, HEIGHT])
        return tab

    return tab


@pytest.fixture(scope="module")
def open_page(small, browser):
    """The small page with all its views, and the list of its errors. It is loaded only once."""
    page = browser.new_page()
    page.add_init_script(f"devicePixelRatio = {SMALL_WALK}")
    errors = []
    for event, listener in error_listeners(errors).items():
        page.on(event, listener)
    page.goto((small / "index.html").as_uri())
    wait(page)
    yield page, errors
    page.context.close()


@pytest.fixture
def shared_tab(open_page):
    """Return a function that shows the small page at the start of the walk.

    It does not load the page again. It suits tests that change only the walk's state, and the
    width of the window.
    """
    page, errors = open_page

    def shared_tab(width=600):
        page.set_viewport_size({"width": width, "height": 900})
        page.evaluate(
            """async (size) => {
                history.replaceState(null, "", location.pathname);
                scrollTo(0, 0);
                // The walk follows the window's size after the next picture.
                for (let picture = 0; picture < 2; picture++) {
                    await new Promise(requestAnimationFrame);
                }
                showMode(0);
                goHome();
                Object.assign(walk, { size, sources: MOST_SOURCES, slow: true, lastChoice: null });
            }""",
            [WIDTH, HEIGHT],
        )
        return page

    yield shared_tab
    assert not errors


def wait(tab):
    for _ in range(300):
        if tab.evaluate("Boolean(walk.frames && walk.order.every((source) => source.isLoaded))"):
            return
        tab.wait_for_timeout(100)
    raise AssertionError("the walk did not begin")


def written_page(folder, camera, rig, see):
    """Write views and their page into a folder. Return the page's path."""
    write_views(folder, camera, rig, see=see)
    field = LightField.read(folder / "lightfield.json")
    field.changed(frame=1, scene={"name": "ball"}, render={"samples": 1}).write(field.path)
    rig = rigs.from_settings(rig | {"camera": camera})
    return make_page(folder, rig, "ball/sphere", folder / "index.html")


def make_page(folder, rig, name, output):
    settings = PageSettings(rig=rig, yaml="", command="snakemake")
    ReportHtml(settings=settings, dataset=folder, dataset_name=name, output=output).run()
    return output


def points_of_sphere(lens, matrix, radius):
    """Return the points that a camera in a sphere sees of it, and their distances."""
    rays = lens.pixel_rays() @ matrix[:3, :3].T
    along = (rays * matrix[:3, 3]).sum(axis=-1)
    distance = -along + np.sqrt(along**2 + radius**2 - matrix[:3, 3] @ matrix[:3, 3])
    return matrix[:3, 3] + rays * distance[..., None], distance


def look_at_leaves(lens, matrix):
    """Return what a camera sees of a sphere behind thousands of small leaves."""
    colour, distance = look(lens, matrix)
    points, near = points_of_sphere(lens, matrix, RADIUS / 2)
    has_leaf = np.sin(60 * points).prod(axis=-1) > 0.1
    leaves = np.nan_to_num(0.3 + 0.1 * np.sin(2 * points))
    return np.where(has_leaf[..., None], leaves, colour), np.where(has_leaf, near, distance)


def look_from(tab, place, yaw, pitch, is_in_motion=False, is_zoomed_out=False):
    """Return the canvas from a place (HEIGHT, WIDTH, 3) in sRGB from 0 to 1.

    In motion the canvas has a part of the pixels, so that the walk is larger. Zoomed out, it has
    the field of view of `EYE`, also for views through a narrower lens.
    """
    factor = 3 if is_in_motion else 1
    uri = tab.evaluate(
        """([at, yaw, pitch, width, height, isInMotion, isZoomedOut]) => {
            walk.size = [width, height];
            Object.assign(walk, { at, yaw, pitch });
            if (isZoomedOut) zoomBy(0);
            drawWalk(isInMotion);
            return walk.canvas.toDataURL("image/png");
        }""",
        [place, yaw, pitch, factor * WIDTH, factor * HEIGHT, is_in_motion, is_zoomed_out],
    )
    picture = Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))).convert("RGB")
    return np.asarray(picture.resize((WIDTH, HEIGHT))) / 255


def matrix_of(place, yaw, pitch):
    """Return the eye's camera-to-world. Yaw turns it left of +Y, pitch turns it up."""
    back = -np.array(
        [-math.sin(yaw) * math.cos(pitch), math.cos(yaw) * math.cos(pitch), math.sin(pitch)]
    )
    right = np.array([math.cos(yaw), math.sin(yaw), 0])
    matrix = np.eye(4)
    matrix[:3, :4] = np.column_stack([right, np.cross(back, right), back, place])
    return matrix


def psnr(first, second):
    return -10 * math.log10(((first - second) ** 2).mean())


def test_the_canvas_equals_the_synthesis_and_the_truth(tmp_path, show):
    folder = tmp_path / "dataset"
    opened = show(written_page(folder, RIG["camera"], RIG, look_at_ball))
    wait(opened)
    exposure = opened.evaluate("viewer.exposure")
    source, lens = OpenDataset.in_folder(folder), lenses.from_camera(EYE)
    field = Sources(source.lens, source.lightfield.views, reader(source), most=99)
    random = np.random.default_rng(3)
    for _ in range(10):
        place = random.uniform(-0.15, 0.15, 3)
        yaw, pitch = random.uniform(-math.pi, math.pi), random.uniform(-0.8, 0.8)
        shown = look_from(opened, place.tolist(), yaw, pitch)
        matrix = matrix_of(place, yaw, pitch)
        made = field.synthesise(matrix, lens, VIEWS)
        true, _ = look_at_ball(lens, matrix)
        expected, truth = (
            pictures.develop(np.nan_to_num(c).astype(np.float32), exposure) / 255
            for c in (made.colour, true)
        )
        assert psnr(shown, expected) >= 35
        assert psnr(shown, truth) >= 28


def test_the_canvas_shows_what_is_in_a_mirror(tmp_path, show):
    rig = {"type": "plane", "cameras": [3, 3], "size": 0.6}
    folder = tmp_path / "dataset"
    opened = show(written_page(folder, mirrors.CAMERA, rig, mirrors.see_framed_mirror))
    wait(opened)
    source, lens = OpenDataset.in_folder(folder), lenses.from_camera(EYE)
    field = Sources(source.lens, source.lightfield.views, reader(source), most=99)
    place = [0.14, 0, -0.16]
    shown = look_from(opened, place, 0, 0, is_zoomed_out=True)
    matrix = matrix_of(place, 0, 0)
    true, _ = mirrors.see_framed_mirror(lens, matrix)
    exposure = opened.evaluate("viewer.exposure")
    expected, truth = (
        pictures.develop(np.nan_to_num(c).astype(np.float32), exposure) / 255
        for c in (field.synthesise(matrix, lens, VIEWS).colour, true)
    )
    # A reflection that stays where its glass is gives 26 dB.
    assert psnr(shown, expected) >= 35
    assert psnr(shown, truth) >= 30


@pytest.fixture
def alone(small, tmp_path):
    """The walk of the small page as a file of its own."""
    output = tmp_path / "walk.html"
    ReportWalk(page=small / "index.html", output=output).run()
    return output


def test_the_walk_alone_shows_what_the_page_shows(small, alone, show, shared_tab):
    assert alone.stat().st_size < (small / "index.html").stat().st_size
    place, yaw, pitch = [0.1, -0.05, 0.1], 0.3, -0.1
    on_page = look_from(shared_tab(), place, yaw, pitch)
    opened = show(alone)
    wait(opened)
    assert opened.title() == "ball/sphere"
    assert (look_from(opened, place, yaw, pitch) == on_page).all()
    # The exposure changes the picture, as on the page.
    opened.evaluate(
        "element('exposure').value = 1; element('exposure').dispatchEvent(new Event('input'))"
    )
    assert look_from(opened, place, yaw, pitch).mean() > 1.2 * on_page.mean()
    opened.locator("#walk-overlay").focus()
    opened.keyboard.press("w")


@pytest.mark.parametrize("width", accessibility.WIDTHS)
def test_axe_finds_no_fault_in_the_walk_alone(alone, show, width):
    opened = show(alone, width=width)
    wait(opened)
    assert accessibility.faults(opened) == []
    assert opened.evaluate("document.documentElement.scrollWidth") <= width


def test_only_a_page_with_a_walk_has_a_walk_of_its_own(tmp_path):
    other = tmp_path / "other.html"
    other.write_text("<title>another page</title>")
    with pytest.raises(UserError, match="is no page of a dataset"):
        ReportWalk(page=other, output=tmp_path / "walk.html").run()
    other.write_text(
        '<title>a/b</title><script type="application/json" id="data">{"walk": null}</script>'
    )
    with pytest.raises(UserError, match="no depth"):
        ReportWalk(page=other, output=tmp_path / "walk.html").run()
    assert not (tmp_path / "walk.html").exists()


def test_the_eye_moves_by_keys_mouse_and_touch(tab):
    opened = tab(has_touch=True)
    state = "[...walk.at, walk.yaw, walk.pitch]"
    home = opened.evaluate(state)
    overlay = opened.locator("#walk-overlay")
    overlay.scroll_into_view_if_needed()
    overlay.focus()
    opened.evaluate("walk.yaw = 0")
    for key, axis in (("w", 1), ("d", 0), ("e", 2)):
        before = opened.evaluate(state)
        opened.keyboard.down(key)
        for _ in range(100):
            if opened.evaluate(state)[axis] > before[axis]:
                break
            opened.wait_for_timeout(100)
        opened.keyboard.up(key)
        assert opened.evaluate(state)[axis] > before[axis]
    box = overlay.bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    opened.mouse.move(*middle)
    opened.mouse.down()
    opened.mouse.move(middle[0] + 60, middle[1] + 30)
    opened.mouse.up()
    turned = opened.evaluate(state)
    assert turned[3] != home[3]
    assert turned[4] != home[4]
    opened.locator("#walk-home").tap()
    assert opened.evaluate(state) == home


def test_a_shortcut_of_the_browser_moves_nothing(tab):
    opened = tab()
    opened.locator("#walk-overlay").focus()
    opened.evaluate(
        "addEventListener('keydown', (event) => { window.isTaken = event.defaultPrevented; })"
    )
    for shortcut in ("Control+a", "Control+-", "Meta+d", "Alt+w"):
        opened.keyboard.press(shortcut)
        assert opened.evaluate("window.isTaken") is False
        assert opened.evaluate("walk.keys.size") == 0
    opened.keyboard.press("w")
    assert opened.evaluate("window.isTaken") is True


def test_a_key_released_after_shift_does_not_stick(shared_tab):
    opened = shared_tab()
    opened.locator("#walk-overlay").focus()
    key = """([type, key]) => walk.overlay.dispatchEvent(
        new KeyboardEvent(type, { key, code: "Equal", bubbles: true }))"""
    opened.evaluate(key, ["keydown", "+"])
    assert opened.evaluate("walk.keys.size") == 1
    opened.evaluate(key, ["keyup", "="])
    assert opened.evaluate("walk.keys.size") == 0


def test_a_key_pressed_twice_between_two_pictures_moves_no_faster(shared_tab):
    opened = shared_tab()
    parts_of_extent = opened.evaluate(
        """() => {
            const scheduled = [];
            const request = window.requestAnimationFrame;
            window.requestAnimationFrame = (draw) => scheduled.push(draw);
            const before = walk.at;
            for (const name of ["keydown", "keyup", "keydown"]) {
                walk.overlay.dispatchEvent(new KeyboardEvent(name, { key: "d", code: "KeyD" }));
            }
            for (const draw of scheduled.splice(0)) draw(performance.now() + 50);
            window.requestAnimationFrame = request;
            walk.keys.clear();
            return Math.hypot(...minus(walk.at, before)) / walk.extent;
        }"""
    )
    # 0.6 times the extent in a second.
    assert parts_of_extent == pytest.approx(0.6 * 0.05, rel=0.3)


@pytest.mark.parametrize("canvas", ["walk-overlay", "rig"])
def test_the_wheel_scrolls_the_page_until_a_picture_is_clicked(tab, canvas):
    opened = tab()
    opened.evaluate("(name) => element(name).scrollIntoView({ block: 'center' })", canvas)
    opened.locator(f"#{canvas}").hover()
    state = "[scrollY, ...walk.at, rig.zoom]"
    before = opened.evaluate(state)
    opened.mouse.wheel(0, -100)
    opened.wait_for_timeout(500)
    scrolled = opened.evaluate(state)
    assert scrolled[0] < before[0]
    assert scrolled[1:] == before[1:]
    opened.locator(f"#{canvas}").focus()
    opened.mouse.wheel(0, -100)
    opened.wait_for_timeout(500)
    moved = opened.evaluate(state)
    assert moved[0] == scrolled[0]
    assert moved[1:] != scrolled[1:]


def test_the_walk_goes_on_after_the_graphics_card_was_lost(tab):
    opened = tab()
    before = look_from(opened, [0, 0, 0], 0, 0)
    opened.evaluate(
        "window.context = walk.gl.getExtension('WEBGL_lose_context'), context.loseContext()"
    )
    status = opened.locator("#walk-status")
    status.wait_for()
    assert "continue" in status.inner_text()
    opened.evaluate("context.restoreContext()")
    status.wait_for(state="hidden")
    wait(opened)
    assert (look_from(opened, [0, 0, 0], 0, 0) == before).all()


def test_a_browser_without_webgl_2_says_so(small, show):
    opened = show(small / "index.html", walk_scale=0)
    assert "WebGL 2" in opened.locator("#walk-status").inner_text()
    assert opened.locator("#walk-controls").is_hidden()


NARROW = {"lens": "rectilinear", "fov": 50, "resolution": [48, 48]}
AROUND = {"size": 3.0, "center": BALL.tolist(), "camera": NARROW}
DOWN = {"type": "plane", "cameras": [3, 3], "size": 0.5, "rotation": [-90, 0, 0]}
# None of its axes lies along an axis of the world, so its places are in a plane but for rounding.
TILTED = {"type": "plane", "cameras": [9, 9], "size": 0.6, "rotation": [17, 11, 23]}


@pytest.mark.parametrize(
    "rig",
    [
        AROUND | {"type": "hemisphere", "count": 6},
        AROUND | {"type": "hemisphere", "count": 8},
        AROUND | {"type": "hemisphere", "count": 12},
        AROUND | {"type": "ring", "count": 8},
        DOWN | {"center": [0, 1.8, 1.5]},
        TILTED | {"look_at": BALL.tolist()},
    ],
    ids=["hemisphere of 6", "hemisphere of 8", "hemisphere of 12", "ring", "from above", "tilted"],
)
def test_the_walk_begins_where_the_cameras_see_most(tmp_path, show, rig):
    page = written_page(tmp_path / "dataset", NARROW, rig, look_at_ball_alone)
    opened = show(page)
    wait(opened)
    at, yaw, pitch = opened.evaluate("[walk.at, walk.yaw, walk.pitch]")
    shown = look_from(opened, at, yaw, pitch)
    # The ball is in the middle of the picture, red, and not faded as at the volume's edge.
    middle = shown[HEIGHT // 2, WIDTH // 2]
    assert middle[0] > 0.5
    assert middle[0] > 2 * middle[1]
    assert opened.evaluate("metresToEdge(walk.at)") > 0
    # The lens sees 50 degrees. A picture of 80 would be filled from its surroundings.
    opened.locator("#walk-holes").click()
    holes = look_from(opened, at, yaw, pitch)
    assert (holes[..., 0] > holes[..., 1] + 0.3).mean() < 0.03


def test_the_eye_can_walk_off_a_tilted_plane(tmp_path, show):
    opened = show(written_page(tmp_path / "dataset", NARROW, TILTED, look))
    wait(opened)
    opened.evaluate("walk.before = walk.at, moveEye(0.05, 0, 0)")
    assert opened.evaluate("Math.hypot(...minus(walk.at, walk.before))") == pytest.approx(
        0.05 * opened.evaluate("walk.extent"), rel=0.01
    )
    # But not away from all cameras.
    opened.evaluate("moveEye(5, 0, 0)")
    assert opened.evaluate("Math.hypot(...minus(walk.at, walk.before))") < 0.6


def test_the_eye_stays_inside_the_volume(shared_tab):
    opened = shared_tab()
    opened.evaluate("moveEye(5, 0, 0)")
    assert -1e-6 < opened.evaluate("metresToEdge(walk.at)") < 0.01
    assert "m to the edge" in opened.locator("#walk-readout").inner_text()


def test_another_frame_of_a_sequence_keeps_the_eyes_place(small, show, tmp_path):
    rig = rigs.from_settings(SMALL_RIG | {"frames": {"first": 1, "last": 17, "step": 8}})
    for name in rig.sequence.folders:
        folder = tmp_path / "ball" / name
        shutil.copytree(small, folder)
        make_page(folder, rig, f"ball/{name}", folder / "report/index.html")
    opened = show(tmp_path / "ball/f00001/report/index.html")
    wait(opened)
    link = opened.get_by_role("link", name="Sequence")
    assert link.get_attribute("href") == "../../report/sequence.html"
    slider = opened.locator("#walk-frame")
    assert [slider.get_attribute(key) for key in ("max", "value")] == ["2", "0"]
    opened.locator("#walk-depth").click()
    opened.evaluate("Object.assign(walk, { yaw: 1.25, pitch: -0.5 }), moveEye(0.05, 0.02, 0)")
    before = opened.evaluate("[...walk.at, walk.yaw, walk.pitch, walk.mode]")
    slider.focus()
    with opened.expect_navigation():
        opened.keyboard.press("ArrowRight")
    wait(opened)
    assert "/f00009/report/" in opened.url
    after = opened.evaluate("[...walk.at, walk.yaw, walk.pitch, walk.mode]")
    assert after == pytest.approx(before, abs=1e-9)
    assert opened.locator("#walk-depth").get_attribute("aria-pressed") == "true"
    assert opened.locator("#walk-frame").input_value() == "1"
    opened.go_back()
    wait(opened)
    assert opened.locator("#walk-frame").input_value() == "0"


def test_an_invalid_place_leads_to_the_start(shared_tab):
    opened = shared_tab()
    state = "[...walk.at, walk.yaw, walk.pitch, walk.mode]"
    home = opened.evaluate(state)
    go = f"(place) => {{ location.hash = place; restorePlace(); return {state}; }}"
    for place in ("", "walk=", "walk=1,a,3,0,0,0", "walk=0,0,0,0,0,9", "walk=0,0,0,0,0,0.5"):
        assert opened.evaluate(go, place) == home
    # The address cannot lead outside the volume either.
    opened.evaluate(go, "walk=9,0,0,0.5,0.2,1")
    assert -1e-6 < opened.evaluate("metresToEdge(walk.at)") < 0.01
    assert opened.evaluate("[walk.yaw, walk.pitch, walk.mode]") == [0.5, 0.2, 1]


def test_slow_pictures_in_motion_use_few_views(tab):
    opened = tab()
    opened.evaluate("clearTimeout(walk.rest)")
    opened.evaluate(
        """() => {
            const draw = drawWalk;
            window.counts = [];
            drawWalk = (...words) => { draw(...words); window.counts.push(walk.chosen.length); };
            walk.slow = true;
            turnEye(0.1, 0);
        }"""
    )
    for _ in range(100):
        if len(counts := opened.evaluate("window.counts")) == 2:
            break
        opened.wait_for_timeout(100)
    assert counts == [2, VIEWS]


def test_pictures_in_motion_have_hardly_more_holes_than_standing_ones(shared_tab):
    opened = shared_tab()
    opened.evaluate("walk.mode = MODES.indexOf('holes')")
    random = np.random.default_rng(5)
    holes = {True: 0.0, False: 0.0}
    for _ in range(12):
        place = random.uniform(-0.35, 0.35, 3).tolist()
        yaw, pitch = random.uniform(-math.pi, math.pi), random.uniform(-0.8, 0.8)
        for is_in_motion in holes:
            shown = look_from(opened, place, yaw, pitch, is_in_motion)
            # Holes are pink, all else is grey.
            holes[is_in_motion] += (shown[..., 0] > shown[..., 1] + 0.3).mean() / 12
    assert holes[True] < holes[False] + 0.005


# So large that a picture in motion uses every second pixel across and down.
LARGE = {"lens": "equidistant", "fov": 180, "resolution": [320, 320]}


def test_a_picture_in_motion_of_large_views_has_few_triangles(tmp_path, show):
    rig = {"type": "plane", "cameras": [2, 2], "size": 0.4}
    opened = show(written_page(tmp_path / "dataset", LARGE, rig, look_at_leaves))
    wait(opened)
    place, yaw, pitch = [0.05, 0, 0.05], 0.2, -0.1
    still = look_from(opened, place, yaw, pitch)
    moving = look_from(opened, place, yaw, pitch, is_in_motion=True)
    assert psnr(moving, still) >= 30
    counts = opened.evaluate(
        "walk.order.map(({ coarse, points }) => [coarse.count / 3, points.count])"
    )
    for triangles, points in counts:
        assert 0 < triangles + points < 320**2 / 2


@pytest.mark.parametrize("mode", ["depth", "holes", "sources"])
def test_other_modes_show_something_else(shared_tab, mode):
    opened = shared_tab()
    colour = look_from(opened, [0, 0, 0], 0, 0)
    opened.locator(f"#walk-{mode}").click()
    other = look_from(opened, [0, 0, 0], 0, 0)
    assert np.abs(other - colour).mean() > 0.02
    if mode == "depth":
        # The ball, ahead, is nearer than its surroundings.
        assert np.abs(other[HEIGHT // 2, WIDTH // 2] - other[HEIGHT // 2, 5]).max() > 0.1


def press(opened, name):
    """Press the walk's button with a name."""
    opened.locator("#walk-controls").get_by_role("button", name=name, exact=True).click()


def picture_of(opened, canvas):
    """Return the pixels (h, w, 3), 0 to 255, of the canvas with an id."""
    uri = opened.evaluate("(id) => element(id).toDataURL('image/png')", canvas)
    picture = Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2])))
    return np.asarray(picture.convert("RGB"), int)


def palette_of(opened):
    """Return the colours (256, 3), 0 to 255, of the page's scale of depths, from near to far."""
    (palette,) = picture_of(opened, "depth-bar")
    return palette


def scale_colour(opened, depth):
    """Return the colour of a depth on the page's scale, which has its numbers below it."""
    texts = opened.locator("#depth-ticks span").all_text_contents()
    ticks = [float(text.split()[0]) for text in texts]
    assert ticks == sorted(ticks)
    place = np.interp(np.log(depth), np.log(ticks), np.linspace(0, 255, len(ticks)))
    return palette_of(opened)[np.rint(np.nan_to_num(place)).astype(int)]


def test_depth_has_the_colours_of_the_pages_scale(shared_tab):
    opened = shared_tab()
    press(opened, "Depth")
    # The ball is ahead of the middle of the rig, and the sphere behind it.
    for yaw, distance in ((0, BALL[1] - BALL_RADIUS), (math.pi, RADIUS)):
        middle = look_from(opened, [0, 0, 0], yaw, 0)[HEIGHT // 2, WIDTH // 2]
        np.testing.assert_allclose(255 * middle, scale_colour(opened, distance), atol=8)


def test_the_open_view_has_the_colours_of_the_pages_scale_of_depths(tab, small):
    opened = tab()
    opened.click("#show-depth")
    name = opened.inner_text("#view-name")
    (view,) = (v for v in LightField.read(small / "lightfield.json").views if v.name == name)
    lens = lenses.from_camera(SMALL_CAMERA)
    _, distance = look_at_ball(lens, view.world_from_camera)
    expected = scale_colour(opened, z_from_distance(distance, lens.pixel_rays()))
    off = np.abs(picture_of(opened, "viewer") - expected).max(axis=-1)
    assert off.shape == (32, 32)
    assert (off[np.isfinite(distance)] < 8).mean() > 0.95


def test_holes_are_pink_and_sources_have_the_colour_of_their_number(tmp_path, show):
    rig = {"type": "plane", "cameras": [2, 2], "size": 0.2}
    opened = show(written_page(tmp_path / "dataset", NARROW, rig, look))
    wait(opened)
    at = opened.evaluate("walk.at")
    palette = palette_of(opened)
    # The eye sees more than the views. They all show the middle, and nothing of what is behind.
    press(opened, "Holes")
    holes = look_from(opened, at, 0, 0, is_zoomed_out=True)
    assert np.ptp(holes[HEIGHT // 2, WIDTH // 2]) < 0.02
    assert holes[2, 2] == pytest.approx([1, 0, 0.8], abs=0.01)
    assert look_from(opened, at, math.pi, 0).reshape(-1, 3) == pytest.approx(
        np.tile([1, 0, 0.8], (WIDTH * HEIGHT, 1)), abs=0.01
    )
    press(opened, "Sources")
    sources = look_from(opened, at, 0, 0, is_zoomed_out=True)
    assert 255 * sources[HEIGHT // 2, WIDTH // 2] == pytest.approx(palette[-1], abs=4)
    assert sources[2, 2] == pytest.approx([0, 0, 0], abs=0.01)
    # Near the edge of what the views show, fewer of them show it.
    row = 255 * sources[HEIGHT // 2]
    assert (np.abs(row[:, None] - palette[100:160]).max(axis=-1) < 8).any()


def test_a_thousand_frames_leak_nothing(shared_tab):
    opened = shared_tab()
    look_from(opened, [0, 0, 0], 0, 0)
    walk_on = """(frames) => {
        walk.size = [32, 18];
        walk.sources = 1;
        for (let frame = 0; frame < frames; frame++) {
            walk.yaw += 0.02;
            drawWalk();
        }
        walk.gl.finish();
        gc();
        return [performance.memory.usedJSHeapSize, walk.gl.getError()];
    }"""
    before, _ = opened.evaluate(walk_on, 100)
    after, problem = opened.evaluate(walk_on, 1000)
    assert problem == 0
    assert after < before + 2e6


def test_a_phone_shows_the_walk(shared_tab):
    opened = shared_tab(width=390)
    box = opened.locator("#walk-overlay").bounding_box()
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= 390
    assert opened.evaluate("document.documentElement.scrollWidth") <= 390


def test_two_fingers_that_part_zoom_without_walking(tab):
    opened = tab(width=390, has_touch=True, is_mobile=True)
    opened.evaluate("walk.overlay.scrollIntoView({ block: 'center' })")
    box = opened.locator("#walk-overlay").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    touch = opened.context.new_cdp_session(opened)

    def send(kind, *places):
        points = [{"x": x + place, "y": y, "id": id} for id, place in enumerate(places)]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    before = opened.evaluate("[walk.zoom, ...walk.at]")
    send("touchStart", -30, 30)
    for part in range(34, 94, 4):
        send("touchMove", -part, part)
    send("touchEnd")
    zoom, *at = opened.evaluate("[walk.zoom, ...walk.at]")
    # The browser needs a few pixels to tell a touch from a drag.
    assert zoom == pytest.approx(3, rel=0.1)
    assert at == pytest.approx(before[1:], abs=1e-6)
    assert opened.locator(".for-fingers").is_visible()
    assert not opened.locator(".for-keys").is_visible()


@pytest.mark.parametrize("width", accessibility.WIDTHS)
def test_axe_finds_no_fault_in_a_page_with_a_walk(shared_tab, width):
    assert accessibility.faults(shared_tab(width=width)) == []


def test_views_are_chosen_again_only_after_the_eye_has_moved(shared_tab):
    opened = shared_tab()
    opened.evaluate("clearTimeout(walk.rest)")
    count = """(moves) => {
        drawWalk();
        const before = walk.choices;
        for (const [yaw, isInMotion] of moves) {
            walk.yaw += yaw;
            drawWalk(isInMotion);
        }
        return walk.choices - before;
    }"""
    assert opened.evaluate(count, [[0, False], [0, False]]) == 0
    assert opened.evaluate(count, [[0.001, False]]) == 1
    # The first picture in motion uses fewer views.
    assert opened.evaluate(count, [[0.001, True], [0.001, True], [0.001, True]]) == 1
    assert opened.evaluate(count, [[0.1, True], [0.1, True]]) == 2


@pytest.mark.parametrize(("width", "widest"), [(40, 80), (75, 120), (2000, 120)])
def test_the_default_field_of_view_keeps_source_pixels_small(shared_tab, width, widest):
    opened = shared_tab()
    wide = opened.evaluate("(width) => fieldOfView(width, width / 2)", width)
    assert math.radians(80) - 1e-9 <= wide <= math.radians(widest) + 1e-9
    pixels = width / 2 / math.tan(wide / 2) * SMALL_PIXEL
    assert pixels <= 3 + 1e-6 or wide == pytest.approx(math.radians(120))


def test_a_narrow_lens_begins_at_its_own_field_of_view(tmp_path, show):
    opened = show(written_page(tmp_path / "dataset", NARROW, DOWN, look))
    wait(opened)
    wide = "2 * Math.atan(1 / scales(160, 90)[0])"
    assert opened.evaluate(wide) == pytest.approx(math.radians(50))
    # A user may still look at more than the lens sees.
    opened.evaluate("zoomBy(0.01)")
    assert opened.evaluate(wide) == pytest.approx(math.radians(80))


def test_keys_zoom_in_and_back(shared_tab):
    opened = shared_tab()
    before = opened.evaluate("scales(160, 90)")
    opened.evaluate("zoomBy(2)")
    assert opened.evaluate("scales(160, 90)") == pytest.approx([2 * scale for scale in before])
    opened.evaluate("zoomBy(0.01)")
    assert opened.evaluate("scales(160, 90)") == pytest.approx(before)
