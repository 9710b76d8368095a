"""Views as a sensor sees them: PPISP's formula, noise, quantisation, brackets, and their files."""

import dataclasses
import json
import math

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.special import gammaincinv

from lightfield.configuration.scene_yaml import Scene
from lightfield.core.files import write_json
from lightfield.formats.lightfield import LightField
from lightfield.formats.sensors import SensorSettings
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.imaging.sensor import BLACK, WHITE, SensorParameters, light_of, merged, sense
from lightfield.imaging.tonemap import encode_srgb
from lightfield.reprojection.sensor import parameters_of
from lightfield.validation.validate import validate

LINEAR = ((1.0, 1.0, 1.0, 0.5),) * 3
NO_VIGNETTING = ((0.0,) * 5,) * 3
PLAIN = SensorParameters(0.0, NO_VIGNETTING, (0.0,) * 8, LINEAR, 0.0, 0.0, 16, 1)
# The parts of cases that a statistical test may reject although all is right.
RARELY = 1e-6

# What PPISP's own code makes of these parameters and of the light in `ppisp_light`: the function
# ppisp_apply_torch of tests/torch_reference.py in nv-tlabs/ppisp, version 64d4597, with
# torch 2.15.0 on a CPU.
PPISP = SensorParameters(
    exposure=-0.8,
    vignetting=(
        (0.02, -0.01, -0.5, -0.2, 0.1),
        (0.0, 0.03, -0.4, 0.0, 0.0),
        (-0.05, 0.0, -0.3, -0.1, -0.6),
    ),
    colour=(0.8, -0.5, -1.1, 0.4, 0.6, 1.3, -0.9, 0.7),
    response=((1.4, 0.9, 0.45, 0.4), (1.2, 1.1, 0.5, 0.5), (0.8, 1.3, 0.6, 0.3)),
    gain=0.0,
    floor=0.0,
    bits=16,
    seed=1,
)
PPISP_PIXELS = np.array(
    [
        (0.05473, 0.639729, 0.451798),
        (0.739999, 0.63075, 0.413117),
        (0.714723, 0.584568, 0.32084),
        (0.673645, 0.525544, 0.173353),
        (0.628606, 0.42126, 0.871598),
        (0.557017, 0.338016, 0.813887),
        (0.511333, 0.258306, 0.800068),
        (0.47712, 0.154743, 0.771576),
        (0.43523, 0.866716, 0.706003),
        (0.369074, 0.826321, 0.654456),
        (0.289358, 0.772909, 0.593655),
        (0.19463, 0.7067, 0.5217),
        (0.077381, 0.658974, 0.465417),
        (0.756826, 0.649534, 0.426951),
        (0.73071, 0.602674, 0.336967),
        (0.689414, 0.543037, 0.199784),
        (0.644818, 0.438242, 0.883742),
        (0.574127, 0.354459, 0.829246),
        (0.50507, 0.266946, 0.796167),
        (0.473948, 0.16935, 0.769906),
        (0.434391, 0.864841, 0.705782),
        (0.37044, 0.824945, 0.655003),
        (0.29301, 0.771985, 0.59445),
        (0.201462, 0.706221, 0.521608),
    ]
).reshape(4, 6, 3)
# The crf_params of this response, which that code was given.
PPISP_CRF = [
    [0.695228, -0.19587, -0.869723, -0.405465],
    [0.378165, 0.203382, -0.709633, 0.0],
    [-0.432752, 0.541325, -0.432752, -0.847298],
]


def chi_squared(degrees):
    """Return the two values beyond which chi² lies rarely.

    They are those of scipy.stats.chi2.ppf, whose import takes most of a second.
    """
    return 2 * gammaincinv(degrees / 2, [RARELY, 1 - RARELY])


def ppisp_light():
    """Return light (4, 6, 3) with values from 0 to 1.3, in no order."""
    return (np.arange(72) * 7919 % 97 / 97 * 1.3).reshape(4, 6, 3)


def test_a_sensor_without_noise_is_ppisp():
    sensed = sense(ppisp_light(), PPISP)
    # Half a code, and the digits of the numbers above.
    np.testing.assert_allclose(sensed.pixels / 65535, PPISP_PIXELS, rtol=0, atol=0.5 / 65535 + 1e-6)


def test_parameters_are_written_as_ppisps_own_tensors():
    content = json.loads(json.dumps(PPISP.to_json()))
    tensors = content["ppisp"]
    np.testing.assert_allclose(tensors["crf_params"], PPISP_CRF, rtol=0, atol=1e-6)
    assert tensors["exposure_params"] == -0.8
    np.testing.assert_array_equal(tensors["vignetting_params"], PPISP.vignetting)
    np.testing.assert_array_equal(tensors["color_params"], PPISP.colour)
    assert SensorParameters.from_json(content) == PPISP


