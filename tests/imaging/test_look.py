"""Blender's looks: beside Blender's own pictures of the same light, and in everything developed."""

import importlib.util
import itertools
import json
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from lightfield.configuration.keys import render_key
from lightfield.configuration.scene_yaml import Scene
from lightfield.core.errors import UserError
from lightfield.export.source import SourceDataset
from lightfield.exporters.nerf_synthetic import NerfSynthetic
from lightfield.exporters.opendibr import OpenDibr
from lightfield.formats import blend
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import blender_looks, images, pictures
from lightfield.imaging.blender_looks import FILE_LOOK
from lightfield.imaging.look import Look
from lightfield.imaging.sensor import SensorParameters, light_of
from lightfield.products.exports import run as export
from lightfield.validation.validate import validate

SIZE = 32
CAMERA = {"lens": "rectilinear", "fov": 60, "resolution": [SIZE, SIZE]}
VIEWS = blender_looks.views()
# Exposures with gammas.
TRIED = [(0.0, 1.0), (0.7, 1.0), (-1.3, 1.4)]


@cache
def light():
    """Return light (h, w, 3): greys, colours, saturated, beyond white, and below zero."""
    random = np.random.default_rng(0)
    pixels = np.exp2(random.uniform(-14, 7, (SIZE, SIZE, 3)))
    pixels[:4] = np.exp2(np.linspace(-14, 10, 4 * SIZE)).reshape(4, SIZE, 1)
    pixels[4:8] *= random.choice([1, 0, 0.01], (4, SIZE, 3))
    pixels[8:10] *= -0.05
    pixels[10:20] = random.uniform(-0.1, 1.2, (10, SIZE, 3))
    return pixels.astype(np.float32)


@cache
def coverage():
    """Return alpha (h, w, 1) with all and with no coverage, and between them."""
    parts = np.random.default_rng(1).choice([0, 0.01, 0.25, 0.5, 1], (SIZE, SIZE, 1))
    return parts.astype(np.float32)


def of_blender(folder, bits, alpha=None, **settings):
    """Return the picture (h, w, n) of whole numbers that Blender saves of `light`."""
    import bpy

    scene = bpy.data.scenes.new("look")
    view = scene.view_settings
    view.look = "None"
    for name in ("view_transform", "look", "exposure", "gamma"):
        setattr(view, name, settings.pop(name))
    assert not settings
    covered = np.ones((SIZE, SIZE, 1), np.float32) if alpha is None else alpha
    # Blender multiplies colour with alpha. Without coverage, it is light all the same.
    pixels = np.dstack([light() * np.where(covered > 0, covered, 1), covered])
    image = bpy.data.images.new("light", SIZE, SIZE, alpha=True, float_buffer=True)
    image.pixels.foreach_set(np.ascontiguousarray(pixels[::-1]).reshape(-1))
    scene.render.dither_intensity = 0
    file = scene.render.image_settings
    file.file_format = "PNG"
    file.color_mode = "RGBA"
    file.color_depth = str(bits)
    path = folder / "blender.png"
    image.save_render(str(path), scene=scene)
    bpy.data.images.remove(image)
    bpy.data.scenes.remove(scene)
    channels = images.read_image(path, "RGBA").channels
    return np.stack([channels[name] for name in "RGB"], axis=-1).astype(int)


@pytest.mark.slow
@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("bits", [8, 16])
def test_each_look_gives_blenders_own_pixels(view, bits, tmp_path):
    for name in ("None", *blender_looks.looks(view)):
        for (exposure, gamma), alpha in itertools.product(TRIED, (None, coverage())):
            expected = of_blender(
                tmp_path,
                bits,
                alpha,
                view_transform=view,
                look=name,
                exposure=exposure,
                gamma=gamma,
            )
            pixels = Look(view, name, exposure, gamma).to_pixels(light(), bits)
            # One level of 255.
            assert np.abs(pixels - expected).max() <= (2**bits - 1) / 255, (name, exposure, gamma)


@pytest.mark.slow
def test_a_stop_more_shows_twice_the_light_with_a_look_too():
    look = Look("AgX", "None", 0.3, 1.0)
    brighter = pictures.develop(light(), 1.0, look)
    np.testing.assert_array_equal(brighter, pictures.develop(2 * light(), 0.0, look))
    assert brighter.mean() > pictures.develop(light(), 0.0, look).mean() + 1


def test_the_names_of_looks_are_blenders():
    import bpy

    settings = bpy.data.scenes.new("names").view_settings

    def names(key):
        with pytest.raises(TypeError) as refusal:
            setattr(settings, key, "no such name")
        return list(eval(str(refusal.value).partition("not found in ")[2]))

    assert names("view_transform") == VIEWS
    for view in VIEWS:
        settings.view_transform = view
        # Blender has looks for a view transform that shows numbers, too.
        assert names("look") == ["None", *blender_looks.looks(view)] or view == "Raw"


