"""Transparent views of a cube on a shadow catcher, whose depth is known at every pixel."""

import shutil

import numpy as np
import one_shard
import pytest

from lightfield.core.errors import UserError
from lightfield.export.points import lift
from lightfield.export.source import SourceDataset
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses, rigs
from lightfield.imaging import images
from lightfield.validation import validate as validation

pytestmark = pytest.mark.slow

SIZE = 96
# The cube is 1 m wide and stands on the ground, z = 0. The sun shines along this direction.
TO_SUN = np.array([0.5, -0.3, 0.8]) / np.linalg.norm([0.5, -0.3, 0.8])
PASSES = ["normal", "object", "material", "instance", "cryptomatte", "albedo"]
CAMERA = {"lens": "rectilinear", "fov": 40, "resolution": [SIZE, SIZE]}
RENDER = {
    "samples": 4,
    "seed": 0,
    "adaptive_threshold": 0,
    "denoise": False,
    "depth_precision": "float",
    "transparent": True,
    "passes": PASSES,
}
# With less alpha than this a pixel shows nothing, as docs/reference/files.md says.
NOTHING = 0.001


def write_scene(path):
    """Save a .blend of the cube on the ground, in the light of a sun without size."""
    import bpy
    from mathutils import Vector

    from lightfield.rendering.scenes import blend_file

    blend_file.new_scene()
    bpy.ops.mesh.primitive_plane_add(size=12)
    ground = bpy.context.object
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 0, 0.5))
    for obj in (ground, bpy.context.object):
        obj.name = "ground" if obj == ground else "cube"
        obj.data.materials.append(bpy.data.materials.new(obj.name))
    bpy.ops.object.light_add(type="SUN")
    sun = bpy.context.object
    sun.data.angle = 0
    sun.rotation_euler = Vector(TO_SUN).to_track_quat("Z", "Y").to_euler()
    ground.is_shadow_catcher = True
    blend_file.save_scene(path)


@pytest.fixture(scope="module")
def rendered(tmp_path_factory, run_program):
    """A dataset of views all around the cube, some of them from below, without its .blend."""

    folder = tmp_path_factory.mktemp("catcher") / "dataset"
    blend = folder.parent / "catcher.blend"
    write_scene(blend)
    rig = {
        "type": "sphere",
        "subdivisions": 1,
        "size": 7,
        "face_inside": True,
        "center": [0, 0, 0.5],
        "camera": CAMERA,
    }
    views = LightField.from_rig(
        rigs.from_settings(rig), lenses.from_camera(CAMERA), frame=1, render=RENDER, depth="z"
    ).with_flow()
    one_shard.render(views, folder, blend, threads=2)
    run_program("flow.py", "--lightfield", folder / "lightfield.json", "--output", folder / "flow")
    return folder


def planes(folder, name, view):
    image = images.read_image(folder / name / f"{view.name}.exr")
    return {channel: pixels.astype(np.float64) for channel, pixels in image.channels.items()}


def of_cube(origin, rays):
    """Return the distance at which unit rays (..., 3) from ``origin`` (..., 3) meet the cube."""
    low, high = np.array([-0.5, -0.5, 0]), np.array([0.5, 0.5, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        ways = np.stack([(low - origin) / rays, (high - origin) / rays])
    first = np.nanmax(ways.min(axis=0), axis=-1)
    last = np.nanmin(ways.max(axis=0), axis=-1)
    return np.where((first < last) & (last > 0), first, np.inf)


def true_distances(lightfield, view):
    """Return the distances (h, w) to the cube and to the ground along the pixels' rays, in m."""
    rays = lightfield.lens.pixel_rays() @ view.world_from_camera[:3, :3].T
    away = -view.position[2] / rays[..., 2]
    at = view.position + rays * away[..., None]
    is_ground = (away > 0) & (np.abs(at[..., :2]) < 6).all(axis=-1)
    return of_cube(view.position, rays), np.where(is_ground, away, np.inf), at


def in_sun(points, margin):
    """Return which points (..., 3) of the ground the sun reaches, farther than ``margin`` from a
    shadow's edge, in metres."""
    around = margin * np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), -1).reshape(-1, 2)
    shifted = points[..., None, :] + np.pad(around, ((0, 0), (0, 1)))
    return np.isinf(of_cube(shifted, TO_SUN)).all(axis=-1)