def test_pixels_turn_back_into_the_light():
    light = ppisp_light()
    back = light_of(sense(light, PPISP).pixels, PPISP)
    # One of 65,536 codes, times the steepest slope of the inverse response.
    np.testing.assert_allclose(back, light, rtol=0, atol=1e-4)


@pytest.mark.parametrize(("a", "b"), [(0.004, 0.0), (0.0, 1e-4), (0.002, 1e-4)])
@pytest.mark.parametrize("level", [0.2, 0.5, 0.7])
def test_noise_has_the_variance_of_the_formula(a, b, level):
    parameters = dataclasses.replace(PLAIN, gain=a, floor=b)
    flat = np.full((192, 192, 3), level)
    pixels = sense(flat, parameters).pixels / 65535
    expected = a * level + b
    assert level + 5 * math.sqrt(expected) < 1, "noise would be clipped"
    for channel in range(3):
        values = pixels[..., channel].ravel()
        degrees = values.size - 1
        # A sample variance of normal values follows chi². Poisson's kurtosis a / y widens this.
        wider = math.sqrt(1 + a**2 * a * level / expected**2 / 2)
        low, high = 1 + wider * (chi_squared(degrees) / degrees - 1)
        assert low < values.var(ddof=1) / expected < high
        assert abs(values.mean() - level) < 5 * math.sqrt(expected / values.size)


def test_noise_is_independent_between_pixels_and_channels():
    parameters = dataclasses.replace(PLAIN, floor=1e-4)
    noise = sense(np.full((128, 128, 3), 0.5), parameters).pixels / 65535 - 0.5
    pairs = [
        (noise[:, 1:], noise[:, :-1]),
        (noise[1:], noise[:-1]),
        # Rows are developed in strips of 64.
        (noise[64:], noise[:64]),
        (noise[..., 0], noise[..., 1]),
        (noise[..., 1], noise[..., 2]),
    ]
    for first, second in pairs:
        correlation = np.corrcoef(first.ravel(), second.ravel())[0, 1]
        assert abs(correlation) < 5 / math.sqrt(first.size)


def test_noise_in_the_dark_is_clipped_at_black():
    deviation = 0.01
    parameters = dataclasses.replace(PLAIN, floor=deviation**2)
    sensed = sense(np.zeros((256, 256, 3)), parameters)
    values = sensed.pixels / 65535
    # The mean of a normal value of which the negative half is 0: σ / √(2π).
    error = deviation / math.sqrt(values.size)
    assert abs(values.mean() - deviation / math.sqrt(2 * math.pi)) < 5 * error
    assert abs((sensed.clipped == BLACK).mean() - 0.5) < 5 * 0.5 / math.sqrt(values.size)


@pytest.mark.parametrize("bits", [1, 6, 8, 10, 12, 16])
def test_codes_have_the_asked_bits(bits):
    parameters = dataclasses.replace(PLAIN, bits=bits)
    ramp = np.repeat(np.linspace(0, 1, 4096), 3).reshape(64, 64, 3)
    pixels = sense(ramp, parameters).pixels
    assert pixels.dtype == (np.uint8 if bits <= 8 else np.uint16)
    assert len(np.unique(pixels)) == min(2**bits, 4096)
    values = pixels / np.iinfo(pixels.dtype).max
    stored_step = 0.5 / np.iinfo(pixels.dtype).max
    assert abs(values - ramp).max() <= 0.5 / (2**bits - 1) + stored_step


def test_without_a_response_codes_are_srgb():
    light = np.linspace(0, 1, 300).reshape(10, 10, 3)
    pixels = sense(light, dataclasses.replace(PLAIN, response=None, bits=8)).pixels
    np.testing.assert_array_equal(pixels, np.rint(255 * encode_srgb(light)))


def brackets(light, parameters, stops=(-3, 0, 3)):
    """Return light and weights of each bracket, and how the sensor sees it."""
    lights = []
    seen = []
    for number, stop in enumerate(stops):
        bracket = dataclasses.replace(
            parameters, exposure=parameters.exposure + stop, seed=100 + number
        )
        seen.append(sense(light, bracket))
        lights.append(light_of(seen[-1].pixels, bracket))
    return lights, [each.weights for each in seen], seen


