"""Cycles renders large views in tiles: they show the same as in one piece."""

import importlib

import numpy as np
import pytest
import simulated_gpus

from lightfield.formats.lightfield import LightField
from lightfield.formats.passes import PASSES
from lightfield.geometry import lenses

pytestmark = pytest.mark.slow

RENDER = {"samples": 4, "adaptive_threshold": 0, "denoise": False, "seed": 0, "max_bounces": 4}
CAMERAS = {
    "fisheye": {"lens": "equidistant", "fov": 180, "resolution": [72, 72]},
    "perspective": {"lens": "rectilinear", "fov": 80, "resolution": [72, 72]},
    "small fisheye": {"lens": "equidistant", "fov": 180, "resolution": [64, 64]},
}
# Of 3 × 3 tiles, none of which is as large as the view.
TILE = 32


@pytest.fixture
def set_up(room):
    """Return a function that opens the room for a camera, and returns the scene and its views."""
    from lightfield.rendering.setup import cycles

    def open_room(camera, path=room, device="cpu", **settings):
        lens = lenses.from_camera(CAMERAS[camera])
        rig = {"type": "plane", "cameras": [1, 1], "center": [0, 0, 1.5]}
        depth = "z" if lens.has_z_depth else "distance"
        lightfield = LightField.from_rig(rig, lens, depth=depth, frame=1, render=RENDER | settings)
        return cycles.set_up(path, None, lightfield, device, 1), lightfield

    return open_room


def images(opened, lightfield):
    """Return all images of the open scene's first view by name."""
    from lightfield.rendering.views.colour_pass import render_colour
    from lightfield.rendering.views.geometry_pass import render_geometry

    pose = lightfield.views[0].world_from_camera
    names = [each.name for each in lightfield.passes if not each.of_colour]
    geometry = render_geometry(opened, pose, names)
    colour = render_colour(opened, pose, 1, lightfield.passes)
    return {"colour": colour.pixels, "depth": geometry.depth, **colour.passes, **geometry.passes}


@pytest.mark.parametrize("camera", ["fisheye", "perspective"])
@pytest.mark.parametrize("window", [None, (10, 20, 57, 43)], ids=["whole", "window"])
@pytest.mark.parametrize(
    "settings",
    [
        {"passes": list(PASSES), "samples": 8},
        {"light_groups": {"top": ["lamp"]}},
        {"samples": 256, "adaptive_threshold": 0.03},
    ],
    ids=["passes", "light groups", "adaptive sampling"],
)
def test_tiles_change_no_pixel(set_up, camera, window, settings):
    import bpy

    from lightfield.rendering.setup import cycles

    rendered = []
    for tile in (2048, TILE):
        opened = set_up(camera, **settings)
        bpy.context.scene.cycles.tile_size = tile
        if window:
            cycles.set_window(*window)
        rendered.append(images(*opened))
    np.testing.assert_equal(rendered[1], rendered[0])


def test_a_blends_own_tiles_do_not_change_a_denoised_view(set_up, room, tmp_path):
    import bpy

    from lightfield.rendering.scenes import blend_file

    # Tiles of 32² change the last digits of this view after denoising.
    expected = images(*set_up("small fisheye", denoise=True))
    bpy.context.scene.cycles.tile_size = TILE
    blend_file.save_scene(tmp_path / "tiles.blend")
    changed = images(*set_up("small fisheye", tmp_path / "tiles.blend", denoise=True))
    np.testing.assert_equal(changed, expected)


@pytest.mark.parametrize(("device", "is_on_gpu"), [("cpu", False), ("cuda", True)])
def test_the_device_that_renders_also_denoises(set_up, tmp_path, monkeypatch, device, is_on_gpu):
    import bpy

    from lightfield.rendering.scenes import blend_file

    monkeypatch.setenv("PATH", str(tmp_path))
    devices = importlib.import_module("_cycles")
    monkeypatch.setattr(devices, "available_devices", simulated_gpus.available_devices)
    set_up("fisheye", denoise=True)
    bpy.context.scene.cycles.denoising_use_gpu = not is_on_gpu
    blend_file.save_scene(tmp_path / "denoised.blend")
    set_up("fisheye", tmp_path / "denoised.blend", device=device, denoise=True)
    assert bpy.context.scene.cycles.denoising_use_gpu == is_on_gpu
