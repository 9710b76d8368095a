"""What follows the camera follows the file's in all views, or each view's, as in Blender."""

import contextlib
import io
from types import SimpleNamespace

import blend_scenes
import camera_followers as followers
import numpy as np
import one_shard
import pytest
from test_blend_settings import difference, of_blender, open_file, save

from lightfield.configuration import keys
from lightfield.configuration.capture import LightfieldSettings
from lightfield.configuration.config_file import Preset
from lightfield.configuration.scene_yaml import Scene
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.imaging import images
from lightfield.planning.loading import datasets_of
from lightfield.rendering.views import lightfield_file
from lightfield.validation.validate import validate
from lightfield.workflow import job_settings

# What follows, and what the note names.
BY_NAME = {
    followers.track_to: "Billboard",
    followers.through_an_empty: "Sign",
    followers.parent: "Visor",
    followers.lamp: "Flash",
    followers.driver: "Driven",
    followers.driven_material: "Red",
    followers.named_by_nodes: "Named",
}
ACTIVE = {
    followers.driver_of_the_scene: "Driven",
    followers.driver_of_the_context: "Driven",
    followers.active_camera: "Turned",
    followers.culled: "Culled",
    followers.follow_track: "Tracked",
    followers.object_solver: "Tracked",
}
ALL = BY_NAME | ACTIVE
# The first view has the pose of the file's camera.
RIG = {
    "type": "path",
    "count": 2,
    "keys": [
        {"position": [0, -5, 1.2], "rotation": [np.degrees(1.35), 0, 0]},
        {"position": [1.2, -4.4, 1.6], "rotation": [72, 4, 20]},
    ],
    # The lens of the file's camera.
    "camera": {
        "lens": "rectilinear",
        "focal_length": 50,
        "sensor_size": [36, 27],
        "resolution": list(blend_scenes.SIZE),
    },
}
EQUAL = 0.003
DIFFERENT = 0.01


def dataset(path, folder, change=None, **scene):
    """Render the views of a .blend with a change into ``folder``. Return them and the notes."""
    from lightfield.rendering.inspection import inventory_file

    save(path, blend_scenes.studio, change)
    content = {
        "scene": {
            "blend": str(path),
            "url": "https://example.org/a.blend",
            "sha256": sha256(path),
            **scene,
        },
        "render": {"samples": blend_scenes.SAMPLES, "seed": 0},
        "rigs": {"views": RIG},
    }
    written = Scene.model_validate(content)
    (made,) = datasets_of("tried", written, "full", Preset(), {})
    inventory = path.with_suffix(".json")
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        settings = job_settings.inventory(made)
        inventory_file.write(path, settings, [made], inventory, False)
    views = lightfield_file.from_settings(LightfieldSettings.of_capture(made), inventory)
    with contextlib.redirect_stderr(io.StringIO()):
        one_shard.render(views, folder, path, inventory=inventory)
    pictures = []
    for view in views.views:
        image = images.read_image(folder / "exr" / f"{view.name}.exr", "RGB")
        pictures.append(np.stack([image.channels[name] for name in "RGB"], axis=-1))
    return SimpleNamespace(lightfield=views, pictures=pictures, said=said.getvalue())


def of_blender_itself(path, view, prepare):
    """Return Blender's picture of a .blend, after ``prepare`` has placed a camera in the view."""
    import bpy
    from mathutils import Matrix

    open_file(path)
    prepare(Matrix(view.world_from_camera.tolist()))
    bpy.context.scene.cycles.seed = keys.view_seed(0, view.name)
    there = path.with_name("there.blend")
    bpy.ops.wm.save_as_mainfile(filepath=str(there), copy=True)
    return of_blender(there, "OPEN_EXR")


def move_the_camera(matrix):
    """Move the file's own camera, which all that follows it sees."""
    import bpy

    bpy.context.scene.camera.matrix_world = matrix


def freeze_and_look_elsewhere(matrix):
    """Turn what the file's camera evaluates into things that follow nothing. Add a camera."""
    import bpy

    scene = bpy.context.scene
    graph = bpy.context.evaluated_depsgraph_get()
    places = {obj: obj.evaluated_get(graph).matrix_world.copy() for obj in scene.objects}
    meshes = {
        obj: bpy.data.meshes.new_from_object(
            obj.evaluated_get(graph), preserve_all_data_layers=True, depsgraph=graph
        )
        for obj in scene.objects
        if obj.type == "MESH"
    }
    for obj, place in places.items():
        obj.animation_data_clear()
        obj.modifiers.clear()
        obj.constraints.clear()
        obj.parent = None
        obj.matrix_world = place
        if obj in meshes:
            obj.data = meshes[obj]
    for material in bpy.data.materials:
        material.node_tree.animation_data_clear()
    scene.camera = bpy.data.objects.new("Elsewhere", scene.camera.data)
    scene.camera.matrix_world = matrix
    scene.collection.objects.link(scene.camera)


@pytest.mark.slow
@pytest.mark.parametrize("change", ALL)
def test_all_views_show_what_follows_the_files_camera(change, tmp_path):
    path = tmp_path / "scene.blend"
    made = dataset(path, tmp_path, change)
    assert f"{ALL[change]} follows the file's camera in all views" in made.said
    for view, picture in zip(made.lightfield.views, made.pictures, strict=True):
        expected = of_blender_itself(path, view, freeze_and_look_elsewhere)
        assert difference(picture, expected) < EQUAL
    # Otherwise the case would prove nothing.
    moved = of_blender_itself(path, made.lightfield.views[1], move_the_camera)
    assert difference(expected, moved) > DIFFERENT


