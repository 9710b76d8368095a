"""Views as pictures: transparency, PNG of 8 and 16 bits, exposures, and the way back to light.

The views are computed: a bright disk with a soft edge before an empty background.
"""

import json

import numpy as np
import pytest

from lightfield.configuration.scene_yaml import Scene
from lightfield.export.source import SourceDataset
from lightfield.exporters.nerf_synthetic import NerfSynthetic
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.imaging.tonemap import decode_srgb, encode_srgb
from lightfield.validation.validate import validate

SIZE = 48
FISHEYE = {"lens": "equidistant", "fov": 180, "resolution": [SIZE, SIZE]}
PERSPECTIVE = {"lens": "rectilinear", "fov": 60, "resolution": [SIZE, SIZE]}
RIG = {"type": "lattice", "cameras": [2, 1, 1], "size": 0.5}
COLOUR = np.array([0.9, 0.3, 0.05])


def disk(lens):
    """Return the unassociated colour (h, w, 3) and the alpha (h, w) that a lens sees."""
    rays = lens.pixel_rays()
    angle = np.degrees(np.arccos(-rays[..., 2]))
    alpha = np.nan_to_num(np.clip((32 - angle) / 20, 0, 1))
    return COLOUR * (1 + 0.3 * np.nan_to_num(rays[..., :1])), alpha


def dataset(folder, camera=FISHEYE, transparent=True):
    lens = lenses.from_camera(camera)
    render = {"depth_precision": "float", **({"transparent": True} if transparent else {})}
    content = LightField.from_rig(RIG, lens, depth=None, frame=1, render=render, scene={})
    content.write(folder / "lightfield.json")
    colour, alpha = disk(lens)
    channels = dict(zip("RGB", np.moveaxis(colour * alpha[..., None], -1, 0), strict=True))
    if transparent:
        channels["A"] = alpha
    for view in content.views:
        halves = {name: plane.astype(np.float16) for name, plane in channels.items()}
        images.write_exr(folder / "exr" / f"{view.name}.exr", halves)
    return content


@pytest.fixture
def reproject(tmp_path, reproject_dataset):
    """Return a function that reprojects the dataset in tmp_path. It returns the new folder."""

    def run(name, **settings):
        content = Scene.model_validate(
            {
                "scene": {"builder": "room"},
                "render": {"samples": 1},
                "rigs": {"one": {"type": "lattice", "cameras": [1, 1, 1], "camera": FISHEYE}},
                "reprojections": {name: settings},
            }
        ).developments[name]
        folder = tmp_path / name
        reproject_dataset(tmp_path, folder, content.as_json())
        return folder

    return run


def read(path):
    """Return R, G, B and perhaps A as (h, w, n) floats. Integers become 0 to 1."""
    channels = images.read_image(path).channels
    planes = np.stack([channels[name] for name in "RGBA" if name in channels], axis=-1)
    largest = np.iinfo(planes.dtype).max if planes.dtype.kind == "u" else 1
    return planes.astype(np.float64) / largest


def test_reprojection_keeps_alpha_and_associates_it_in_exr_alone(tmp_path, reproject):
    dataset(tmp_path)
    exr = read(reproject("hdr", camera=PERSPECTIVE, format="exr") / "view_0000f.exr")
    png = read(reproject("png", camera=PERSPECTIVE) / "view_0000f.png")
    colour, alpha = disk(lenses.from_camera(PERSPECTIVE))
    # The soft edge bends within a source pixel.
    np.testing.assert_allclose(exr[..., 3], alpha, atol=0.05)
    np.testing.assert_allclose(exr[..., :3], colour * alpha[..., None], atol=0.05)
    np.testing.assert_allclose(png[..., 3], exr[..., 3], atol=0.5 / 255 + 1e-3)
    covered = alpha > 0.1
    # Unassociated colour is the disk's own colour up to its edge.
    np.testing.assert_allclose(png[covered, :3], encode_srgb(colour[covered]), atol=0.01)
    assert not png[alpha == 0][:, 3].all()
    result = validate(tmp_path, ["hdr", "png"])
    assert result.valid, result.to_json()