@pytest.mark.parametrize("name", ["AgX", "AgX - Punchy", "Filmic - High Contrast", "False Color"])
def test_every_thread_and_strip_gives_the_same_pixels(name):
    whole = Look.of(name, 0.5).to_pixels(light(), 8)
    strips = [light()[row : row + 1] for row in range(SIZE)]
    with ThreadPoolExecutor(4) as pool:
        rows = pool.map(lambda strip: Look.of(name, 0.5).to_pixels(strip, 8), strips)
    np.testing.assert_array_equal(np.concatenate(list(rows)), whole)


@pytest.mark.parametrize("view", VIEWS)
def test_light_without_end_and_without_a_number_has_pixels(view):
    pixels = np.float32([[[np.inf, 1, 0]], [[np.nan, 1, 0]], [[-np.inf, 1e30, -1e30]]])
    with np.errstate(all="raise"):
        shown = Look(view, gamma=1.5).developed(pixels)
    assert np.isfinite(shown).all()


FACTS = {
    "display": "sRGB",
    "view_transform": "AgX",
    "look": "AgX - Punchy",
    "exposure": 0.5,
    "gamma": 1.2,
    "curves": False,
    "curve_tone": "STANDARD",
    "curve_tables": None,
    "white": None,
    "working_space": "Linear Rec.709",
}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"display": "Display P3"}, "display is Display P3"),
        ({"unknown": {"look": ["ACES Look"]}}, "look ACES Look .Blender lacks it"),
        ({"curves": True, "curve_tone": "FILMLIKE"}, "Film Like"),
        ({"white": [1, 1, 1], "working_space": "ACEScg"}, "white balance change ACEScg"),
        ({"view_transform": "Raw", "look": "High Contrast"}, "Raw with the look High Contrast"),
    ],
)
def test_a_blend_whose_picture_is_not_blenders_is_refused(change, said):
    with pytest.raises(UserError, match=said):
        Look.of("file", 0.0, blend.look_of(FACTS | change))


def test_a_missing_file_of_blender_is_named(tmp_path, monkeypatch):
    package = SimpleNamespace(origin=str(tmp_path / "bpy/__init__.py"))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: package)
    blender_looks.blender.cache_clear()
    with pytest.raises(UserError, match=r"bpy/.*config\.ocio, which is missing; install bpy"):
        Look.of("AgX", 0.0)


def test_a_look_of_another_view_transform_is_ignored_as_in_blender():
    facts = FACTS | {"look": "High Contrast"}
    assert Look.of("file", 0.0, blend.look_of(facts)) == Look("AgX", "None", 0.5, 1.2)


def dataset(folder, transparent=False, **content):
    """Write a dataset of two views of `light`, and return its light field."""
    rig = {"type": "lattice", "cameras": [2, 1, 1], "size": 0.5}
    render = {"depth_precision": "float", **({"transparent": True} if transparent else {})}
    lightfield = LightField.from_rig(
        rig, lenses.from_camera(CAMERA), depth=None, frame=1, render=render, scene={}, **content
    )
    lightfield.write(folder / "lightfield.json")
    alpha = coverage() if transparent else np.ones_like(coverage())
    pixels = np.dstack([light() * alpha, alpha]).astype(np.float16)
    names = "RGBA" if transparent else "RGB"
    channels = dict(zip(names, np.moveaxis(pixels, -1, 0), strict=False))
    for view in lightfield.views:
        images.write_exr(folder / "exr" / f"{view.name}.exr", channels)
    return lightfield


def developments(**blocks):
    scene = {"blend": "a.blend", "url": "https://example.org/a.blend", "sha256": 64 * "0"}
    rig = {"type": "lattice", "cameras": [2, 1, 1], "camera": CAMERA}
    content = {"scene": scene, "render": {"samples": 1}, "rigs": {"one": rig}, **blocks}
    return Scene.model_validate(content).developments


@pytest.fixture
def develop(tmp_path, reproject_dataset):
    """Return a function that develops the dataset in tmp_path, and returns the new folder."""

    def run(block=None, name="png", **settings):
        blocks = block or {"reprojections": {name: settings}}
        made = developments(**blocks)[name]
        reproject_dataset(tmp_path, tmp_path / name, made.as_json())
        return tmp_path / name

    return run


def read(path, names="RGB"):
    channels = images.read_image(path, names).channels
    return np.stack([channels[name] for name in names], axis=-1)


def seen(folder):
    """Return the light (h, w, 3) of the first view, not multiplied with alpha, and alpha."""
    image = images.read_image(folder / "exr" / "view_0000f.exr")
    alpha = image.channels["A"][..., None].astype(np.float32)
    return image.colour / np.where(alpha > 0, alpha, 1), alpha