@pytest.mark.slow
@pytest.mark.parametrize("change", ALL)
def test_each_view_shows_what_follows_its_own_camera_if_the_yaml_says_so(change, tmp_path):
    path = tmp_path / "scene.blend"
    made = dataset(path, tmp_path, change, followed_camera="view")
    assert f"{ALL[change]} follows each view's camera" in made.said
    for view, picture in zip(made.lightfield.views, made.pictures, strict=True):
        assert difference(picture, of_blender_itself(path, view, move_the_camera)) < EQUAL
    checks = {check.name: check for check in validate(tmp_path).checks}
    assert checks["geometry"].passed is None
    assert "each view shows another scene" in checks["geometry"].detail


def look_elsewhere(matrix):
    """Add a camera."""
    import bpy

    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("Elsewhere", scene.camera.data)
    scene.camera.matrix_world = matrix
    scene.collection.objects.link(scene.camera)


@pytest.mark.slow
def test_adaptive_subdivision_is_for_each_view_unless_the_file_names_a_camera(tmp_path):
    other_view = {}
    for change in (followers.diced_for_the_view, followers.diced_for_another_camera):
        folder = tmp_path / change.__name__
        folder.mkdir()
        path = folder / "scene.blend"
        made = dataset(path, folder, change)
        for view, picture in zip(made.lightfield.views, made.pictures, strict=True):
            expected = of_blender_itself(path, view, look_elsewhere)
            assert difference(picture, expected) < EQUAL
        other_view[change] = picture
    assert difference(*other_view.values()) > DIFFERENT


@pytest.mark.slow
def test_what_the_viewport_hides_is_found_and_what_nothing_follows_is_not_named(tmp_path):
    import bpy

    def hidden():
        followers.active_camera()
        bpy.data.objects["Turned"].hide_viewport = True

    made = dataset(tmp_path / "hidden.blend", tmp_path / "hidden", hidden)
    assert "Turned follows the file's camera" in made.said
    assert made.lightfield.scene["followed_camera"] == "file"
    made = dataset(tmp_path / "plain.blend", tmp_path / "plain", followed_camera="view")
    assert "follow" not in made.said
    assert "followed_camera" not in made.lightfield.scene


@pytest.mark.slow
def test_a_muted_link_from_the_active_camera_stays_muted(tmp_path):
    path = tmp_path / "scene.blend"
    made = dataset(path, tmp_path, followers.muted)
    assert "Turned follow the file's camera in all views" in made.said
    for view, picture in zip(made.lightfield.views, made.pictures, strict=True):
        expected = of_blender_itself(path, view, freeze_and_look_elsewhere)
        assert difference(picture, expected) < EQUAL


@pytest.mark.slow
def test_outlines_can_be_kept_at_the_files_camera(tmp_path):
    for choice, said in (
        ("file", "the file's camera in all views"),
        ("view", "each view's camera"),
    ):
        folder = tmp_path / choice
        folder.mkdir()
        made = dataset(folder / "scene.blend", folder, followers.line_art, followed_camera=choice)
        assert f"Lines follows {said}" in made.said
        assert made.lightfield.scene["followed_camera"] == choice


@pytest.mark.slow
def test_keys_change_only_where_pictures_do(tmp_path):
    """What names the file's camera follows that one without the key."""
    scene = {
        choice: dataset(
            tmp_path / f"{name}.blend", tmp_path / f"{name}", followers.track_to, **keys
        ).lightfield.scene
        for name, (choice, keys) in enumerate(
            {
                None: {},
                "file": {"followed_camera": "file"},
                "view": {"followed_camera": "view"},
            }.items()
        )
    }
    assert [each.get("followed_camera") for each in scene.values()] == [None, None, "view"]


@pytest.mark.slow
def test_a_file_without_a_camera_is_refused_if_something_would_follow_it(tmp_path):
    import bpy

    def without_camera():
        followers.active_camera()
        bpy.data.objects.remove(bpy.context.scene.camera)

    with pytest.raises(UserError) as refusal:
        dataset(tmp_path / "scene.blend", tmp_path, without_camera)
    message = str(refusal.value)
    assert message.startswith(f"{tmp_path / 'scene.blend'}: ")
    assert "Turned" in message
    assert "scene: {followed_camera: view}" in message
    made = dataset(tmp_path / "scene.blend", tmp_path, without_camera, followed_camera="view")
    first, second = made.pictures
    assert difference(first, second) > DIFFERENT


@pytest.mark.slow
def test_what_cannot_be_kept_at_the_files_camera_is_refused(tmp_path, monkeypatch):
    from lightfield.rendering.setup import followed_camera

    monkeypatch.setattr(followed_camera, "freeze", lambda camera: None)
    with pytest.raises(UserError, match="Turned: would follow each view's camera"):
        dataset(tmp_path / "scene.blend", tmp_path, followers.active_camera)


@pytest.mark.parametrize(
    ("key", "value"), [("flow", {"pairs": "neighbours"}), ("mesh", {"formats": ["glb"]})]
)
def test_what_needs_one_scene_for_all_views_is_refused_without_it(key, value):
    content = {
        "scene": {"blend": "scene.blend", "followed_camera": "view"},
        "render": {"samples": 1},
        "rigs": {"views": RIG},
        key: value,
    }
    with pytest.raises(ValueError, match=f"{key}: needs one scene for all views"):
        Scene.model_validate(content)
    content["scene"]["followed_camera"] = "file"
    Scene.model_validate(content)
