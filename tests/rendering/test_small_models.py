"""The geometry between few views of small curved models, where the right poses are known."""

import json

import numpy as np
import one_shard
import pytest

from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses, rigs
from lightfield.validation import validate as validation

pytestmark = pytest.mark.slow

FOV = 40
AWAY = 3.0  # The size of the rig.


def cylinder():
    import bpy

    rotation = np.random.default_rng(1).uniform(-3, 3, 3)
    bpy.ops.mesh.primitive_cylinder_add(radius=0.2, depth=1, vertices=24, rotation=rotation)


def turned_cylinder():
    import bpy

    rotation = np.random.default_rng(2).uniform(-3, 3, 3)
    bpy.ops.mesh.primitive_cylinder_add(radius=0.2, depth=1, vertices=24, rotation=rotation)


def bumpy_ball():
    import bpy

    random = np.random.default_rng(3)
    bpy.ops.mesh.primitive_ico_sphere_add(
        radius=0.4, subdivisions=5, rotation=random.uniform(-3, 3, 3)
    )
    waves = random.normal(size=(6, 3)) * 12
    phases = random.uniform(0, 6, 6)
    for vertex in bpy.context.object.data.vertices:
        vertex.co *= 1 + 0.5 * float(np.mean(np.sin(waves @ np.array(vertex.co) + phases)))


def smooth_monkey():
    import bpy

    bpy.ops.mesh.primitive_monkey_add(size=1, rotation=np.random.default_rng(2).uniform(-3, 3, 3))
    modifier = bpy.context.object.modifiers.new("smooth", "SUBSURF")
    modifier.levels = modifier.render_levels = 2


def rendered(model, folder, size, count):
    """Render views of a model, without its colours. Return the size of a pixel at the origin."""
    import bpy

    from lightfield.rendering.scenes import blend_file

    blend_file.new_scene()
    model()
    bpy.ops.object.light_add(type="SUN")
    blend_file.save_scene(folder / "model.blend")
    camera = {"lens": "rectilinear", "fov": FOV, "resolution": [size, size]}
    rig = {"type": "hemisphere", "count": count, "size": AWAY}
    rig |= {"elevation": [-20, 70], "pattern": "fibonacci"}
    lightfield = LightField.from_rig(
        rigs.from_settings(rig),
        lenses.from_camera(camera),
        frame=1,
        render={"samples": 1, "seed": 0, "adaptive_threshold": 0, "denoise": False}
        | {"depth_precision": "float", "transparent": True},
        depth="z",
    )
    one_shard.render(lightfield, folder, folder / "model.blend")
    return AWAY * np.tan(np.radians(FOV / 2)) / size


def geometry(folder):
    checks = {check.name: check for check in validation.validate(folder, []).checks}
    return checks["geometry"]


@pytest.mark.parametrize(("size", "count"), [(96, 4), (192, 8)], ids=["small", "large"])
@pytest.mark.parametrize("model", [cylinder, turned_cylinder, bumpy_ball, smooth_monkey])
def test_right_views_of_a_curved_model_agree_and_half_a_pixel_is_found(
    model, size, count, tmp_path
):
    pixel = rendered(model, tmp_path, size, count)
    right = geometry(tmp_path)
    assert right.passed, right.problems
    path = tmp_path / "lightfield.json"
    content = json.loads(path.read_text())
    frame = content["frames"][0]
    aside = np.array(frame["world_matrix"])[:3, 0] * pixel / 2
    frame["position"] = (np.array(frame["position"]) + aside).tolist()
    for axis in range(3):
        frame["world_matrix"][axis][3] += aside[axis]
    path.write_text(json.dumps(content))
    assert frame["name"] in geometry(tmp_path).views
