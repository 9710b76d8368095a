"""Lenses that Cycles lacks, rendered by a shader: against Cycles' own lenses, and their rays."""

import importlib
import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import simulated_gpus
from checkouts import checkout, snakemake
from scipy.ndimage import binary_dilation

from lightfield.core.errors import UserError
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.geometry.lenses.cube_map import CubeMap

pytestmark = pytest.mark.slow

SIZE = 64
RENDER = {"samples": 16, "adaptive_threshold": 0, "denoise": False, "seed": 0}
RIG = {"type": "lattice", "cameras": [1, 1, 1], "center": [0.3, -0.2, 0.1], "rotation": [20, 5, 50]}
# Lenses of Cycles, which the shader renders as well.
BOTH = {
    "rectilinear": {"lens": "rectilinear", "fov": 80, "principal_point": [28.4, 37.1]},
    "equidistant": {"lens": "equidistant", "fov": 220, "principal_point": [34.5, 30.2]},
    "equisolid": {"lens": "equisolid", "fov": 200, "focal_length": 8},
    "polynomial": {
        "lens": "polynomial",
        "fov": 180,
        "coefficients": [-1.17e-05, -0.0199887, -3.3525e-06, 3.09927e-06, -2.60646e-08],
    },
}
# Lenses that only the shader renders.
LACKING = {
    "stereographic": {"lens": "stereographic", "fov": 200, "principal_point": [35.3, 29.1]},
    "orthographic": {"lens": "orthographic", "fov": 180},
    "kannala_brandt": {
        "lens": "kannala_brandt",
        "focal_length": 11,
        "coefficients": [-0.01, 0.03, -0.02, 0.003],
        "fov": 200,
        "sensor_size": [36, 30],
    },
    "division": {"lens": "division", "focal_length": 11, "coefficients": [-0.35]},
    "fov_model": {"lens": "fov_model", "focal_length": 14, "coefficients": [0.93]},
    "unified": {"lens": "unified", "focal_length": 20, "coefficients": [0.9]},
    "extended_unified": {
        "lens": "extended_unified",
        "focal_length": 9,
        "coefficients": [0.628, 1.023],
    },
    "double_sphere": {
        "lens": "double_sphere",
        "focal_length": 9,
        "coefficients": [-0.172, 0.593],
        "principal_point": [30.3, 33.6],
    },
    "f_theta": {
        "lens": "f_theta",
        "focal_length": 11,
        "coefficients": [0.01, -0.02, 0.003, -0.001],
    },
    # These are not radial.
    "brown_conrady": {
        "lens": "brown_conrady",
        "focal_length": 22,
        "coefficients": [-0.283, 0.074, 0.004, -0.002],
        "principal_point": [31.3, 33.1],
    },
    "thin_prism_fisheye": {
        "lens": "thin_prism_fisheye",
        "focal_length": 14,
        "coefficients": [0.02, -0.03, 0.002, -0.001, 0.01, -0.002, 0.002, -0.001],
        "fov": 170,
    },
    "fisheye624": {
        "lens": "fisheye624",
        "focal_length": 13.6,
        "coefficients": [0.02, -0.03, 0.01, 0, 0, 0, 4e-3, -3e-3, 6e-3, -1e-3, -5e-3, 2e-3],
    },
}


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A .blend: a room whose walls glow in waves, a ball that moves, and an artist's camera."""
    import bpy

    from lightfield.rendering.scenes import blend_file

    bpy.ops.wm.read_factory_settings(use_empty=True)
    material = bpy.data.materials.new("waves")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    waves = nodes.new("ShaderNodeTexChecker")
    waves.inputs["Scale"].default_value = 7.3
    glow = nodes.new("ShaderNodeEmission")
    links.new(nodes.new("ShaderNodeNewGeometry").outputs["Position"], waves.inputs["Vector"])
    links.new(waves.outputs["Color"], glow.inputs["Color"])
    links.new(glow.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    bpy.ops.mesh.primitive_cube_add(size=2)
    bpy.context.object.data.materials.append(material)
    room = bpy.context.object
    for frame, place in enumerate([(-0.03, 0.01, 0), (0, 0, 0), (0.02, 0, 0.01)]):
        room.location = place
        room.keyframe_insert("location", frame=frame)
    backdrop = bpy.data.materials.new("backdrop")
    backdrop.use_nodes = True
    links = backdrop.node_tree.links
    window = backdrop.node_tree.nodes.new("ShaderNodeTexCoord").outputs["Window"]
    links.new(window, backdrop.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
    # Behind the wall.
    bpy.ops.mesh.primitive_plane_add(size=0.1, location=(0, 0, 3))
    bpy.context.object.data.materials.append(backdrop)
    camera = bpy.data.cameras.new("artist")
    camera.lens = 24
    camera.dof.use_dof = True
    camera.dof.focus_distance = 0.7
    camera.dof.aperture_fstop = 0.1
    bpy.context.scene.camera = bpy.data.objects.new("artist", camera)
    bpy.context.scene.collection.objects.link(bpy.context.scene.camera)
    bpy.context.scene.frame_set(1)
    path = tmp_path_factory.mktemp("waves") / "waves.blend"
    blend_file.save_scene(path)
    return path


@pytest.fixture
def render(scene, monkeypatch):
    """Return a function that renders the first view of a camera, natively or by the shader."""

    def rendered(camera, by_shader=True, device="cpu", **settings):
        import bpy

        from lightfield.rendering.setup import cycles
        from lightfield.rendering.views import geometry_pass
        from lightfield.rendering.views.view import render_view

        lens = lenses.from_camera({"resolution": [SIZE, SIZE], **camera})
        if by_shader:
            monkeypatch.setattr(type(lens), "in_cycles", False)
        lightfield = LightField.from_rig(
            RIG, lens, depth="distance", frame=1, render=RENDER | settings, scene={}
        )
        opened = cycles.set_up(scene, None, lightfield, device, 1)
        pose = lightfield.views[0].world_from_camera
        passes = settings.get("passes", [])
        geometry = geometry_pass.render_geometry(opened, pose, passes)
        light = render_view(opened, pose, 5, {"Combined": "RGB"}).passes["Combined"]
        bpy.context.scene.view_layers[0].use_pass_position = True
        bpy.context.scene.view_layers[0].use_pass_z = True
        bpy.context.scene.camera.data.dof.use_dof = False
        bpy.context.scene.cycles.samples = 1
        bpy.context.scene.cycles.filter_width = 0.01
        hit = render_view(opened, pose, 0, {"Position": "XYZ", "Depth": "Z"}).passes
        offset = hit["Position"] - pose[:3, 3]
        distance = np.linalg.norm(offset, axis=-1)
        missed = hit["Depth"][..., 0] >= geometry_pass.MISS
        with np.errstate(invalid="ignore", divide="ignore"):
            rays = (offset / distance[..., None]) @ pose[:3, :3]
        return Picture(
            lens,
            light,
            geometry.depth,
            np.where(missed, np.nan, distance),
            np.where(missed[..., None], np.nan, rays),
            geometry.passes,
            opened,
            pose,
        )

    return rendered


@dataclass
class Picture:
    """A rendered view: its light, depth, and what its rays hit."""

    lens: object
    light: np.ndarray
    depth: np.ndarray
    distance: np.ndarray
    rays: np.ndarray
    passes: dict
    opened: object
    pose: np.ndarray


def angles(first, second):
    """Return the angles between unit rays, accurate even for tiny angles."""
    half = np.linalg.norm(first - second, axis=-1) / np.linalg.norm(first + second, axis=-1)
    return 2 * np.arctan(half)


def check_rays(picture):
    """Check that a view's pixels look where the lens says, and see nothing where it has no ray."""
    rays = picture.lens.pixel_rays()
    seen = np.isfinite(rays[..., 0])
    np.testing.assert_array_equal(np.isfinite(picture.rays[..., 0]), seen)
    assert seen.any()
    # At the rim of an orthographic lens, the last digit of a pixel's place is 5e-6 rad.
    assert np.quantile(angles(rays, picture.rays)[seen], 0.99) < 2e-6
    places = np.indices(seen.shape)[::-1].transpose(1, 2, 0) + 0.5
    # Rounding may move a ray of the rim out of the lens.
    assert np.nanmax(np.abs(picture.lens.pixels(picture.rays) - places)[seen]) < 1e-4
    assert np.isinf(picture.depth[~seen]).all()
    # The pixel filter mixes light over the rim.
    assert not picture.light[~binary_dilation(seen, iterations=2)].any()
    np.testing.assert_allclose(picture.depth[seen], picture.distance[seen], rtol=2e-6)


@pytest.mark.parametrize("name", BOTH)
def test_the_shader_shows_what_cycles_own_lens_shows(name, render):
    native = render(BOTH[name], by_shader=False)
    shown = render(BOTH[name])
    check_rays(shown)
    seen = np.isfinite(shown.depth)
    # Cycles' own rays differ from the lens's by more than the shader's do.
    assert angles(native.rays, shown.rays)[seen].max() < 2e-5
    assert np.abs(native.distance - shown.distance)[seen].max() < 1e-4
    # The same seed sends the same samples, so the edges of the tiles alone may differ.
    assert np.sqrt(np.mean((native.light - shown.light) ** 2)) < 0.002


@pytest.mark.parametrize("name", LACKING)
def test_a_lens_that_cycles_lacks_looks_where_it_should(name, render):
    check_rays(render(LACKING[name]))


def test_a_wide_image_has_the_same_rays(render):
    check_rays(render(LACKING["stereographic"] | {"resolution": [80, 40]}))


def test_motion_is_in_pixels_as_with_cycles_own_lens(render):
    native = render(BOTH["equidistant"], by_shader=False, passes=["motion"]).passes["motion"]
    shown = render(BOTH["equidistant"], passes=["motion"])
    lens, motion = shown.lens, shown.passes["motion"]
    theta = np.arccos(-lens.pixel_rays()[..., 2])
    # Cycles does not tell on which side of the camera's plane a surface was.
    clear = np.isfinite(shown.depth) & (np.abs(theta - math.pi / 2) > 0.1)
    pixels = np.indices(clear.shape)[::-1].transpose(1, 2, 0) + 0.5
    leaving = 0
    for part in (slice(0, 2), slice(2, 4)):
        x, y = np.moveaxis(pixels + native[..., part], -1, 0)
        stays = np.isfinite(lens.rays(x, y)[..., 0])
        leaving += (clear & ~stays).sum()
        assert not motion[~np.isfinite(shown.depth) | (clear & ~stays), part].any()
        assert np.abs(native[clear & stays, part]).max() > 0.5
        assert np.abs((native - motion)[clear & stays, part]).max() < 3e-4
    assert leaving


@pytest.mark.parametrize("name", ["rectilinear", "equidistant"])
def test_depth_of_field_is_that_of_cycles_own_lens(name, render):
    sharp = render(BOTH[name], samples=64)
    native = render(BOTH[name], by_shader=False, samples=64, depth_of_field=True)
    shown = render(BOTH[name], samples=64, depth_of_field=True)
    check_rays(sharp)
    blur = np.sqrt(np.mean((sharp.light - native.light) ** 2))
    assert blur > 0.05
    assert np.sqrt(np.mean((shown.light - native.light) ** 2)) < 0.01 * blur
    # Depth is sharp.
    np.testing.assert_allclose(shown.depth, sharp.depth, rtol=1e-6)


def test_a_perspective_lens_with_distortion_focuses_on_a_plane(render):
    own = {"lens": "rectilinear", "focal_length": 21}
    native = render(own, by_shader=False, samples=64, depth_of_field=True)
    undistorted = {"lens": "division", "focal_length": 21, "coefficients": [0]}
    shown = render(undistorted, samples=64, depth_of_field=True)
    assert np.sqrt(np.mean((shown.light - native.light) ** 2)) < 0.001


def test_a_shader_that_cycles_cannot_run_is_refused(render, monkeypatch):
    devices = importlib.import_module("_cycles")

    def compile_badly(_, path):
        Path(path).write_text("OpenShadingLanguage 1.00\nno code\n")
        return True

    monkeypatch.setattr(devices, "osl_compile", compile_badly)
    with pytest.raises(UserError, match=r"camera: Cycles cannot run the shader"):
        render(LACKING["stereographic"])
    monkeypatch.setattr(devices, "osl_compile", lambda *_: False)
    with pytest.raises(UserError, match=r"camera: Blender cannot compile the shader"):
        render(LACKING["stereographic"])


def test_only_optix_and_processors_render_a_lens_that_cycles_lacks(render, monkeypatch, tmp_path):
    # No nvidia-smi.
    monkeypatch.setenv("PATH", str(tmp_path))
    devices = importlib.import_module("_cycles")
    monkeypatch.setattr(devices, "available_devices", simulated_gpus.available_devices)
    with pytest.raises(UserError) as refused:
        render(LACKING["stereographic"], device="cuda")
    message = str(refused.value)
    assert message.startswith("device: ") and "\n" not in message
    for word in ("cuda", "stereographic", "optix", "cpu", "equidistant", "reproject"):
        assert word in message


@pytest.mark.parametrize("name", ["equidistant", "stereographic"])
def test_a_material_that_reads_the_window_is_named(name, scene, run_program, tmp_path):
    lens = lenses.from_camera({"resolution": [SIZE, SIZE], **(BOTH | LACKING)[name]})
    LightField.from_rig(RIG, lens, frame=1, scene={}).write(tmp_path / "lightfield.json")
    arguments = ("--blend", scene, "--lightfield", tmp_path / "lightfield.json")
    result = run_program("check_cameras.py", *arguments, "--output", tmp_path / "cameras.json")
    warned = [line for line in result.stderr.splitlines() if "Window" in line]
    if name == "equidistant":
        assert not warned
    else:
        (line,) = warned
        assert line.startswith("warning: backdrop: ") and "stereographic" in line


DATASET = """
licence: CC0-1.0
scene: {builder: room}
render: {samples: 4, passes: [normal, motion]}
rigs:
  LFPlane:
    type: plane
    cameras: [2, 2]
    size: 0.5
    center: [0, 0, 1.2]
    camera:
      {lens: stereographic, fov: 200, resolution: [48, 48], principal_point: [25.5, 22.25]}
reprojections:
  perspective:
    camera: {lens: rectilinear, fov: 80, resolution: [32, 32]}
    format: exr
report: {panorama: false}
"""


def test_a_dataset_through_a_lens_that_cycles_lacks_is_built_and_valid(tmp_path):
    folder = checkout(tmp_path / "plenoforge", lens=DATASET)
    target = "results/lens/LFPlane/validation.json"
    chosen = ("--config", "scenes=[lens]", "rigs=all", "preset=full")
    result = snakemake(folder, "--cores", "2", target, *chosen)
    assert result.returncode == 0, result.stdout + result.stderr
    validation = json.loads((folder / target).read_text())
    assert validation["valid"], validation
    (geometry,) = (check for check in validation["checks"] if check["name"] == "geometry")
    assert geometry["figures"]["points"] > 1000
    assert geometry["figures"]["agree"] == 1


def test_a_window_of_a_view_shows_what_the_whole_view_shows(render):
    from lightfield.rendering.setup import cycles
    from lightfield.rendering.views.geometry_pass import render_geometry

    whole = render(LACKING["stereographic"])
    cycles.set_window(3, 20, 50, 25)
    depth = render_geometry(whole.opened, whole.pose).depth
    np.testing.assert_array_equal(depth, whole.depth[20:45, 3:53])


def test_drawings_are_left_out_as_through_fisheyes(render):
    import bpy

    for camera, shows in ((BOTH["rectilinear"], True), (LACKING["stereographic"], False)):
        render(camera, by_shader=False)
        assert bpy.context.scene.view_layers[0].use_grease_pencil == shows


def test_a_cube_map_is_refused(scene):
    from lightfield.rendering.setup import cycles

    lightfield = LightField.from_rig(RIG, CubeMap(width=96, height=16), frame=1, render=RENDER)
    with pytest.raises(UserError, match=r"camera: nothing renders a cube map; reproject"):
        cycles.set_up(scene, None, lightfield, "cpu", 1)


def test_the_scene_keeps_nothing_of_the_test_of_a_shader(render):
    import bpy

    render(LACKING["stereographic"])
    assert len(bpy.data.scenes) == 1
    assert not [obj.name for obj in bpy.data.objects if "test" in obj.name]