def test_a_reprojection_says_its_look_and_is_valid(tmp_path, develop):
    dataset(tmp_path, file_look=blend.look_of(FACTS))
    folder = develop(look="file", exposure=0.25)
    own = Look("AgX", "AgX - Punchy", 0.75, 1.2)
    expected = own.to_pixels(images.read_image(tmp_path / "exr/view_0000f.exr").colour, 8)
    np.testing.assert_array_equal(read(folder / "view_0000f.png"), expected)
    said = json.loads((folder / "lightfield.json").read_text())["reprojection"]
    assert said["look"] == own.to_json()
    assert (said["look"]["view"], said["look"]["exposure"]) == ("AgX", 0.75)
    # Who takes a look for plain sRGB finds no exposure.
    assert "exposure" not in said and "reinhard" not in said
    header = images.read_header(folder / "view_0000f.png").attributes
    assert json.loads(header["plenoforge:look"]) == own.to_json()
    result = validate(tmp_path, ["png"])
    assert result.valid and not any(check.warnings for check in result.checks)


def test_a_transparent_reprojection_keeps_alpha(tmp_path, develop):
    dataset(tmp_path, transparent=True)
    folder = develop(look="AgX - Punchy", bits=16)
    light_seen, alpha = seen(tmp_path)
    pixels = read(folder / "view_0000f.png", "RGBA")
    np.testing.assert_array_equal(
        pixels[..., :3], Look("AgX", "AgX - Punchy").to_pixels(light_seen, 16)
    )
    np.testing.assert_allclose(pixels[..., 3:] / 65535, alpha, atol=1e-5)
    assert validate(tmp_path, ["png"]).valid


def test_an_export_develops_as_a_reprojection_does(tmp_path, develop):
    dataset(tmp_path, transparent=True)
    source = SourceDataset(tmp_path, "", ".exr", exposure=0.5, look_name="Filmic - High Contrast")
    settings = NerfSynthetic(sources=["views"], exposure=0.5, look="Filmic - High Contrast")
    export(source, settings, tmp_path / "nerf")
    folder = develop(look="Filmic - High Contrast", exposure=0.5)
    exported = next((tmp_path / "nerf").rglob("view_0000f.png"))
    np.testing.assert_array_equal(read(exported, "RGBA"), read(folder / "view_0000f.png", "RGBA"))
    recorded = json.loads((tmp_path / "nerf" / "export.json").read_text())["options"]
    assert recorded["look"] == Look("Filmic", "High Contrast", 0.5).to_json()


def test_a_video_shows_a_transparent_view_before_black(tmp_path):
    dataset(tmp_path, transparent=True)
    source = SourceDataset(tmp_path, "", ".exr", look_name="AgX")
    light_seen, alpha = seen(tmp_path)
    expected = Look("AgX").developed(light_seen * alpha)
    np.testing.assert_allclose(source.encoded(source.lightfield.views[0]), expected, atol=2e-3)


def test_an_export_without_a_look_records_none():
    assert "look" not in OpenDibr(sources=["views"]).recorded
    assert "look" not in OpenDibr(sources=["views"]).as_json()


def test_a_sensor_shows_a_look_in_place_of_its_response(tmp_path, develop):
    dataset(tmp_path)
    folder = develop({"sensor": {"look": "AgX", "exposure": -1}}, name="sensor")
    light_seen = images.read_image(tmp_path / "exr/view_0000f.exr").colour
    expected = Look("AgX").to_pixels((light_seen / 2).clip(0, 1), 8)
    assert np.abs(read(folder / "view_0000f.png").astype(int) - expected).max() <= 1
    content = json.loads((folder / "view_0000f.json").read_text())
    assert content["look"] == Look("AgX").to_json()
    with pytest.raises(UserError, match="look"):
        light_of(expected, SensorParameters.from_json(content))
    assert validate(tmp_path, ["sensor"]).valid


def test_pictures_with_a_look_are_not_taken_for_light(tmp_path, develop, reproject_dataset):
    dataset(tmp_path)
    folder = develop(look="AgX")
    again = developments(reprojections={"again": {}})["again"]
    (folder / "exr").mkdir()
    result = reproject_dataset(folder, tmp_path / "again", again.as_json(), check=False)
    assert "reprojection.look: its images are no light any more" in result.stderr
    assert not (tmp_path / "again").exists()


def test_a_look_changes_neither_other_jobs_nor_rendered_views(tmp_path):
    (plain,) = developments(reprojections={"png": {"look": "none"}}).values()
    assert not {"look", "look_source"} & plain.as_json().keys()
    assert "look" not in plain.published(None)
    content = dataset(tmp_path)
    with_look = content.changed(**{FILE_LOOK: blend.look_of(FACTS)})
    assert render_key(content, content.views[0]) == render_key(with_look, content.views[0])


def test_another_bpy_or_configuration_makes_the_pictures_again():
    (made,) = developments(reprojections={"png": {"look": "AgX"}}).values()
    assert made.as_json()["look_source"] == blender_looks.source_of("AgX")
    assert blender_looks.source()["config_sha256"] in made.as_json()["look_source"]
