"""The passes of surfaces hold what the materials of a known scene are painted with."""

import shutil

import numpy as np
import pytest
from conftest import BLENDER
from scipy.ndimage import binary_erosion
from surface_views import KNOWN, LENSES, MATT, SLOPE, SURFACES

from lightfield.core.files import read_json
from lightfield.formats.lightfield import LightField
from lightfield.formats.passes import PASSES
from lightfield.imaging import images
from lightfield.validation.validate import validate


@pytest.fixture(scope="module")
def made(tmp_path_factory, run_program):
    folder = tmp_path_factory.mktemp("surfaces")
    run_program(BLENDER / "surface_views.py", folder)
    return folder


def read(folder, name):
    view_pass = PASSES[name]
    channels = images.read_image(view_pass.path(folder, "view_0000f")).channels
    assert set(channels) == set(view_pass.channels)
    assert {str(plane.dtype) for plane in channels.values()} == {view_pass.dtype}
    planes = [channels[key] for key in view_pass.channels]
    return np.stack(planes, axis=-1).astype(np.float32 if view_pass.dtype == "float16" else int)


def inside(folder, name):
    """Return the pixels that show only the object ``name``, with all their samples."""
    numbers = read_json(folder / "object" / "names.json")
    seen = read(folder, "object")[..., 0] == numbers[name]
    pixels = binary_erosion(seen, np.ones((3, 3)), iterations=2)
    assert pixels.any(), name
    return pixels


@pytest.mark.parametrize("lens", LENSES)
def test_one_principled_bsdf_has_its_own_values(lens, made):
    folder = made / lens
    for name in read_json(made / "names.json")["exact"]:
        pixels = inside(folder, name)
        np.testing.assert_allclose(read(folder, "surface_mask")[pixels], 1, atol=1e-3)
        for title, value in (MATT if name == "matt" else KNOWN).items():
            expected = 1.0 if (name, title) == ("clamped", "roughness") else value
            rendered = read(folder, title)[pixels]
            expected = np.broadcast_to(expected, rendered.shape)
            np.testing.assert_allclose(rendered, expected, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("lens", LENSES)
def test_any_other_surface_has_no_values_and_a_mask_of_0(lens, made):
    folder = made / lens
    for name in read_json(made / "names.json")["other"]:
        shown = {"behind veil": "card behind veil"}.get(name, name)
        pixels = inside(folder, shown)
        for title in SURFACES:
            assert not read(folder, title)[pixels].any(), (name, title)


@pytest.mark.parametrize("lens", LENSES)
def test_the_base_colour_of_the_floor_follows_its_place(lens, made):
    folder = made / lens
    content = LightField.read(folder / "lightfield.json")
    view = content.views[0]
    rays = content.lens.pixel_rays() @ view.world_from_camera[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        points = view.position - rays * (view.position[2] / rays[..., 2:])
    near = inside(folder, "floor") & (np.linalg.norm(points, axis=-1) < 6)
    assert near.sum() > 50
    expected = 0.5 + SLOPE * points
    np.testing.assert_allclose(read(folder, "base_colour")[near], expected[near], atol=0.01)


def test_the_sky_has_no_surface(made):
    sky = np.isinf(images.read_image(made / "panorama/exr/view_0000f.exr").channels["Z"])
    sky = binary_erosion(sky, iterations=2)
    assert sky.any() and not read(made / "panorama", "surface_mask")[sky].any()


def test_the_passes_leave_the_colour_as_it_is(made):
    bare = images.read_image(made / "plain/exr/view_0000f.exr").colour
    np.testing.assert_array_equal(
        images.read_image(made / "perspective/exr/view_0000f.exr").colour, bare
    )


def test_validation_takes_them_and_refuses_values_beyond_1(made, tmp_path):
    folder = tmp_path / "scene" / "rig"
    shutil.copytree(made / "perspective", folder)
    assert validate(folder).valid
    path = folder / "roughness/view_0000f.exr"
    image = images.read_image(path)
    images.write_exr(path, {"Y": image.channels["Y"] + np.float16(0.75)}, image.attributes)
    (check,) = (check for check in validate(folder).checks if check.passed is False)
    assert (
        "roughness/view_0000f.exr" in check.problems[0]
        and "not between 0 and 1" in check.problems[0]
    )
