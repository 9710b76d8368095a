"""The pass `variance`: what it estimates, what else it changes, and what does not go with it."""

import json
import re
import shutil

import numpy as np
import pytest
import yaml
from conftest import BLENDER
from scipy.ndimage import binary_erosion
from variance_renders import CASES, SAMPLES, SIZE

from lightfield import open_dataset
from lightfield.configuration import scene_yaml
from lightfield.configuration.config_file import Preset
from lightfield.configuration.scene_yaml import Scene
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.formats.passes import PASSES, VARIANCE
from lightfield.imaging import images
from lightfield.planning.loading import datasets_of, scene_datasets
from lightfield.validation.validate import validate

CAMERA = {"lens": "rectilinear", "fov": 60, "resolution": [SIZE, SIZE]}


@pytest.fixture(scope="module")
def made(tmp_path_factory, run_program):
    folder = tmp_path_factory.mktemp("variance")
    run_program(BLENDER / "variance_renders.py", folder)
    return folder


@pytest.mark.parametrize("case", CASES)
def test_the_mean_of_the_parts_is_the_view_that_cycles_renders_at_once(case, made):
    views = np.load(made / f"{case}.npz")
    names = [name.removeprefix("whole ") for name in views if name.startswith("whole ")]
    expected = {"colour", "centre depth"}
    expected |= {*CASES[case].get("passes", ())} & {"diffuse_light", "surface_mask", "cryptomatte"}
    assert expected <= {*names}
    for name in names:
        whole, mean = views[f"whole {name}"], views[f"mean {name}"]
        if name.startswith("centre ") or name == "cryptomatte":
            np.testing.assert_array_equal(mean, whole, err_msg=name)
        else:
            assert mean.dtype == np.float32
            np.testing.assert_allclose(mean, whole, rtol=1e-6, atol=1e-6, err_msg=name)


def test_the_variance_is_the_spread_of_the_parts(made):
    views = np.load(made / "parts.npz")
    parts = views["parts"].astype(np.float64)
    assert len(np.unique(parts.mean(axis=(1, 2, 3)))) == 8
    expected = parts.var(axis=0, ddof=1) / 8
    assert expected.max() > 1e-3
    np.testing.assert_allclose(views["measured"], expected, rtol=1e-5, atol=1e-12)


def test_a_pixel_without_noise_has_no_variance(made):
    views = np.load(made / "plain.npz")
    only_sky = binary_erosion(np.isinf(views["mean centre depth"]), np.ones((3, 3)))
    assert only_sky.sum() > 100
    assert not views["mean variance"][only_sky].any()


def estimated_and_true(path):
    """Return the estimated variance for each seed, and the true variance over all seeds."""
    views = np.load(path)
    return views["variance"].astype(np.float64), views["colour"].astype(np.float64).var(0, ddof=1)


def test_the_estimate_is_the_variance_over_seeds_where_noise_is_rare_bright_paths(made):
    estimated, true = estimated_and_true(made / "lamp behind a board.npz")
    # Over 100 seeds, the standard error of the ratio is 0.02.
    assert 0.95 < estimated.mean() / true.mean() < 1.2


def test_the_estimate_is_too_large_where_samples_avoid_each_other(made):
    estimated, true = estimated_and_true(made / "large lamp.npz")
    assert 1.2 < estimated.mean() / true.mean() < 1.5


def test_one_pixels_estimate_has_seven_degrees_of_freedom(made):
    estimated, _ = estimated_and_true(made / "large lamp.npz")
    relative = estimated.var(axis=0, ddof=1) / estimated.mean(axis=0) ** 2
    np.testing.assert_allclose(np.median(relative), 2 / 7, rtol=0.1)


def test_a_dataset_has_the_variance_beside_its_views(made):
    view = open_dataset(made / "dataset").views[0]
    variance = view.read(VARIANCE)
    assert variance.shape == (SIZE, SIZE, 3) and variance.dtype == np.float32
    np.testing.assert_array_equal(variance, np.load(made / "parts.npz")["measured"])