def test_a_ground_that_the_picture_does_not_show_is_no_surface(rendered):
    lightfield = LightField.read(rendered / "lightfield.json")
    counts = np.zeros(3, int)
    for view in lightfield.views:
        image = planes(rendered, "exr", view)
        depth = image["Z"]
        cosine = -lightfield.lens.pixel_rays()[..., 2]
        cube, ground, at = true_distances(lightfield, view)
        is_hit = np.isfinite(depth)
        true_depth = np.minimum(cube, ground) * cosine
        np.testing.assert_allclose(depth[is_hit], true_depth[is_hit], rtol=1e-5)
        assert not (is_hit & (image["A"] < NOTHING)).any()
        is_cube = cube < ground
        # A few pixels show the cube so little that no sample meets it.
        assert (is_hit | (image["A"] < NOTHING))[is_cube].all()
        # From below, all of the ground is in the shadow.
        is_ground = ~is_cube & np.isfinite(ground) & (view.position[2] > 0)
        is_sunny = in_sun(at, 0.05)
        assert not is_hit[is_ground & is_sunny].any()
        counts += [is_cube.sum(), (is_ground & is_sunny).sum(), (is_hit & is_ground).sum()]
    assert (counts > 2000).all()


def test_all_passes_of_a_surface_miss_it(rendered):
    lightfield = LightField.read(rendered / "lightfield.json")
    seen = 0
    for view in lightfield.views:
        shown = planes(rendered, "exr", view)["A"] >= NOTHING
        seen += int((~shown).sum())
        for name in PASSES:
            for channel, pixels in planes(rendered, name, view).items():
                assert not pixels[~shown].any(), (view.name, name, channel)
    assert seen > 10_000


def test_no_exported_point_is_on_the_invisible_ground(rendered):
    views = LightField.read(rendered / "lightfield.json").views
    # From below, all of the ground is in the shadow.
    above = {view.name: view.name for view in views if view.position[2] > 0}
    points = lift(SourceDataset(rendered, "", ".exr", renamed=above), count=3000).positions
    on_ground = points[np.abs(points[:, 2]) < 1e-3]
    assert len(points) > 1000
    assert len(on_ground) > 100
    assert not in_sun(on_ground, 0.05).any()


def test_views_around_it_agree(rendered, reproject_dataset, tmp_path):
    """A view from below shows nothing of the cube, which the ground hides."""
    folder = tmp_path / "dataset"
    shutil.copytree(rendered, folder)
    camera = {"lens": "equidistant", "fov": 40, "resolution": [SIZE, SIZE]}
    reproject_dataset(folder, folder / "fisheye", {"camera": camera, "formats": ["exr"]})
    result = validation.validate(folder, ["fisheye"])
    checks = {check.name: check for check in result.checks}
    for name in ("geometry", "passes", "fisheye/geometry", "fisheye/images", "fisheye/source"):
        assert checks[name].passed, (name, checks[name].problems)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("roughness", "whose values are wrong in roughness; "),
        ("variance", "whose shadows are no means of samples, as variance needs; "),
    ],
)
def test_passes_that_a_shadow_catcher_spoils_are_refused(name, reason, tmp_path):
    from lightfield.rendering.setup import cycles

    write_scene(tmp_path / "catcher.blend")
    content = {**lenses.from_camera(CAMERA).to_lightfield(), "frame": 1}
    lightfield = LightField({**content, "render": RENDER | {"passes": [name]}}, [])
    refusal = f"^render.passes: ground is a shadow catcher, {reason}"
    with pytest.raises(UserError, match=refusal):
        cycles.set_up(tmp_path / "catcher.blend", None, lightfield, "cpu", 1)