def test_transparent_views_are_rgba_to_trainers(tmp_path):
    dataset(tmp_path, PERSPECTIVE)
    source = SourceDataset(tmp_path, "", ".exr")
    folder = tmp_path / "nerf"
    NerfSynthetic(sources=["views"]).export(source, folder)
    pixels = read(next(folder.rglob("view_0000f.png")))
    colour, alpha = disk(source.lens)
    np.testing.assert_allclose(pixels[..., 3], alpha, atol=1 / 255)
    covered = alpha > 0.1
    np.testing.assert_allclose(pixels[covered, :3], encode_srgb(colour[covered]), atol=1.5 / 255)
    source.write_image(source.lightfield.views[1], folder / "one.png")
    np.testing.assert_array_equal(read(folder / "one.png"), pixels)


def spoil(folder, alpha):
    image = images.read_image(folder / "exr" / "view_0001f.exr")
    images.write_exr(folder / "exr" / "view_0001f.exr", image.channels | alpha)


def test_validation_knows_alpha(tmp_path):
    content = dataset(tmp_path)
    assert validate(tmp_path).valid
    spoil(tmp_path, {"A": np.full((SIZE, SIZE), 1.5, np.float16)})
    (problem,) = [text for check in validate(tmp_path).checks for text in check.problems]
    assert problem == "exr/view_0001f.exr: 2304 values of alpha are not between 0 and 1"
    # A camera that sees nothing is not wrong.
    spoil(tmp_path, dict.fromkeys("RGBA", np.zeros((SIZE, SIZE), np.float16)))
    assert validate(tmp_path).valid
    content.changed(render={}).write(tmp_path / "lightfield.json")
    problems = [text for check in validate(tmp_path).checks for text in check.problems]
    assert any("must have B:float16 G:float16 R:float16" in text for text in problems)


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize(("exposure", "reinhard"), [(0, None), (-2, None), (1.5, 4.0)])
def test_a_png_of_the_views_themselves_can_be_undone(bits, exposure, reinhard, tmp_path, reproject):
    dataset(tmp_path, transparent=False)
    settings = {"bits": bits, "exposure": exposure} | ({"reinhard": reinhard} if reinhard else {})
    folder = reproject("png", **settings)
    made = json.loads((folder / "lightfield.json").read_text())["reprojection"]
    assert (made["exposure"], made["reinhard"]) == (exposure, reinhard or 1)
    assert made.get("bits", 8) == bits
    assert images.read_image(folder / "view_0000f.png").channels["R"].dtype == f"uint{bits}"
    # The way back: sRGB, then v (1 + v / m²) / (1 + v) = t, then the stops.
    step = 0.5 / (2**bits - 1) + 1e-7
    png_colour, exr_colour = (
        read(folder / "view_0000f.png")[..., :3],
        read(tmp_path / "exr/view_0000f.exr"),
    )

    def light(encoded):
        t, m = decode_srgb(encoded.clip(0, 1)), made["reinhard"]
        root = m**2 * (1 - t)
        v = t if m == 1 else (-root + np.sqrt(root**2 + 4 * m**2 * t)) / 2
        return v / 2 ** made["exposure"]

    assert (light(png_colour + step) >= exr_colour.clip(None, light(np.ones(1))) - 1e-6).all()
    assert (light(png_colour - step) <= exr_colour + 1e-6).all()
    assert validate(tmp_path, ["png"]).valid


def scene(**reprojection):
    return {
        "scene": {"builder": "room"},
        "render": {"samples": 1},
        "rigs": {"one": {"type": "lattice", "cameras": [1, 1, 1], "camera": FISHEYE}},
        "reprojections": {"png": reprojection},
    }


def test_a_bracket_is_a_folder_for_each_exposure():
    reprojections = Scene.model_validate(scene(exposure=[-2.0, 0.5, 2], bits=16)).developments
    assert {name: each.exposure for name, each in reprojections.items()} == {
        "png_ev-2": -2.0,
        "png_ev0.5": 0.5,
        "png_ev2": 2.0,
    }
    assert not any("camera" in each.as_json() for each in reprojections.values())


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        ({"rotation": [10, 0, 0]}, "rotation: needs camera; without one, nothing is resampled"),
        ({"filter": "bilinear"}, "filter: needs camera"),
        ({"format": "exr", "bits": 16}, "bits: is only for format png"),
        ({"exposure": [1, 1.0]}, "must not name png_ev1 twice"),
    ],
)
def test_useless_settings_are_refused(wrong, problem):
    with pytest.raises(ValueError, match=problem):
        Scene.model_validate(scene(**wrong))