@pytest.mark.parametrize("response", [None, LINEAR, PPISP.response], ids=["srgb", "linear", "crf"])
def test_merged_brackets_are_the_light_within_noise_and_quantisation(response):
    # From 1 / 64 to 6: no bracket alone holds all of it.
    light = np.repeat(2.0 ** np.linspace(-6, 2.6, 96 * 96), 3).reshape(96, 96, 3)
    parameters = dataclasses.replace(
        PLAIN,
        vignetting=PPISP.vignetting,
        response=response,
        gain=0.0005,
        floor=1e-7,
        bits=12,
    )
    lights, weights, seen = brackets(light, parameters)
    result = merged(lights, weights)
    assert np.isfinite(result).all()
    deviation = 1 / np.sqrt(np.sum(weights, axis=0, dtype=np.float64))
    normalised = (result - light) / deviation
    # 27,648 values: none may lie farther out, and their spread is that of the bound.
    assert abs(normalised).max() < 6
    assert abs(normalised.mean()) < 5 / math.sqrt(normalised.size)
    low, high = chi_squared(normalised.size) / normalised.size
    # Rounding is not normal, and its variance is an estimate.
    assert 0.95 * low < normalised.var() < 1.05 * high
    for each in seen:
        assert not ((each.clipped == WHITE) & (each.weights > 0)).any()
    assert (seen[2].clipped == WHITE)[-1].all()
    assert not (seen[0].clipped == WHITE).any()


def test_where_every_bracket_is_clipped_there_is_no_light():
    lights, weights, _ = brackets(np.full((4, 4, 3), 100.0), PLAIN)
    assert np.isnan(merged(lights, weights)).all()


def test_with_colour_a_clipped_channel_spoils_the_others():
    light = np.full((2, 2, 3), [5.0, 0.2, 0.2])
    mixed = sense(light, dataclasses.replace(PLAIN, colour=PPISP.colour))
    assert not mixed.weights.any()
    apart = sense(light, PLAIN)
    assert (apart.weights > 0).all(axis=(0, 1)).tolist() == [False, True, True]


def settings(**content):
    return SensorSettings.model_validate(content)


def test_parameters_vary_from_view_to_view_within_their_range():
    varied = settings(exposure={"range": [-0.5, 0.25]}, colour={"range": [0.5, 1.0]})
    drawn = [parameters_of(varied, index, f"view_{index}") for index in range(200)]
    exposures = np.array([each.exposure for each in drawn])
    assert exposures.min() > -0.5 and exposures.max() < 0.25
    assert abs(exposures.mean() + 0.125) < 5 * 0.75 / math.sqrt(12 * 200)
    colours = np.array([each.colour for each in drawn])
    assert colours.min() > 0.5 and colours.max() < 1.0
    assert len(np.unique(colours)) == colours.size
    assert len({each.seed for each in drawn}) == 200


def test_a_random_walk_has_the_steps_that_were_asked_for():
    walk = settings(exposure={"start": 0.5, "step": 0.1})
    exposures = [parameters_of(walk, index, f"view_{index}").exposure for index in range(400)]
    assert exposures[0] == 0.5
    steps = np.diff(exposures)
    low, high = chi_squared(steps.size) / steps.size
    assert low < (steps**2).mean() / 0.1**2 < high


def test_parameters_do_not_depend_on_other_views():
    walk = settings(exposure={"step": 0.1}, colour={"step": 0.2}, noise={"a": 0.01})
    forth = [parameters_of(walk, index, f"view_{index}") for index in range(20)]
    back = [parameters_of(walk, index, f"view_{index}") for index in reversed(range(20))]
    assert forth == back[::-1]
    assert parameters_of(walk, 3, "view_3", frame=2).seed != forth[3].seed
    faces = [parameters_of(walk, 3, "view_3", face) for face in ("_f", "_l")]
    assert faces[0].exposure == faces[1].exposure and faces[0].seed != faces[1].seed
    other = settings(**{**walk.as_json(), "seed": 1})
    assert parameters_of(other, 3, "view_3").exposure != forth[3].exposure


SIZE = 48
FISHEYE = {"lens": "equidistant", "fov": 180, "resolution": [SIZE, SIZE]}
PERSPECTIVE = {"lens": "rectilinear", "fov": 60, "resolution": [SIZE, SIZE]}
RIG = {"type": "lattice", "cameras": [4, 1, 1], "size": 0.5, "camera": FISHEYE}
SCENE = {"scene": {"builder": "room"}, "render": {"samples": 1}, "rigs": {"one": RIG}}
NOISY = {"noise": {"a": 0.01, "b": 1e-4}, "exposure": {"step": 0.3}}


def developments(sensor, **more):
    return Scene.model_validate({**SCENE, "sensor": sensor, **more}).developments


