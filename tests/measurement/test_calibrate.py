"""A target error instead of samples: the choice, its confirmation, and where it is used."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from checkouts import checkout, planned, snakemake

from lightfield.configuration import config_file, scene_yaml
from lightfield.configuration.config_file import Preset
from lightfield.core.errors import UserError
from lightfield.formats.lightfield import LightField
from lightfield.formats.render_block import MeasuredTargetError
from lightfield.geometry import lenses
from lightfield.measurement.calibration import Candidate, Search
from lightfield.measurement.effort import effort_for, effort_within
from lightfield.planning.cost import calibrating
from lightfield.planning.loading import scene_datasets
from lightfield.planning.sampling import PLAIN

TARGET = 0.02
CAMERA = {"lens": "equidistant", "fov": 180, "resolution": [24, 24]}
RIG = {"type": "sphere", "subdivisions": 1, "size": 0.5, "center": [0, 0, 1.5], "camera": CAMERA}
SCENE = """
scene: {{builder: room}}
render: {{{render}}}
rigs:
  LFSphere:
    type: sphere
    subdivisions: 1
    size: 0.5
    center: [0, 0, 1.5]
    camera: {{lens: equidistant, fov: 180, resolution: [24, 24]}}
"""
ASKED = ("--config", "scenes=[aimed]", "rigs=all", "preset=full")


@pytest.fixture(scope="module")
def room_probes(tmp_path_factory, run_program, room):
    """Return a function for the arguments of scripts/calibrate.py: room, inventory and cameras."""
    folder = tmp_path_factory.mktemp("probes")
    made = LightField.from_rig(RIG, lenses.from_camera(CAMERA), depth="z", frame=1)
    run_program("inventory.py", "--blend", room, "--output", folder / "inventory.json")

    def arguments(**render):
        path = folder / f"{len(list(folder.iterdir()))}.json"
        # This prefilter denoises in a third of the time.
        made.changed(render={"seed": 0, "denoise_prefilter": "fast", **render}).write(path)
        return ("--blend", room, "--inventory", folder / "inventory.json", "--lightfield", path)

    return arguments


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory, run_program, room_probes):
    """Return a function that calibrates the room, each time in a new folder.

    Without a ``cache`` of renders, it renders all anew.
    """

    def run(target, *more, cache=None, **limits):
        folder = tmp_path_factory.mktemp("calibrated")
        result = run_program(
            "calibrate.py",
            *room_probes(target_error=target, **limits),
            "--probes",
            "4",
            "--size",
            "24",
            "--device",
            "cpu",
            "--cache",
            cache or folder / "cache",
            "--output",
            folder / "record.json",
            "--seconds",
            folder / "seconds.json",
            *more,
        )
        return folder, result

    return run


@pytest.fixture(scope="module")
def once(calibrated):
    return calibrated(TARGET)


def test_other_views_confirm_the_choice(once):
    folder, result = once
    record = json.loads((folder / "record.json").read_text())
    assert record["reached"] and record["confirmed"]
    assert abs(record["held_out_error"] / TARGET - 1) < 0.2
    assert not set(record["probes"]) & {entry["probe"] for entry in record["held_out"]}
    assert set(record["choice"]) == {"samples", "adaptive_threshold", "denoise"}
    assert "warning" not in result.stderr
    # No candidate that reaches the target is cheaper.
    good = [c for c in record["candidates"] if c["error"] <= TARGET * 1.05]
    assert min(c["cost"] for c in good) == record["cost_samples"]
    assert max(record["references"]["own_error"]) < TARGET / 4
    # The room's walls are diffuse, so nearly all pixels have this error.
    reached = record["strata"]["diffuse"]
    assert reached["area"] > 0.5 and reached["error"] == pytest.approx(TARGET, rel=0.5)
    assert f"most of: diffuse {reached['error']:.2g}" in result.stdout
    seconds = json.loads((folder / "seconds.json").read_text())
    assert len(seconds["candidates"]) == len(record["candidates"])


def test_the_choice_is_the_same_to_the_byte_on_other_threads(once, calibrated):
    again, _ = calibrated(TARGET, "--threads", "2")
    first, second = (folder / "record.json" for folder in (once[0], again))
    assert first.read_bytes() == second.read_bytes()


def test_a_preset_limits_the_choice(once, calibrated):
    # The references are those of the other choice.
    cache = once[0] / "cache"
    folder, result = calibrated(0.01, cache=cache, most_samples=4, denoise=False)
    record = json.loads((folder / "record.json").read_text())
    assert record["choice"]["samples"] <= 4
    assert record["choice"]["denoise"] is False
    assert not record["reached"]
    assert "warning: render.target_error: 0.01 is not reached within the preset's" in result.stderr


def test_a_scene_may_be_calibrated_without_a_denoiser(tmp_path, monkeypatch):
    path = tmp_path / "aimed.yaml"
    path.write_text(SCENE.format(render="target_error: {value: 0.02, denoise: never}"))
    monkeypatch.setattr("lightfield.configuration.scene_yaml.SCENES", tmp_path)
    for preset in (None, Preset(denoise=True, samples=8)):
        (dataset,) = scene_datasets("aimed", limits=preset)
        assert dataset.render.target_error == 0.02
        assert dataset.render.denoise is False


def test_the_error_of_so_many_samples_is_measured_and_reached(once, calibrated):
    cache = once[0] / "cache"
    folder, result = calibrated({"of_samples": 32}, cache=cache)
    record = json.loads((folder / "record.json").read_text())
    target = record["target_error"]
    plain = {c["samples"]: c["error"] for c in record["candidates"] if c["way"] == "plain"}
    assert target == plain[32] and plain[64] < target < plain[16]
    assert record["of_samples"] == 32
    assert record["reached"] and record["probe_error"] <= 1.05 * target
    assert record["cost_samples"] < 32
    assert max(record["references"]["own_error"]) < target / 3
    assert f"wanted {target:.3g}, the error of 32 samples" in result.stdout


def test_a_choice_has_its_bias_which_neighbouring_views_may_share(once):
    folder, result = once
    record = json.loads((folder / "record.json").read_text())
    assert record["choice"]["denoise"]
    bias = record["bias"]
    assert bias["squared_bias"] + bias["variance"] == pytest.approx(bias["error"])
    # The same renders, compared in another way.
    assert bias["error"] == pytest.approx(record["probe_error_of_all_pixels"], rel=0.3)
    assert bias["squared_bias"] > 2 * bias["standard_error"]
    assert "bias² is" in result.stdout


def test_plain_path_tracing_has_no_bias_to_measure(once, calibrated):
    folder, result = calibrated(0.5, cache=once[0] / "cache", denoise=False)
    record = json.loads((folder / "record.json").read_text())
    assert record["way"] == "plain" and record["bias"] is None
    assert "all of it is noise" in result.stdout


@pytest.mark.slow
def test_a_dry_run_forecasts_the_cost_of_a_calibration(tmp_path):
    result = snakemake(
        checkout(tmp_path, aimed=SCENE.format(render="target_error: 0.02")), "-n", *ASKED
    )
    table = result.stdout.split("phase")[1]
    # 16 windows of 24² pixels, 6 µs a sample: two references of 256 samples, 85 samples of plain
    # path tracing, and 125 of the search. Add 70 ms for each of 41 renders, and two starts, one of
    # which chooses the views.
    assert re.search(r"^calibration +2 +92 s$", table, re.M), table


def test_the_calibration_of_many_samples_costs_what_its_references_take(tmp_path, monkeypatch):
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    Path(tmp_path, "aimed.yaml").write_text(SCENE.format(render="target_error: {of_samples: 256}"))
    (dataset,) = scene_datasets("aimed")
    # 16 windows of 24² pixels, 6 µs a sample: two references of 1280 samples, 85 samples of plain
    # path tracing, and 640 of the search. Add 70 ms for each of 25 renders, and a start.
    assert calibrating(dataset).seconds == pytest.approx(3 + 16 * (11.35 + 1.75), rel=1e-3)


def simulated(whole_error, bias=0.0):
    """Simulate renders: plain path tracing has the error 1/N, and 8/N over all pixels.

    Other methods have half that error plus ``bias``. Their error over all pixels is
    ``whole_error``, at any effort.
    """

    def measure(method):
        settings = {**PLAIN, **method.settings}
        samples = min(settings["samples"], 1 / (settings["adaptive_threshold"] or 1e-4))
        is_plain = method.name == "plain"
        error = 1 / samples if is_plain else bias + 0.5 / samples
        error_of_all_pixels = 8 / samples if is_plain else whole_error
        return Candidate(method.name, settings, samples, samples, error, error_of_all_pixels, 1.0)

    return measure


@pytest.mark.parametrize(("whole_error", "way"), [(0.1, "denoised"), (1.0, "plain")])
def test_a_method_that_hides_fireflies_is_not_chosen(whole_error, way):
    search = Search(simulated(whole_error), TARGET)
    # Plain path tracing reaches the target with 50 samples, where all pixels have 8 / 50.
    assert search.most_whole_error == pytest.approx(2 * 8 / 50)
    choice = search.choose()
    assert choice.way == way and search.reaches(choice)


@pytest.mark.parametrize("bias", [2 * TARGET, 1e6])
def test_a_method_with_too_much_bias_is_given_up(bias):
    search = Search(simulated(0.0, bias), TARGET, denoise=True)
    assert search.choose().error > TARGET
    assert max(entry.settings["samples"] for entry in search.measured) <= 4096


@pytest.mark.parametrize("samples", [1, 16, 50, 1000])
def test_the_target_is_the_error_of_the_plain_samples(samples):
    search = Search(simulated(0.0), MeasuredTargetError(of_samples=samples))
    assert search.target == 1 / samples
    assert search.choose().cost == pytest.approx(max(1, samples / 2), rel=0.06)
    # Without the denoiser, these samples themselves are the choice, and not one more.
    plain = Search(only_plain, MeasuredTargetError(of_samples=samples), denoise=False).choose()
    assert (plain.way, plain.samples) == ("plain", samples)


def only_plain(method):
    """Simulate renders in which adaptive sampling is useless."""
    candidate = simulated(0.0)(method)
    return candidate if method.name == "plain" else replace(candidate, error=1.0)


def test_a_scene_without_noise_has_a_target_that_one_sample_reaches():
    def measure(method):
        settings = {**PLAIN, **method.settings}
        samples = settings["samples"]
        return Candidate(method.name, settings, samples, samples, 0.0, 0.0, 1.0)

    search = Search(measure, MeasuredTargetError(of_samples=256))
    assert 0 < search.target < 1e-6
    assert search.choose().cost == 1


def test_effort_is_interpolated_between_the_nearest_points():
    # A power law with slope −½ between the points, and 1/N beyond the last.
    points = [(1, 0.8), (4, 0.4), (16, 0.2)]
    assert effort_for(0.4, points) == pytest.approx(4)
    assert effort_for(0.2828427, points) == pytest.approx(8)
    assert effort_for(0.1, points) == pytest.approx(32)
    assert effort_for(0.9, points) == 1
    # An error far below the reference's own may be measured as below 0.
    assert 1 < effort_for(0.4, [(1, 0.8), (2, -0.001)]) < 2


def test_effort_beyond_the_points_is_extrapolated_only_on_request():
    points = [(2, 0.8), (4, 0.4)]
    assert effort_within(0.1, points) is None
    assert effort_within(0.4, points) == pytest.approx(4)
    assert effort_within(1.6, points) == effort_for(1.6, points) == 2
    assert effort_for(1.6, points, before=True) == pytest.approx(1)


def test_a_denoised_error_that_rises_again_counts_where_it_was_first_reached():
    assert effort_within(0.4, [(1, 0.8), (2, 0.4), (4, 0.5), (8, 0.3)]) == pytest.approx(2)


@pytest.mark.slow
def test_only_a_scene_with_a_target_is_calibrated(tmp_path):
    aimed = SCENE.format(render="target_error: 0.02")
    counted = SCENE.format(render="samples: 4")
    tmp_path.joinpath("aimed").mkdir()
    tmp_path.joinpath("counted").mkdir()
    jobs = planned(checkout(tmp_path / "aimed", aimed=aimed), *ASKED)
    assert jobs["calibrate"] == jobs["probe_cameras"] == 1
    others = planned(checkout(tmp_path / "counted", aimed=counted), *ASKED)
    assert not {"calibrate", "probe_cameras"} & set(others)
    del jobs["calibrate"], jobs["probe_cameras"]
    assert jobs == others


@pytest.mark.slow
def test_views_are_rendered_with_the_choice_in_unchanged_shards(tmp_path):
    folder = checkout(tmp_path, aimed=SCENE.format(render="target_error: 0.05"))
    record = folder / "work/aimed/calibration.json"
    record.parent.mkdir(parents=True)
    before = planned(folder, *ASKED)
    choice = {"samples": 3000, "adaptive_threshold": 0.25, "denoise": True}
    record.write_text(json.dumps({"target_error": 0.05, "choice": choice, "cost_samples": 3000}))
    after = planned(folder, *ASKED)
    assert after["render"] == before["render"]
    result = snakemake(
        folder,
        *ASKED,
        "--rerun-triggers",
        "mtime",
        "--allowed-rules",
        "lightfield",
        "--",
        "results/aimed/LFSphere/lightfield.json",
    )
    assert result.returncode == 0, result.stderr
    written = json.loads((folder / "results/aimed/LFSphere/lightfield.json").read_text())
    assert {key: written["render"][key] for key in choice} == choice
    assert written["render"]["target_error"] == 0.05


LIMITS = config_file.Preset(samples=12, denoise=True)


def test_a_scene_has_samples_or_a_target(tmp_path):
    def read(render):
        path = tmp_path / "scene.yaml"
        path.write_text(SCENE.format(render=render))
        return scene_yaml.read_scene(path)

    assert read("target_error: 0.01").render.target_error == 0.01
    assert read("target_error: {of_samples: 9}").render.target_error.of_samples == 9
    for render, message in {
        "seed: 1": "render: is missing the key samples (or target_error)",
        "samples: 4, target_error: 0.1": "render.samples: does not go with target_error",
        "denoise: true, target_error: 0.1": "render.denoise: does not go with target_error",
        "target_error: 0": "render.target_error: is 0; must be a number above 0",
        "target_eror: 0.1": "render.target_eror: unknown key; did you mean target_error?",
    }.items():
        with pytest.raises(UserError) as caught:
            read(render)
        assert message in str(caught.value)


def test_presets_limit_what_a_calibration_may_choose(monkeypatch, tmp_path):
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    Path(tmp_path, "aimed.yaml").write_text(SCENE.format(render="target_error: 0.05"))
    full = scene_datasets("aimed")[0].render
    assert not {"samples", "denoise", "adaptive_threshold", "most_samples"} & full.to_json().keys()
    preview = scene_datasets("aimed", "preview", LIMITS)[0].render
    assert (preview.most_samples, preview.denoise) == (12, True)
    # A preset that limits samples also limits those whose error is the target.
    Path(tmp_path, "aimed.yaml").write_text(SCENE.format(render="target_error: {of_samples: 256}"))
    full = scene_datasets("aimed")[0].render
    assert full.target_error == MeasuredTargetError(of_samples=256)
    preview = scene_datasets("aimed", "preview", LIMITS)[0].render
    assert preview.target_error == MeasuredTargetError(of_samples=12)
