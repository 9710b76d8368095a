"""A user's own .hdr or .exr as the light of a model: its radiance, its directions, its mistakes."""

import json
import os
import re
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from checkouts import checkout, jobs_on, snakemake
from model_imports import imported

from lightfield.configuration.family import Family
from lightfield.core.errors import UserError
from lightfield.imaging import environment
from lightfield.workflow import presence

CUBE = """v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1
f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8
"""
# A Radiance picture holds these exactly.
RADIANCE = np.array([0.75, 1.25, 2.0], np.float32)


def write_picture(path, pixels):
    """Write floats (height, width, channels) with OpenImageIO."""
    height, width, channels = pixels.shape
    file = oiio.ImageOutput.create(str(path))
    assert file.open(str(path), oiio.ImageSpec(width, height, channels, "float"))
    assert file.write_image(np.ascontiguousarray(pixels, np.float32))
    file.close()
    return path


def sky(width=32, height=16):
    return np.full((height, width, 3), RADIANCE)


def cube(folder):
    path = folder / "cube.obj"
    path.write_text(CUBE)
    return path


def picture(folder, place, turn, **camera_keys):
    """Render the open scene from a place. Returns the pixels (16, 32, 3)."""
    import bpy

    scene = bpy.context.scene
    data = bpy.data.cameras.new("camera")
    for key, value in camera_keys.items():
        setattr(data, key, value)
    scene.camera = bpy.data.objects.new("camera", data)
    scene.collection.objects.link(scene.camera)
    scene.camera.location, scene.camera.rotation_euler = place, turn
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 256
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.render.resolution_x, scene.render.resolution_y = 32, 16
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = str(folder / "picture.exr")
    bpy.ops.render.render(write_still=True)
    return oiio.ImageBuf(str(folder / "picture.exr")).get_pixels()[..., :3]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["exr", "hdr"])
def test_a_constant_environment_lights_white_paint_to_its_own_radiance(tmp_path, suffix):
    """A convex white matt object in light of equal radiance has this radiance, so it vanishes."""
    import bpy

    light = write_picture(tmp_path / f"sky.{suffix}", sky())
    imported(cube(tmp_path), light=str(light))
    (material,) = bpy.data.materials
    tree = material.node_tree
    tree.nodes.clear()
    paint = tree.nodes.new("ShaderNodeBsdfDiffuse")
    paint.inputs["Color"].default_value = (1, 1, 1, 1)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(paint.outputs[0], output.inputs["Surface"])
    pixels = picture(tmp_path, (0, -3, 0.3), (1.5, 0, 0.1), lens=40)
    np.testing.assert_allclose(pixels[0, 0], RADIANCE, rtol=0.001)
    np.testing.assert_allclose(pixels[6:10, 14:18].mean((0, 1)), RADIANCE, rtol=0.02)


@pytest.mark.slow
def test_a_bright_spot_is_where_blenders_environment_texture_has_it(tmp_path):
    import bpy

    spotted = sky()
    spotted[3, 21] = (50, 0, 0)
    light = write_picture(tmp_path / "spot.exr", spotted)
    # A panorama from above the model, which is below the horizon.
    camera = {"type": "PANO", "panorama_type": "EQUIRECTANGULAR"}
    view = (tmp_path, (0, 0, 50), (np.pi / 2, 0, -np.pi / 2))
    imported(cube(tmp_path), light=str(light))
    ours = picture(*view, **camera)

    bpy.ops.wm.read_factory_settings(use_empty=True)
    world = bpy.context.scene.world = bpy.data.worlds.new("world")
    tree = world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(light))
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    blenders = picture(*view, **camera)
    assert blenders[:8].max() > 10
    np.testing.assert_allclose(ours[:8], blenders[:8], rtol=1e-4)


def fifo(path):
    os.mkfifo(path)


