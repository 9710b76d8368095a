"""The page of a sequence in a real browser: it shows and plays all frames, and leads to theirs."""

import shutil

import accessibility
import numpy as np
import pytest
from sphere import write_views
from test_report_html import pixels

from lightfield.configuration.shown_look import ShownLook
from lightfield.core.files import write_json
from lightfield.formats.lightfield import LightField
from lightfield.geometry import rigs
from lightfield.imaging import images
from lightfield.imaging.look import Look
from lightfield.imaging.pictures import develop, exposure_for
from lightfield.report import sequence_page
from lightfield.stages.report import ReportSequence, SequenceSettings

CAMERA = {"lens": "rectilinear", "fov": 70, "resolution": [64, 48]}
FRAMES = ["f00001", "f00009", "f00017"]
# Linear light, a colour for each frame.
LIGHT = [(0.8, 0.1, 0.1), (0.1, 0.4, 0.1), (0.05, 0.05, 0.2)]
RIG = {
    "type": "plane",
    "cameras": [3, 1],
    "size": [2, 1, 1],
    "camera": CAMERA,
    "frames": {"first": 1, "last": 17, "step": 8},
}


def view_of(colour):
    """Return what a camera at x sees of a frame: the frame's colour, brighter to the right."""

    def see(lens, matrix):
        shape = (lens.height, lens.width)
        return np.full((*shape, 3), colour) * (1 + matrix[0, 3] / 2), np.full(shape, 2.0)

    return see


def write_sequence(rig_folder, rig=RIG):
    settings = rigs.from_settings(rig)
    for name, colour in zip(FRAMES, LIGHT, strict=True):
        write_views(rig_folder / name / "dataset", rig["camera"], settings, see=view_of(colour))
        folder = rig_folder / name
        for path in (folder / "dataset").iterdir():
            path.rename(folder / path.name)
        (folder / "dataset").rmdir()
        lightfield = LightField.read(folder / "lightfield.json")
        lightfield.changed(frame=int(name[1:])).write(lightfield.path)
        write_json(folder / "validation.json", {"valid": True, "checks": []})
        (folder / "report").mkdir()
        (folder / "report/index.html").write_text(f"<title>{name}</title>")
    return rig_folder


def make_page(rig_folder, rig=RIG, look=None):
    output = rig_folder / "report/sequence.html"
    settings = SequenceSettings.of(frames=FRAMES, rig=rigs.from_settings(rig), look=look)
    ReportSequence(settings=settings, rig=rig_folder, rig_name="ball/moving", output=output).run()
    return output


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    folder = write_sequence(tmp_path_factory.mktemp("results") / "ball/moving")
    make_page(folder)
    return folder


def light_of(folder):
    """Return the light of all views (frame, view, 3): each view has one colour."""
    views = ("view_0000f", "view_0001f", "view_0002f")
    files = [[folder / frame / "exr" / f"{view}.exr" for view in views] for frame in FRAMES]
    return np.array([[images.read_image(file).colour[0, 0] for file in row] for row in files])


def shown(tab):
    """Return the colour in the middle of the player."""
    return pixels(tab, "player")[24, 32, :3]


def expected(folder, look=None):
    """Return the pixels of all views (frame, view, 3) at one exposure."""
    light = light_of(folder).astype(np.float32)
    return develop(light, exposure_for(light, look), look).astype(int)


def test_each_frame_is_shown_at_one_exposure_and_leads_to_its_page(sequence, show):
    tab = show(sequence / "report/sequence.html")
    colours = expected(sequence)
    cards = tab.locator("#frames a")
    assert cards.locator("h3").all_inner_texts() == FRAMES
    for number, name in enumerate(FRAMES):
        assert tab.inner_text("#frame-name") == name
        assert (
            tab.get_attribute("#frames a[aria-current]", "href") == f"../{name}/report/index.html"
        )
        assert np.abs(shown(tab) - colours[number, 1]).max() <= 4
        tab.click("#forward")
    # The last one leads to the first.
    assert tab.inner_text("#frame-name") == FRAMES[0]
    tab.click("#back")
    tab.click("#frame-link")
    assert tab.title() == FRAMES[-1]
    facts = show(sequence / "report/sequence.html").inner_text(".facts")
    assert "3 (1 to 17, every 8)" in facts