def spoil(path, value):
    planes = {name: plane.copy() for name, plane in images.read_image(path).channels.items()}
    planes["G"][3, 4] = value
    images.write_exr(path, planes)


@pytest.mark.parametrize(
    ("value", "problem"),
    [(-1e-9, "1 variances are below 0"), (np.nan, "1 values are not finite")],
    ids=["negative", "not a number"],
)
def test_validation_finds_a_variance_that_is_none(value, problem, made, tmp_path):
    shutil.copytree(made / "dataset", tmp_path / "dataset")
    checks = {check.name: check for check in validate(tmp_path / "dataset").checks}
    assert checks["passes"].passed
    spoil(tmp_path / "dataset/variance/view_0000f.exr", value)
    checks = {check.name: check for check in validate(tmp_path / "dataset").checks}
    assert checks["passes"].problems == [f"variance/view_0000f.exr: {problem}"]


def test_a_reprojected_variance_is_the_variance_of_a_source_pixel(
    made, tmp_path, reproject_dataset
):
    camera = {"lens": "equidistant", "fov": 40, "resolution": [48, 48]}
    settings = {"camera": camera, "filter": "bilinear", "formats": ["exr"], "passes": [VARIANCE]}
    reproject_dataset(made / "dataset", tmp_path / "fisheye", settings)
    source, target = (
        images.read_image(PASSES[VARIANCE].path(folder, "view_0000f")).channels
        for folder in (made / "dataset", tmp_path / "fisheye")
    )
    for name in "RGB":
        assert target[name].dtype == np.float32 and target[name].any()
        assert {*np.unique(target[name])} <= {0, *np.unique(source[name])}


def scene(**render):
    rig = {"type": "lattice", "cameras": [1, 1, 1], "camera": CAMERA}
    return {
        "scene": {"builder": "room"},
        "render": {"samples": SAMPLES, "passes": [VARIANCE], **render},
        "rigs": {"one": rig},
    }


@pytest.mark.parametrize(
    ("render", "problem"),
    [
        ({"samples": 7}, "samples: is 7; must be at least 8 for the pass variance"),
        ({"denoise": True}, "denoise: does not go with the pass variance"),
        ({"adaptive_threshold": 0.1}, "adaptive_threshold: does not go with the pass variance"),
    ],
)
def test_what_is_no_mean_of_samples_is_refused(render, problem):
    with pytest.raises(ValueError, match=re.escape(problem)):
        Scene.model_validate(scene(**render))
    Scene.model_validate(scene(samples=8))


def test_a_target_error_is_refused():
    content = scene(target_error=0.01)
    del content["render"]["samples"]
    with pytest.raises(ValueError, match="target_error: does not go with the pass variance"):
        Scene.model_validate(content)


def test_a_relit_view_has_no_variance():
    content = scene(light_groups=["Lamp"])
    relit = {"relight": {"Lamp": 2}, "passes": [VARIANCE]}
    content["reprojections"] = {"night": relit | {"camera": CAMERA}}
    with pytest.raises(ValueError, match=r"night\.passes: variance does not go with relight"):
        Scene.model_validate(content)


def test_a_preset_leaves_the_samples_that_a_variance_needs(tmp_path, monkeypatch):
    (tmp_path / "noisy.yaml").write_text(yaml.safe_dump(scene()))
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    (dataset,) = scene_datasets("noisy", "small", Preset(samples=2, denoise=True))
    assert (dataset.render.samples, dataset.render.denoise) == (8, False)


def test_a_blend_with_too_few_samples_is_refused(tmp_path):
    blend = tmp_path / "few.blend"
    blend.write_bytes(b"BLENDER")
    content = scene(samples="file")
    content["scene"] = {"blend": str(blend), "url": "https://example.org", "sha256": sha256(blend)}
    (dataset,) = datasets_of("few", Scene.model_validate(content), "small", Preset(samples=2), {})
    inventory = tmp_path / "inventory.json"
    inventory.write_text(json.dumps({"blend": {"frame": 1, "samples": 4}, "external_files": []}))
    with pytest.raises(UserError, match=r"few\.blend: has 4 samples a pixel; must have at least 8"):
        dataset.resolved(inventory)
