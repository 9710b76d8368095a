"""Views of a model: Cycles renders only the part that can show it, and the bytes are the same."""

import numpy as np
import pytest

from lightfield.configuration import keys
from lightfield.configuration.family import Member
from lightfield.core.files import sha256
from lightfield.geometry.lenses import from_camera
from lightfield.imaging import images
from lightfield.stages.family import BatchSettings

# A thin pole with a wide foot, off its own origin.
POLE = """
v 3 0 0\nv 3.05 0 0\nv 3.02 0 2\nv 3 0.4 0\nv 2.8 -0.3 0.01\nv 3.4 0.1 0.02
f 1 2 3\nf 4 5 6
"""
RENDER = {"samples": 2, "transparent": True}
RIG = {"type": "ring", "count": 3, "size": 3, "elevation": 20}
CAMERA = {"lens": "rectilinear", "fov": 50, "resolution": [48, 32]}


@pytest.fixture
def build(tmp_path):
    """Return a function that builds a member with a model, and returns the folder of its views."""
    (tmp_path / "pole.obj").write_text(POLE)

    def build(name, scene=None, render=None, rig=None):
        from lightfield.family.member import MemberBuild

        content = {
            "scene": {"up": "z", **(scene or {})},
            "render": RENDER | (render or {}),
            "rigs": {"ring": {**RIG, "camera": CAMERA, **(rig or {})}},
        }
        member = Member(name="pole", model=str(tmp_path / "pole.obj"))
        settings = BatchSettings(
            family="poles",
            scene=content,
            members=[member],
            results=str(tmp_path / name / "results"),
            work=str(tmp_path / name / "work"),
        )
        record = MemberBuild(settings, member).build("cpu", 1)
        assert record["state"] == "valid", record
        return tmp_path / name / "results/poles/pole/ring/exr"

    return build


CASES = {
    "in the middle": {},
    "partly outside the view": {"rig": {"size": 1.5}},
    "around the cameras": {"scene": {"ground": True}},
    "lit by an environment": {"scene": {"light": "city"}},
    "of a size at which borders round": {"rig": {"camera": CAMERA | {"resolution": [97, 61]}}},
    "off the axis": {"rig": {"camera": CAMERA | {"principal_point": [10.5, 20]}}},
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_views_of_a_part_have_the_bytes_of_whole_views(build, monkeypatch, case):
    parts = build("parts", **CASES[case])
    monkeypatch.setattr(keys, "renders_part", lambda lightfield: False)
    whole = build("whole", **CASES[case])
    sums = [{path.name: sha256(path) for path in f.iterdir()} for f in (parts, whole)]
    assert len(sums[0]) == 3 and sums[0] == sums[1]


@pytest.mark.slow
def test_denoised_views_of_a_part_are_as_right_as_whole_ones_under_another_key(build, monkeypatch):
    def views(name, **render):
        return [images.read_image(path) for path in sorted(build(name, render=render).iterdir())]

    def error(denoised):
        pairs = zip(denoised, exact, strict=True)
        errors = [first.channels["R"] - other.channels["R"] for first, other in pairs]
        return np.sqrt(np.mean(np.square(errors, dtype=np.float64)))

    parts = views("parts", denoise=True, samples=8)
    monkeypatch.setattr(keys, "renders_part", lambda lightfield: False)
    whole = views("whole", denoise=True, samples=8)
    exact = views("exact", samples=1024)
    assert error(parts) < 1.1 * error(whole)
    for part, other in zip(parts, whole, strict=True):
        for name in "AZ":
            np.testing.assert_array_equal(part.channels[name], other.channels[name])
        assert part.attributes[images.KEY_ATTRIBUTE] != other.attributes[images.KEY_ATTRIBUTE]


# ---- which part, and when the whole -----------------------------------------------------------


@pytest.fixture
def scene():
    """An empty scene with a camera and a triangle from (−1, 0, −5) to (1, 1, −5)."""
    import bpy

    from lightfield.rendering.scenes import blend_file

    blend_file.new_scene()
    scene = bpy.context.scene
    mesh = bpy.data.meshes.new("triangle")
    mesh.from_pydata([(-1, 0, -5), (1, 0, -5), (0, 1, -5)], [], [(0, 1, 2)])
    camera = bpy.data.cameras.new("camera")
    for data in (mesh, camera):
        scene.collection.objects.link(bpy.data.objects.new(data.name, data))
    scene.camera = bpy.data.objects["camera"]
    return scene


LENS = from_camera({"lens": "rectilinear", "fov": 90, "resolution": [100, 100]})


@pytest.mark.slow
def test_a_part_has_the_model_and_a_margin(scene):
    from lightfield.rendering.views import visible_part

    part = visible_part.choose(visible_part.places(), np.eye(4), LENS)
    # One fifth to the right of the middle is 10 of the 50 pixels up to the border.
    assert 36 <= part.x < 40 and 60 < part.x + part.width <= 64
    assert 36 <= part.y < 40 and 50 < part.y + part.height <= 54
    pixels = np.ones((part.height, part.width, 4), np.float32)
    whole = part.in_whole(pixels, 0)
    assert whole.shape == (100, 100, 4) and whole.sum() == pixels.sum()
    assert whole[45, 50, 0] == 1 and whole[60, 50, 0] == 0


@pytest.mark.slow
def test_the_box_of_a_large_mesh_stands_for_its_vertices(scene, monkeypatch):
    from lightfield.rendering.views import visible_part

    scene.collection.objects["triangle"].rotation_euler = (0, 0, 0.5)
    exact = visible_part.choose(visible_part.places(), np.eye(4), LENS)
    monkeypatch.setattr(visible_part, "MOST_VERTICES", 2)
    part = visible_part.choose(visible_part.places(), np.eye(4), LENS)
    assert part.x <= exact.x and part.y <= exact.y
    assert part.x + part.width >= exact.x + exact.width
    assert part.y + part.height >= exact.y + exact.height


@pytest.mark.slow
@pytest.mark.parametrize("turn", ["behind", "beside"])
def test_a_camera_that_does_not_see_all_in_front_renders_the_whole(scene, turn):
    from lightfield.rendering.views import visible_part

    matrix = np.eye(4)
    if turn == "behind":
        matrix[2, 3] = -10
    else:
        matrix[0, 3] = 100
    assert visible_part.choose(visible_part.places(), matrix, LENS) is None
    assert not scene.render.use_border


def see_lamp(scene):
    import bpy

    lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "AREA"))
    lamp.visible_camera = True
    scene.collection.objects.link(lamp)


def see_curve(scene):
    import bpy

    curve = bpy.data.objects.new("curve", bpy.data.hair_curves.new("curve"))
    scene.collection.objects.link(curve)


def displace(scene):
    import bpy

    bpy.data.materials.new("displaced").displacement_method = "DISPLACEMENT"


def blur(scene):
    scene.render.use_motion_blur = True


def focus(scene):
    scene.camera.data.dof.use_dof = True


@pytest.mark.slow
@pytest.mark.parametrize("change", [see_lamp, see_curve, displace, blur, focus])
def test_where_something_else_may_be_seen_the_whole_is_rendered(scene, change):
    from lightfield.rendering.views import visible_part

    assert visible_part.places() is not None
    change(scene)
    assert visible_part.places() is None