def test_the_keyboard_plays_and_stops_the_sequence(sequence, show):
    tab = show(sequence / "report/sequence.html")
    tab.evaluate("document.getElementById('rate').value = 24")
    tab.focus("#play")
    tab.keyboard.press("Space")
    assert tab.inner_text("#play") == "Pause"
    tab.wait_for_function(
        """() => {
          window.seen ??= new Set();
          seen.add(document.getElementById("frame-name").textContent);
          return seen.size === 3;
        }"""
    )
    tab.keyboard.press("Enter")
    assert tab.inner_text("#play") == "Play"
    stopped = tab.inner_text("#frame-name")
    tab.wait_for_timeout(150)
    assert tab.inner_text("#frame-name") == stopped
    # The slider chooses a frame, and stops a sequence that plays.
    tab.keyboard.press("Space")
    tab.focus("#frame")
    tab.keyboard.press("Home")
    tab.keyboard.press("End")
    assert tab.inner_text("#play") == "Play"
    assert tab.inner_text("#frame-name") == FRAMES[2]
    tab.keyboard.press("ArrowLeft")
    assert tab.inner_text("#frame-name") == FRAMES[1]


def test_another_camera_of_the_rig_can_be_chosen(sequence, show):
    tab = show(sequence / "report/sequence.html")
    colours = expected(sequence)
    choice = tab.get_by_label("Camera")
    assert choice.input_value() == "1"
    for number in (0, 2, 1):
        choice.select_option(str(number))
        tab.click("#forward")
        frame = FRAMES.index(tab.inner_text("#frame-name"))
        tab.wait_for_timeout(100)
        assert np.abs(shown(tab) - colours[frame, number]).max() <= 4


def test_the_page_of_a_sequence_has_its_look(tmp_path, show):
    folder = write_sequence(tmp_path / "ball/moving")
    output = make_page(folder, look=ShownLook(name="AgX - Punchy", exposure=0.5))
    colours = expected(folder, Look.of("AgX - Punchy", 0.5))
    assert np.abs(shown(show(output)) - colours[0, 1]).max() <= 4


@pytest.mark.parametrize("width", accessibility.WIDTHS)
def test_axe_finds_no_fault_in_the_page_of_a_sequence(sequence, show, width):
    assert accessibility.faults(show(sequence / "report/sequence.html", width)) == []


def test_frames_that_are_not_valid_are_marked(tmp_path, show):
    folder = write_sequence(tmp_path / "ball/moving")
    write_json(folder / "f00009/validation.json", {"valid": False, "checks": []})
    (folder / "f00017/validation.json").unlink()
    tab = show(make_page(folder))
    assert tab.inner_text("header .badge") == "2 of 3 frames not valid"
    assert tab.locator("#frames .badge").all_inner_texts() == ["not valid", "not validated"]


def test_the_index_has_one_card_of_a_sequence(sequence, run_program, show, tmp_path):
    results = tmp_path / "results"
    shutil.copytree(sequence.parents[1], results)
    run_program("report_index.py", "--results", results, "--output", results / "index.html")
    tab = show(results / "index.html")
    assert tab.locator(".cards li").count() == 1
    card = tab.inner_text(".cards li")
    assert "Sequence of 3 frames, 9 views" in card
    assert "valid" in card
    tab.click(".cards a")
    assert tab.inner_text("h1").replace(" ", "") == "ball/moving"
    tab.click(".home")
    assert tab.url == (results / "index.html").as_uri()


@pytest.mark.parametrize(
    ("views", "frames", "expected"),
    [(1, 2, [0]), (3, 3, [0, 1, 2]), (9, 60, [0, 3, 4, 6]), (9, 10_000, [4])],
)
def test_many_frames_leave_room_for_fewer_cameras(views, frames, expected):
    rig = rigs.from_settings(RIG | {"cameras": [views, 1]})
    assert sequence_page.cameras(rig, views, frames) == expected