@pytest.fixture
def develop(tmp_path, reproject_dataset):
    """Return a function that develops four fisheye views, and returns the new folder."""
    rig = {key: value for key, value in RIG.items() if key != "camera"}
    render = {"depth_precision": "float"}
    content = LightField.from_rig(
        rig, lenses.from_camera(FISHEYE), depth=None, frame=1, render=render, scene={}
    )
    content.write(tmp_path / "lightfield.json")
    light = np.random.default_rng(0).uniform(0.05, 0.9, (3, SIZE, SIZE)).astype(np.float16)
    light[:, np.isnan(content.lens.pixel_rays()[..., 0])] = 0
    for view in content.views:
        path = tmp_path / "exr" / f"{view.name}.exr"
        images.write_exr(path, dict(zip("RGB", light, strict=True)))

    def run(name, reprojection, *arguments, folder=None):
        folder = folder or tmp_path / name
        reproject_dataset(tmp_path, folder, reprojection.as_json(), *arguments)
        return folder

    return run


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_bytes_are_equal_in_any_shards_and_order(tmp_path, develop):
    sensor = {**NOISY, "brackets": [-1.0, 1.0]}
    (reprojection, *_) = developments(sensor).values()
    whole = develop("sensor_ev-1", reprojection)
    parts = tmp_path / "parts"
    for views in ("3:4", "0:2", "2:3"):
        develop("sensor_ev-1", reprojection, "--views", views, folder=parts)
    assert contents(parts) == contents(whole)
    # A PNG, its parameters, its clipping mask and its weights.
    assert len(contents(whole)) == 4 * 4 + 1


def test_a_sensors_folder_is_a_valid_part_of_its_dataset(tmp_path, develop):
    sensor = {**NOISY, "sources": ["views", "flat"], "brackets": [-1.0, 1.0]}
    flat = {"flat": {"camera": PERSPECTIVE}}
    made = developments(sensor, reprojections=flat)
    names = [name for name in made if name != "flat"]
    assert names == ["sensor_ev-1", "sensor_ev1", "flat_sensor_ev-1", "flat_sensor_ev1"]
    for name in names:
        develop(name, made[name])
    result = validate(tmp_path, names)
    assert result.valid, [check for check in result.checks if check.passed is False]
    view = tmp_path / "sensor_ev1" / "view_0002f"
    listed = {f"sensor_ev1/{view.name}{end}" for end in (".json", "_clipped.png", "_weights.exr")}
    assert listed <= result.checksums.keys()
    # A published view can be turned back by its own files alone.
    parameters = SensorParameters.from_json(json.loads(view.with_suffix(".json").read_text()))
    image = images.read_image(view.with_suffix(".png")).channels
    light = light_of(np.stack([image[name] for name in "RGB"], axis=-1), parameters)
    weights = images.read_image(view.with_name(f"{view.name}_weights.exr")).colour
    clean = images.read_image(tmp_path / "exr" / f"{view.name}.exr").colour
    normalised = ((light - clean) * np.sqrt(weights))[weights > 0]
    assert normalised.size > 1000
    assert abs(normalised).max() < 6


def test_other_parameters_than_the_settings_give_are_a_fault(tmp_path, develop):
    folder = develop("sensor", developments(NOISY)["sensor"])
    path = folder / "view_0001f.json"
    content = json.loads(path.read_text())
    content["exposure"] += 0.01
    write_json(path, content)
    (folder / "view_0002f.json").unlink()
    (check,) = (c for c in validate(tmp_path, ["sensor"]).checks if c.name == "sensor/sensor")
    assert check.passed is False
    assert check.views == ["view_0001f", "view_0002f"]


def test_finished_views_are_kept(develop):
    reprojection = developments(NOISY)["sensor"]
    folder = develop("sensor", reprojection)
    stamps = {path: path.stat().st_mtime_ns for path in folder.glob("view_*")}
    develop("sensor", reprojection)
    assert stamps == {path: path.stat().st_mtime_ns for path in folder.glob("view_*")}


def test_a_sensor_leaves_the_other_jobs_as_they_are():
    flat = {"flat": {"camera": PERSPECTIVE}}
    alone = Scene.model_validate({**SCENE, "reprojections": flat}).developments
    beside = developments({**NOISY, "sources": ["flat"]}, reprojections=flat)
    assert beside["flat"].as_json() == alone["flat"].as_json()
    assert "sensor" not in alone["flat"].as_json()
    assert "sensor" not in alone["flat"].published(None)


def test_the_sensor_sees_a_sources_lens_and_rigs():
    flat = {"flat": {"camera": PERSPECTIVE, "rigs": ["one"], "exposure": -3}}
    made = developments({**NOISY, "sources": ["flat"], "bits": 12}, reprojections=flat)
    sensed = made["flat_sensor"]
    assert sensed.camera == made["flat"].camera
    assert sensed.rigs == ["one"]
    assert sensed.bits == 16
    with pytest.raises(ValidationError, match="name is taken by sensor"):
        developments({**NOISY, "sources": ["flat"]}, reprojections={**flat, "flat_sensor": {}})
