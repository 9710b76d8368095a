"""Error against render time, measured small: the files, and that nothing is rendered twice."""

import csv
import json
import re
from dataclasses import replace
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest

from lightfield.core.files import write_json
from lightfield.formats.lightfield import LightField, View
from lightfield.formats.passes import PARTS_OF_LIGHT
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.measurement import strata, trials
from lightfield.measurement.error_vs_time import evaluated, measured_point, whole_views_point, write
from lightfield.measurement.experiment import Method
from lightfield.measurement.metrics import Reference, disagreement, make_reference
from lightfield.measurement.strata import STRATA
from lightfield.measurement.trials import SURFACES, ViewWindow
from lightfield.report import tables

CAMERA = {"lens": "equidistant", "fov": 180, "resolution": [64, 64]}
RIG = {"type": "plane", "cameras": [4, 1], "size": 0.3, "center": [0, 0, 1.5]}
RENDER = {"samples": 4, "adaptive_threshold": 0, "denoise": True, "seed": 0}
# Denoises colour, albedo and normals at once, in a third of the time.
RENDER |= {"denoise_prefilter": "fast"}


def lightfield(render=RENDER):
    lens = lenses.from_camera(CAMERA)
    return LightField.from_rig(RIG, lens, depth="z", frame=1, render=render)


@pytest.fixture(scope="module")
def measured(tmp_path_factory, run_program, room):
    folder = tmp_path_factory.mktemp("error")
    lightfield().write(folder / "lightfield.json")
    run_program("inventory.py", "--blend", room, "--output", folder / "inventory.json")

    def run():
        return run_program(
            "error_vs_time.py",
            "--blend",
            room,
            "--inventory",
            folder / "inventory.json",
            "--device",
            "cpu",
            "--lightfield",
            folder / "lightfield.json",
            "--cache",
            folder / "cache",
            "--probes",
            "1",
            "--size",
            "32",
            "--octaves",
            "4",
            "--reference",
            "128",
            "--output",
            folder / "room",
        )

    run.folder = folder
    run()
    return run


@pytest.fixture(scope="module")
def content(measured):
    return json.loads((measured.folder / "room.json").read_text())


def test_plain_path_tracing_converges_as_monte_carlo_does(content):
    """Cycles' Sobol points make a smooth room converge a little faster than independent points."""
    slope = content["slopes"]["plain"]["over_samples"]["slope"]
    assert -1.3 < slope < -0.9
    slope_of_all_pixels = content["slopes"]["plain"]["of_all_pixels_over_samples"]["slope"]
    assert -1.3 < slope_of_all_pixels < -0.9
    errors = [p["relative_mse"] for p in content["points"] if p["method"] == "plain"]
    assert len(errors) == 5
    assert all(more > less for more, less in pairwise(errors))
    assert 0 < content["reference_error"] < errors[-1]


def test_every_method_is_measured_with_the_scenes_own_settings(content):
    counts = {}
    for point in content["points"]:
        counts[point["method"]] = counts.get(point["method"], 0) + 1
        assert point["seconds"] > 0
        assert 0 <= point["flip"] <= 1 and point["ssim"] <= 1
    assert counts == {
        "plain": 5,
        "adaptive": 5,
        "denoised": 5,
        "adaptive + denoised": 5,
        "path guiding": 5,
        "this scene's settings": 1,
    }
    (own_point,) = content["settings"]
    (same,) = (
        point
        for point in content["points"]
        if point["method"] == "denoised" and point["settings"]["samples"] == RENDER["samples"]
    )
    assert own_point["relative_mse"] == same["relative_mse"]