# What is written at sky.exr, and what is wrong with it.
REFUSED = {
    "nothing": (lambda path: None, "cannot be read: No such file or directory"),
    "a folder": (Path.mkdir, "cannot be read"),
    "a FIFO": (fifo, "cannot be read: it is a FIFO, not a file"),
    "a device": (lambda path: path.symlink_to("/dev/zero"), "cannot be read: it is a device"),
    "an empty file": (Path.touch, "is not an .exr file"),
    "a text": (lambda path: path.write_text("sky\n" * 99), "is not an .exr file"),
    "a JPEG": (
        lambda path: write_picture(path.with_suffix(".jpg"), sky()).rename(path),
        "is not an .exr file",
    ),
    "half a header": (
        lambda path: path.write_bytes(write_picture(path, sky()).read_bytes()[:60]),
        "is not an image that can be read",
    ),
    "a square": (lambda path: write_picture(path, sky(16)), "has 16 × 16 pixels; must be twice as"),
    "grey": (lambda path: write_picture(path, sky()[..., :1]), "has the channels Y; must have R"),
    "too many pixels": (
        lambda path: path.write_bytes(
            # The sizes in the header of dataWindow and displayWindow.
            write_picture(path, sky())
            .read_bytes()
            .replace(np.array([31, 15], "<i4").tobytes(), np.array([65535, 32767]).astype("<i4"))
        ),
        "has 65536 × 32768 pixels; must be at most 32768",
    ),
}
# The plan reads only the header.
REFUSED_BY_THE_IMPORT = {
    "half a picture": (
        lambda path: path.write_bytes(write_picture(path, sky(256, 128)).read_bytes()[:-999]),
        "cannot be read whole",
    ),
    "no number": (lambda path: write_picture(path, sky() * np.nan), "infinite or not numbers"),
    "an infinite sun": (lambda path: write_picture(path, sky() * np.inf), "infinite or not"),
}


def write_scene(folder, text):
    (folder / "configs/scenes").mkdir(parents=True)
    (folder / "configs/scenes/chair.yaml").write_text(text)


@pytest.mark.parametrize("name", REFUSED)
def test_a_plan_says_what_is_wrong_with_a_light(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    write, said = REFUSED[name]
    path = tmp_path / "sky.exr"
    write_scene(tmp_path, f"scene:\n  model: cube.obj\n  light: {path}\n")
    write(path)
    with pytest.raises(UserError) as caught:
        presence.check_light("chair", str(path))
    message = str(caught.value)
    assert message.startswith(f"configs/scenes/chair.yaml:3: scene.light: {path}: ")
    assert said in message and "\n" not in message


@pytest.mark.slow
@pytest.mark.parametrize("name", [*REFUSED, *REFUSED_BY_THE_IMPORT])
def test_an_import_refuses_a_wrong_light(tmp_path, name):
    write, said = (REFUSED | REFUSED_BY_THE_IMPORT)[name]
    path = tmp_path / "sky.exr"
    write(path)
    with pytest.raises(UserError, match=re.escape(said)):
        imported(cube(tmp_path), light=str(path))


def test_a_light_that_cannot_be_read_to_its_end_passes_the_plan(tmp_path):
    environment.check_header(write_picture(tmp_path / "sky.hdr", sky()))


def test_every_listed_light_of_a_family_is_checked(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_picture(tmp_path / "sky.hdr", sky())
    choice = ["city", str(tmp_path / "sky.hdr"), str(tmp_path / "missing.hdr")]
    values = {"scene.light": {"choice": choice}}
    # The light is drawn, so its line is not that of the block scene.
    write_scene(tmp_path, f"scene: {{}}\nfamily:\n  values:\n    {json.dumps(values)[1:-1]}\n")
    family = Family(models="*.obj", values=values)
    with pytest.raises(
        UserError, match=r"chair\.yaml:4: scene\.light: .*missing\.hdr: cannot be read"
    ):
        presence.check_lights("chair", family)


SCENE = """
scene: {model: models/cube.obj, light: lights/sky.hdr}
render: {samples: 1}
rigs:
  ring:
    type: ring
    count: 2
    size: 2.5
    camera: {lens: rectilinear, fov: 40, resolution: [16, 16]}
"""


@pytest.mark.slow
def test_a_changed_light_builds_its_dataset_again(tmp_path):
    folder = checkout(tmp_path / "plenoforge", chair=SCENE)
    for name in ("models", "lights"):
        (folder / name).mkdir()
    cube(folder / "models")
    target = "results/chair/ring/validation.json"
    choice = ("--config", "scenes=chair", "preset=full", "--", target)
    result = snakemake(folder, *choice)
    assert result.returncode != 0
    assert (
        "error: configs/scenes/chair.yaml:2: scene.light: lights/sky.hdr: cannot be read: No such"
        in result.stderr
    )
    light = write_picture(folder / "lights/sky.hdr", sky())
    result = snakemake(folder, *choice)
    assert result.returncode == 0, result.stdout + result.stderr
    lightfield = json.loads((folder / "results/chair/ring/lightfield.json").read_text())
    # A dataset names no folder of the machine that made it.
    assert lightfield["scene"]["light"] == "sky.hdr"

    def planned():
        result = snakemake(folder, "--dry-run", "--logger", "jobs", *choice)
        return {job["rule"] for job in jobs_on(result.stderr) if job["output"]}

    assert not planned()
    write_picture(light, 2 * sky())
    assert {"import_model", "lightfield", "render"} <= planned()