@pytest.mark.parametrize("transparent", [True, False])
def test_a_holdout_is_no_surface(transparent, tmp_path):
    import bpy

    from lightfield.rendering.scenes import blend_file

    path = tmp_path / "holdout.blend"
    write_scene(path)
    bpy.data.objects["ground"].is_shadow_catcher = False
    bpy.data.objects["cube"].is_holdout = True
    blend_file.save_scene(path)
    rig = {"type": "plane", "cameras": [1, 1], "center": [0, -4, 0.5]}
    render = RENDER | {"transparent": transparent, "passes": ["object"]}
    lightfield = LightField.from_rig(
        rigs.from_settings(rig), lenses.from_camera(CAMERA), frame=1, render=render, depth="z"
    )
    one_shard.render(lightfield, tmp_path, path)
    (view,) = lightfield.views
    cube, ground, _ = true_distances(lightfield, view)
    image = planes(tmp_path, "exr", view)
    is_cube = cube < ground
    assert is_cube.sum() > 500
    assert np.isinf(image["Z"][is_cube]).all()
    assert not planes(tmp_path, "object", view)["Y"][is_cube].any()


def as_object(cube):
    cube.is_holdout = True


def as_collection(cube):
    import bpy

    holes = bpy.data.collections.new("holes")
    bpy.context.scene.collection.children.link(holes)
    holes.objects.link(cube)
    bpy.context.scene.collection.objects.unlink(cube)
    bpy.context.view_layer.layer_collection.children["holes"].holdout = True


def as_material(cube):
    nodes = cube.active_material.node_tree.nodes
    output = next(node for node in nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    hole = nodes.new("ShaderNodeHoldout")
    cube.active_material.node_tree.links.new(hole.outputs[0], output.inputs["Surface"])


@pytest.mark.parametrize("make", [as_object, as_collection, as_material])
@pytest.mark.parametrize("transparent", [True, False])
def test_views_around_a_holdout_agree(transparent, make, reproject_dataset, tmp_path):
    """A view shows nothing of the ground that the holdout hides, and other views show it."""
    import bpy

    from lightfield.rendering.scenes import blend_file

    path = tmp_path / "holdout.blend"
    write_scene(path)
    bpy.data.objects["ground"].is_shadow_catcher = False
    make(bpy.data.objects["cube"])
    blend_file.save_scene(path)
    rig = {"type": "ring", "count": 5, "size": 6, "elevation": 25, "look_at": [0, 0, 0.5]}
    lightfield = LightField.from_rig(
        rigs.from_settings(rig),
        lenses.from_camera(CAMERA),
        frame=1,
        render=RENDER | {"transparent": transparent, "passes": []},
        depth="z",
    )
    one_shard.render(lightfield, tmp_path, path)
    camera = {"lens": "equidistant", "fov": 40, "resolution": [SIZE, SIZE]}
    reproject_dataset(tmp_path, tmp_path / "fisheye", {"camera": camera, "formats": ["exr"]})
    checks = {check.name: check for check in validation.validate(tmp_path, ["fisheye"]).checks}
    for name in ("geometry", "colour", "fisheye/geometry", "fisheye/colour", "fisheye/source"):
        assert checks[name].passed, (name, checks[name].problems)
    # The check still finds a view with wrong depth.
    bad = tmp_path / "exr" / f"{lightfield.views[1].name}.exr"
    image = images.read_image(bad)
    channels = image.channels | {"Z": image.channels["Z"] * np.float32(1.1)}
    images.write_exr(bad, channels, image.attributes)
    checks = {check.name: check for check in validation.validate(tmp_path, []).checks}
    assert not checks["geometry"].passed