def test_changes_of_the_scenes_settings_are_tried(measured, content):
    tried = content["changes"]["tried"]
    savings = {json.dumps(entry["change"]): entry["savings"] for entry in tried}
    sampling = json.loads((measured.folder / "inventory.json").read_text())["sampling"]
    # In a closed room with a lamp, fewer bounces make it darker. No other change does.
    fewer = savings[json.dumps({"max_bounces": sampling["max_bounces"] // 4})]["whole views"]
    assert fewer["light"] < -0.01
    tree = savings[json.dumps({"light_tree": not sampling["light_tree"]})]["whole views"]
    assert 0 < abs(tree["light"]) < 0.02
    # Each change reaches Cycles: no two make the same pixels. Two are exceptions: a clamp clamps
    # nothing here, and on some processors the denoiser has one filter for two qualities. If several
    # changes saved time, they were also tried together. With them, one may change nothing.
    same = {"clamp_indirect", "denoise_quality"}
    wholes = [
        saved["whole views"]
        for change, saved in savings.items()
        if len(json.loads(change)) == 1 and not same & json.loads(change).keys()
    ]
    assert len({(saving["bias"], saving["light"]) for saving in wholes}) == len(wholes)
    text = (measured.folder / "room.md").read_text()
    assert "| `denoise_prefilter: fast` | denoised |" in text


def test_whole_views_are_made_of_their_strata(content):
    """The room has lamps and diffuse walls. It has no other strata."""
    strata = content["strata"]
    assert set(strata) <= set(STRATA) and "diffuse" in strata and "volume" not in strata
    total = sum(stratum["area"] for stratum in strata.values())
    assert total == pytest.approx(1, abs=0.01)
    for number, point in enumerate(content["points"]):
        parts = [(stratum["area"], stratum["points"][number]) for stratum in strata.values()]
        assert all(part["method"] == point["method"] for _, part in parts)
        mean = sum(area * part["relative_mse"] for area, part in parts) / total
        assert point["relative_mse"] == pytest.approx(mean)
    assert -1.4 < strata["diffuse"]["slopes"]["plain"]["over_samples"]["slope"] < -0.8


class SimulatedPilot:
    """A pilot that renders nothing: a fire in one corner of the views before a diffuse wall."""

    has_volumes = True

    def __init__(self, lens):
        self.lens, self.lightfield, self.mask = lens, lightfield(), trial_renderer().mask
        self.changes = {}

    def pilot(self, lens):
        return self

    def render(self, window, seed, sampling):
        shape = (window.height, window.width)
        fire = np.zeros(shape, dtype=np.float32)
        fire[20:26, 40:48] = 5
        parts = {name: np.full(shape, 0.1, np.float32) for name in PARTS_OF_LIGHT}
        parts |= {"diffuse_light": np.ones(shape, np.float32), "volume_light": fire}
        parts |= {name: np.zeros(shape, np.float32) for name in SURFACES} | self.changes
        noise = np.random.default_rng(seed).uniform(0.5, 1.5, (*shape, 1))
        colour = np.repeat(sum(parts.values())[..., None] * noise, 3, axis=-1)
        return trials.Trial(colour.astype(np.float32), None, 4, 1.0, "CPU", parts)


@pytest.mark.slow
def test_a_small_fire_gets_windows_of_its_own():
    renderer = SimulatedPilot(lenses.from_camera(CAMERA))
    windows, areas = strata.choose(renderer, 16, 2)
    assert set(areas) == {"diffuse", "volume"}
    circle = np.pi / 4 * 64 * 64
    assert areas["volume"] == pytest.approx(48 / circle, rel=0.02)
    assert len(windows) == 4
    for window in windows[2:]:
        assert window.x < 41 and window.x + 16 > 47 and window.y < 21 and window.y + 16 > 25
    whole_view = ViewWindow(windows[0].view, 0, 0, 64, 64)
    kinds, _ = strata.classes(renderer, whole_view)
    assert (kinds == STRATA.index("volume")).sum() == 48
    assert ((kinds == strata.NONE) == ~renderer.mask(whole_view)).all()


@pytest.mark.parametrize(
    ("shows", "stratum"),
    [
        ({"translucent": 1}, "translucent"),
        ({"transparent": 1}, "transparent"),
        ({"transparent": 1, "glossy_light": 5}, "glossy"),
        ({"emission": 5, "emitting": 1}, "emission"),
        ({"emission": 5}, "volume"),
    ],
)
def test_a_surfaces_stratum_follows_from_its_light(shows, stratum):
    renderer = SimulatedPilot(lenses.from_camera(CAMERA))
    renderer.changes = {name: np.full((64, 64), value, np.float32) for name, value in shows.items()}
    kinds, _ = strata.classes(renderer, ViewWindow(renderer.lightfield.views[0], 0, 0, 64, 64))
    assert STRATA[kinds[32, 32]] == stratum
    # Without fog or fire, light without a surface is a lamp too small for its pixel.
    renderer.has_volumes = False
    kinds, _ = strata.classes(renderer, ViewWindow(renderer.lightfield.views[0], 0, 0, 64, 64))
    assert STRATA[kinds[32, 32]] == ("emission" if stratum == "volume" else stratum)


def test_nothing_on_the_pareto_front_is_beaten(content):
    front = content["pareto_front"]
    assert front
    for point in content["points"]:
        for other in front:
            better = point["seconds"] < other["seconds"]
            assert not (
                better and point["relative_mse"] < other["relative_mse"] and point["resolved"]
            )


def test_noise_of_neighbouring_views_is_independent(content):
    plain = next(n for n in content["neighbouring_views"] if n["method"] == "plain")
    assert plain["share"] == pytest.approx(1, abs=0.15)
    assert plain["total"] > plain["floor"] > 0


def test_methods_are_compared_at_equal_time_and_at_equal_error(measured, content):
    methods = {entry["method"]: entry for entry in content["methods"]}
    assert methods["plain"]["times_faster"] == pytest.approx(1)
    assert methods["plain"]["error"] == pytest.approx(methods["plain"]["equal_error"])
    for point in content["points"]:
        parts = point["bias"] + point["variance"]
        assert parts == pytest.approx(point["relative_mse_whole"], rel=1e-6, abs=1e-9)
        assert point["mse_seconds"] == point["relative_mse_whole"] * point["seconds"]
    # All denoised renders share a part of their errors.
    plain, denoised = (
        [p for p in content["points"] if p["method"] == method][-1]
        for method in ("plain", "denoised")
    )
    assert denoised["bias"] > 0.1 * denoised["relative_mse_whole"]
    assert abs(plain["bias"]) < 0.1 * plain["relative_mse_whole"]
    text = (measured.folder / "room.md").read_text()
    table = text.partition("## What could be cheaper")[0].splitlines()
    assert all(sum(row.startswith(f"| {m} |") for row in table) == 2 for m in methods)
    assert sum(row.startswith("| diffuse |") for row in table) == len(methods)
    # At the error of its most samples, plain path tracing takes these. The denoiser takes fewer.
    most = {entry["method"]: entry for entry in content["methods_at_most_samples"]}
    assert most["plain"]["times_faster"] == pytest.approx(1)
    assert most["plain"]["equal_error"] < methods["plain"]["equal_error"]


def test_a_datasets_page_has_the_strata_in_a_table(measured, content):
    folder = measured.folder / "error_vs_time"
    folder.mkdir()
    for suffix in (".json", ".svg"):
        (folder / f"room{suffix}").write_bytes((measured.folder / f"room{suffix}").read_bytes())
    strata_table = tables.error_vs_time([folder / "room.json"], "room").tables[
        "By what pixels show"
    ]
    strata = content["strata"]
    assert list(dict.fromkeys(row[0] for row in strata_table.rows)) == ["whole views", *strata]
    rows = [dict(zip(strata_table.columns, row, strict=True)) for row in strata_table.rows]
    (row,) = (r for r in rows if (r["stratum"], r["method"]) == ("diffuse", "denoised"))
    assert row["part"] == strata["diffuse"]["area"]
    assert row["slope"] == strata["diffuse"]["slopes"]["denoised"]["over_time"]["slope"]
    for number, name in ((-2, "methods"), (-1, "methods_at_most_samples")):
        (denoised,) = (m for m in strata["diffuse"][name] if m["method"] == "denoised")
        assert list(row.values())[number] == denoised["times_faster"]
        assert name != "methods" or row["error in these"] == denoised["error"]


def test_a_stratum_without_noise_has_no_error_and_no_psnr(tmp_path):
    sky, depth = np.full((16, 16, 3), 0.5, np.float32), np.full((16, 16), 2, np.float32)
    reference = make_reference([sky] * 2, [depth] * 2, np.ones((16, 16), bool))
    trial = trials.Trial(sky, depth, 1, 1.0, "CPU")
    plain = Method("plain", {"samples": 1})
    points = [measured_point(plain, [[trial, trial]], [reference])]
    points.append(whole_views_point({"environment": points[0]}, {"environment": 1.0}, 0.0))
    evaluation = evaluated(points, 0.0)
    assert [(p["relative_mse"], p["psnr"]) for p in evaluation["points"]] == [(0, None)] * 2
    write_json(tmp_path / "points.json", evaluation)
    seen = np.arange(9), np.arange(9)
    same = disagreement((sky, sky), (reference, reference), seen)
    assert (same.total, same.added, same.share) == (0, 0, 0)


def test_a_constant_error_has_a_slope_of_exactly_0(tmp_path):
    """So it is if a denoiser's bias is all the error, as in a smooth sky."""
    sky = np.full((16, 16, 3), 0.5, np.float32)
    reference = make_reference([sky] * 2, None, np.ones((16, 16), bool))
    points = []
    for samples in (1, 2, 4, 8):
        trial = trials.Trial(sky + np.float32(0.25), None, samples, float(samples), "CPU")
        method = Method("denoised", {"samples": samples, "denoise": True})
        points.append(measured_point(method, [[trial, trial]], [reference]))
    plain = replace(points[0], method="plain")
    evaluation = evaluated([plain, *points], 0.0)
    write_json(tmp_path / "points.json", evaluation)
    slope = evaluation["slopes"]["denoised"]["over_time"]
    assert (slope["slope"], slope["slope_error"]) == (0, 0)


def test_a_scene_without_noise_has_a_plot_that_says_so(tmp_path):
    sky = np.full((16, 16, 3), 0.5, np.float32)
    reference = make_reference([sky] * 2, None, np.ones((16, 16), bool))
    trial = trials.Trial(sky, None, 1, 1.0, "CPU")
    points = [measured_point(Method("plain", {"samples": 1}), [[trial, trial]], [reference])]
    measured = evaluated(points, 0.0)
    content = {"measured_on": {"device": "CPU"}, **measured, "neighbouring_views": []}
    content["strata"] = {"environment": {"area": 1.0, **measured}}
    nothing = {"tried": [], "unchanged": {}, "costly": {}, "yaml": {}}
    content["changes"] = {"seeds": 4, "device": "CPU", "strata": {}, **nothing}
    write(tmp_path / "sky", content)
    assert {path.suffix for path in tmp_path.iterdir()} == {".csv", ".json", ".md", ".png", ".svg"}
    text = (tmp_path / "sky.svg").read_text()
    assert text.count("No error is above the references' own.") == 2


def test_a_methods_time_is_when_it_first_has_the_error():
    """The error of the denoised renders ends at their bias, and rises a little at the end."""
    sky = np.full((16, 16, 3), 0.5, np.float32)
    reference = make_reference([sky] * 2, None, np.ones((16, 16), bool))

    def line(name, errors):
        method = Method(name, {"samples": 1})
        trial = trials.Trial(sky * 2, None, 1, 1.0, "CPU")
        point = measured_point(method, [[trial, trial]], [reference])
        seconds = (10.0 * 2**number for number in range(len(errors)))
        pairs = zip(errors, seconds, strict=True)
        return [replace(point, relative_mse=error, seconds=at) for error, at in pairs]

    points = line("plain", [0.08, 0.04, 0.01505]) + line("denoised", [0.05, 0.02, 0.015, 0.0152])
    by_method = {row["method"]: row for row in evaluated(points, 0.0)["methods_at_most_samples"]}
    assert by_method["plain"]["seconds_at_equal_error"] == pytest.approx(40)
    # The power law from 0.02 after 20 s to 0.015 after 40 s.
    expected = 20 * 2 ** (np.log(0.01505 / 0.02) / np.log(0.015 / 0.02))
    assert by_method["denoised"]["seconds_at_equal_error"] == pytest.approx(expected)


def test_other_programs_can_read_the_files(measured, content):
    rows = list(csv.DictReader((measured.folder / "room.csv").open()))
    strata = content["strata"].values()
    assert len(rows) == len(content["points"]) + sum(len(stratum["points"]) for stratum in strata)
    assert float(rows[0]["relative_mse"]) == content["points"][0]["relative_mse"]
    whole_views = [row for row in rows if row["stratum"] == "whole views"]
    assert sum(row["pareto"] == "True" for row in whole_views) == len(content["pareto_front"])
    assert ElementTree.parse(measured.folder / "room.svg").getroot().tag.endswith("svg")
    assert images.read_image(measured.folder / "room.png").channels


def test_both_panels_of_the_plot_have_one_size_with_their_legends_below(measured):
    root = ElementTree.parse(measured.folder / "room.svg").getroot()
    by_id = {element.get("id"): element for element in root.iter() if element.get("id")}
    panels = []
    for name in ("axes_1", "axes_2"):
        outline = next(by_id[name].iter("{http://www.w3.org/2000/svg}path")).get("d")
        corners = np.array(re.findall(r"-?[\d.]+", outline), float).reshape(-1, 2)
        panels.append((corners.min(axis=0), corners.max(axis=0)))
    (first_start, first_end), (second_start, second_end) = panels
    np.testing.assert_allclose(first_end - first_start, second_end - second_start, atol=0.1)
    assert first_start[1] == pytest.approx(second_start[1])
    size = np.array(root.get("viewBox").split()[2:], float)
    assert (second_end < size).all()
    for name, start, end in (("legend_1", *panels[0]), ("legend_2", *panels[1])):
        legend = ElementTree.tostring(by_id[name], encoding="unicode")
        texts = np.array(re.findall(r"translate\(([\d.]+) ([\d.]+)\) scale", legend), float)
        assert (texts[:, 0] > start[0]).all() and (texts[:, 0] < end[0]).all()
        assert (texts[:, 1] > end[1]).all() and (texts[:, 1] < size[1]).all()


def test_a_second_run_renders_nothing(measured):
    before = {p.name: p.stat().st_mtime_ns for p in (measured.folder / "cache").iterdir()}
    made = (measured.folder / "room.json").read_bytes()
    measured()
    assert {p.name: p.stat().st_mtime_ns for p in (measured.folder / "cache").iterdir()} == before
    assert (measured.folder / "room.json").read_bytes() == made


def test_a_target_error_without_calibration_is_refused(measured, run_program, room):
    path = measured.folder / "target.json"
    lightfield({"target_error": 0.01}).write(path)
    result = run_program(
        "error_vs_time.py",
        "--blend",
        room,
        "--inventory",
        measured.folder / "inventory.json",
        "--lightfield",
        path,
        "--cache",
        "none",
        "--output",
        measured.folder / "none",
        check=False,
    )
    assert result.returncode == 1
    assert "target.json" in result.stderr and "--calibration" in result.stderr
    assert "Traceback" not in result.stderr


def trial_renderer():
    return trials.Trials("none.blend", "none.json", lightfield(), "cpu", 1, "none")


def test_windows_lie_in_the_image_circle_and_in_different_views():
    renderer = trial_renderer()
    windows = renderer.windows(16, 4)
    assert len({window.view.name for window in windows}) == 4
    for window in windows:
        assert 0 <= window.x <= 48 and 0 <= window.y <= 48
        assert renderer.mask(window).mean() >= 0.75
    # If the view is small, the window is the whole view: its circle fills π/4 of it.
    (whole_view,) = renderer.windows(100, 1)
    assert (whole_view.x, whole_view.y, whole_view.width, whole_view.height) == (0, 0, 64, 64)
    assert renderer.mask(whole_view).mean() == pytest.approx(np.pi / 4, abs=0.01)
    # Here the circle fills less of every window.
    renderer.lens = replace(renderer.lens, principal_point=(60.0, 60.0))
    (corner,) = renderer.windows(64, 1)
    assert 0 < renderer.mask(corner).mean() < 0.75


def test_the_same_wall_is_found_in_both_views():
    """Two cameras 0.4 m apart look at a wall 2 m away: rays of θ and θ' meet it in one point."""
    renderer = trial_renderer()
    looking = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    beside = looking.copy()
    beside[0, 3] = 0.4
    views = [View.placed(str(number), matrix) for number, matrix in enumerate((looking, beside))]
    windows = tuple(trials.ViewWindow(view, 8, 8, 48, 48) for view in views)
    mask = renderer.mask(windows[0])
    rows, columns = np.mgrid[8:56, 8:56] + 0.5
    rays = renderer.lens.rays(columns, rows)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(mask, 2 / -rays[..., 2], np.inf)
    zero = np.zeros((48, 48, 3))
    reference = Reference(zero, zero, depth, mask, 0.0)
    cameras = tuple(renderer.camera(view) for view in views)
    pixels_here, pixels_there = trials.both_see(cameras, windows, (reference, reference))
    middle = 24 * 48 + 24
    # The pixel right of the optical axis is at 1/32 of 90 degrees, half a pixel on.
    angle = np.radians(90) / 32 * 0.5
    other = np.arctan((2 * np.tan(angle) - 0.4) / 2) / np.radians(90) * 32 + 24
    (pixel,) = pixels_there[pixels_here == middle]
    assert pixel % 48 == int(other)
    assert abs(pixel // 48 - 24) <= 1
    # If the second depth has something in front, the wall is hidden.
    near = Reference(zero, zero, depth / 2, mask, 0.0)
    assert not len(trials.both_see(cameras, windows, (reference, near))[0])


ON_TWO_DEVICES = """
import sys
from pathlib import Path
from lightfield.formats.lightfield import LightField
from lightfield.measurement import trials
from lightfield.rendering.setup import cycles

folder = Path(sys.argv[1])
lightfield = LightField.read(folder / "lightfield.json")


def kept(device):
    scene = (Path(sys.argv[2]), folder / "inventory.json")
    renderer = trials.Trials(*scene, lightfield, device, 1, folder / "cache")
    renderer.render(renderer.windows(8, 1)[0], 1, {"samples": 1})
    return len(list((folder / "cache").iterdir()))


counts = [kept("cpu")]
cycles.device_name = lambda device: "cpu"
counts.append(kept("auto"))
cycles.device_name = lambda device: "OPTIX of another machine"
counts.append(kept("auto"))
print(*counts)
"""


def test_a_render_is_not_reused_on_another_device(run_program, room, tmp_path):
    lightfield().write(tmp_path / "lightfield.json")
    run_program("inventory.py", "--blend", room, "--output", tmp_path / "inventory.json")
    (tmp_path / "program.py").write_text(ON_TWO_DEVICES)
    counts = run_program(tmp_path / "program.py", tmp_path, room).stdout.split()[-3:]
    # Without a GPU, `auto` is the processor. With one, the window is rendered again.
    assert counts == ["1", "1", "2"]
