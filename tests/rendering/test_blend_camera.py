"""The poses of a .blend's own camera beside Blender's own pictures."""

import blend_scenes
import numpy as np
import pytest
from test_blend_settings import difference, of_blender, save

from lightfield.configuration.config_file import Preset
from lightfield.configuration.scene_yaml import Scene
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses, rigs
from lightfield.planning.loading import datasets_of
from lightfield.workflow import job_settings

pytestmark = pytest.mark.slow


def inventory_of_path(path, frames, depth_of_field=False):
    """List what a .blend contains for a rig of its camera at ``frames``, (first, last) or None.

    Without frames, list it for a rig that only takes its depth of field.
    """
    from lightfield.rendering.inspection import inventory_file

    camera = {"lens": "rectilinear", "fov": 60, "resolution": [8, 8]}
    rig = {"type": "plane", "cameras": [1, 1], "camera": camera}
    if frames:
        first, last = frames
        rig = {"type": "blend_camera", "frames": {"first": first, "last": last}, "camera": camera}
    content = {
        "scene": {"blend": str(path), "url": "https://example.org/a.blend", "sha256": sha256(path)},
        "render": {"samples": 1, "depth_of_field": depth_of_field},
        "rigs": {"views": rig},
    }
    written = Scene.model_validate(content)
    datasets = datasets_of("tried", written, "full", Preset(), {})
    settings = job_settings.inventory(datasets[0])
    inventory_file.write(path, settings, datasets, path.with_suffix(".json"), False)


@pytest.mark.parametrize("mirror", [blend_scenes.mirrored_camera, blend_scenes.mirroring_parent])
def test_blender_mirrors_the_picture_that_is_refused(mirror, tmp_path):
    """A mirrored picture is not that of any pose: no view could be right."""
    save(tmp_path / "plain.blend", symmetric)
    save(tmp_path / "mirrored.blend", symmetric, mirror)
    plain = of_blender(tmp_path / "plain.blend", "OPEN_EXR")
    mirrored = of_blender(tmp_path / "mirrored.blend", "OPEN_EXR")
    assert difference(mirrored, plain) > 0.1
    # Samples fall elsewhere, so surfaces are compared on average.
    assert np.abs(mirrored[:, ::-1] - plain).mean() < 0.1 * np.abs(mirrored - plain).mean()


def symmetric():
    """Put the camera where a mirror in the plane x = 0 leaves it."""
    import bpy

    blend_scenes.studio()
    bpy.context.scene.camera.location.x = 0
    bpy.context.scene.cycles.samples = 64


def changing_camera():
    """Let a marker choose a second camera at frame 5, which a keyframe mirrors at frame 7."""
    import bpy

    blend_scenes.studio()
    scene = bpy.context.scene
    first = scene.camera
    second = bpy.data.objects.new("Second", first.data)
    second.matrix_world = first.matrix_world
    scene.collection.objects.link(second)
    for frame, camera in ((1, first), (5, second)):
        scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    for frame, scale in ((6, 1), (7, -1)):
        second.scale.y = scale
        second.keyframe_insert("scale", frame=frame)


def test_a_mirrored_camera_is_named_with_its_frame(tmp_path):
    path = tmp_path / "path.blend"
    save(path, changing_camera)
    inventory_of_path(path, (1, 6))
    with pytest.raises(UserError, match=r"path\.blend: the camera Second is mirrored at frame 7"):
        inventory_of_path(path, (1, 7))


def test_a_mirrored_camera_that_no_view_takes_is_allowed(tmp_path):
    path = tmp_path / "mirrored.blend"
    save(path, blend_scenes.studio, blend_scenes.mirrored_camera)
    inventory_of_path(path, None, depth_of_field=True)
    assert path.with_suffix(".json").exists()


@pytest.mark.parametrize(
    ("turn", "problem"),
    [
        (np.diag([1, -1, 1]), "its first 3 × 3 must be a rotation, and mirrors"),
        (
            np.array([[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]),
            "its first 3 × 3 must be a rotation",
        ),
    ],
)
def test_a_list_of_views_that_no_camera_sees_is_refused(turn, problem, tmp_path):
    camera = {"lens": "rectilinear", "fov": 60, "resolution": [8, 8]}
    rig = rigs.from_settings({"type": "plane", "cameras": [2, 1]})
    content = LightField.from_rig(rig, lenses.from_camera(camera)).to_json()
    matrix = np.array(content["frames"][1]["world_matrix"])
    matrix[:3, :3] = matrix[:3, :3] @ turn
    # Without its other form, nothing contradicts the matrix.
    content["frames"][1] = {"name": "odd", "world_matrix": matrix.tolist()}
    with pytest.raises(UserError) as refusal:
        LightField.from_json(content, tmp_path / "lightfield.json")
    place = f"{tmp_path}/lightfield.json: frames[1]: world_matrix: "
    assert str(refusal.value).startswith(place + problem)


@pytest.mark.parametrize(("frames", "depth_of_field"), [((1, 1), False), (None, True)])
def test_a_scene_without_the_camera_that_views_take_is_refused(frames, depth_of_field, tmp_path):
    def without_camera():
        import bpy

        bpy.data.objects.remove(bpy.context.scene.camera)

    path = tmp_path / "empty.blend"
    save(path, blend_scenes.studio, without_camera)
    with pytest.raises(UserError, match="has no camera"):
        inventory_of_path(path, frames, depth_of_field)
