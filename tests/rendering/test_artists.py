"""Builds of three .blend files as artists leave them, in a folder of the user's own."""

import json
import re

import forks
import numpy as np
import pytest
from conftest import BLENDER, ROOT

from lightfield.core.files import sha256
from lightfield.formats import blend
from lightfield.formats.render_block import RenderBlock
from lightfield.imaging import images

pytestmark = pytest.mark.slow

SCENES = {
    "interior": """
scene: {blend: interior.blend, allow_missing: true}
render: {samples: 1}
rigs:
  views:
    type: plane
    cameras: [2, 1]
    size: 0.5
    center: [0, -1, 1.3]
    camera: {lens: rectilinear, fov: 90, resolution: [32, 32]}
""",
    "character": """
scene: {blend: character.blend, frame: file, view_layers: all}
render: {samples: 1, motion_blur: false}
rigs:
  views:
    type: blend_camera
    frames: {first: 24, last: 36, step: 12}
    camera: {lens: file, resolution: [32, 24]}
""",
    "product": """
scene: {blend: product.blend}
render: {samples: file, depth_of_field: true}
rigs:
  views:
    type: blend_camera
    camera: {lens: file, resolution: [32, 32]}
""",
}

TAKEN = {
    "interior": "frame 1, the file's · 1 sample a pixel (the file has 4096) · camera Corner "
    "(24 mm) ignored: the rigs place the cameras · compositor ignored · adaptive sampling off · "
    "denoising off · view transform AgX: not applied; look: file applies it · "
    "1 texture missing: poster.png",
    "character": "frame 24, the file's · view layers Main and Stage of 2 in one picture · "
    "1 sample a pixel (the file has 256) · camera Wide (35 mm) taken · adaptive sampling off · "
    "denoising off · motion blur off · view transform AgX: not applied; look: file applies it",
    "product": "frame 1, the file's · 4 samples a pixel, the file's · camera Hero (50 mm) taken "
    "· clip planes at 1 and 1000 m ignored · adaptive sampling off · denoising off "
    "· depth of field ON · view transform AgX, view exposure +1.5: not applied; look: "
    "file applies them · film transparent on, ignored",
}


def build(folder, *arguments):
    command_line = [
        "--snakefile",
        ROOT / "Snakefile",
        "--directory",
        folder,
        "--cores",
        "1",
        *arguments,
        "--config",
        "preset=full",
        f"scenes=[{','.join(SCENES)}]",
    ]
    return forks.run_snakemake(command_line, "/")


@pytest.fixture(scope="module")
def project(run_program, tmp_path_factory):
    """A built folder with the artists' files and their scene YAMLs, and the build's output."""
    folder = tmp_path_factory.mktemp("project")
    run_program(BLENDER / "artists.py", folder)
    (folder / "configs/scenes").mkdir(parents=True)
    for name, text in SCENES.items():
        assert len(text.strip().splitlines()) < 15
        (folder / f"configs/scenes/{name}.yaml").write_text(text)
    result = build(folder)
    assert result.returncode == 0, result.stdout + result.stderr
    return folder, result.stdout + result.stderr


def view(folder, scene, name, channels="RGB"):
    image = images.read_image(folder / f"results/{scene}/views/exr/{name}.exr", channels)
    return np.stack([image.channels[channel] for channel in channels], axis=-1).astype(float)


@pytest.mark.parametrize("scene", SCENES)
def test_the_terminal_and_the_page_say_once_what_is_taken_from_a_blend(scene, project):
    folder, said = project
    assert said.count(f"note: {scene}.blend: {TAKEN[scene]}\n") == 1
    page = (folder / f"results/{scene}/views/report/index.html").read_text()
    assert f"Of the .blend: {TAKEN[scene].replace(chr(39), '&#39;')}." in page
    assert json.loads((folder / f"results/{scene}/views/validation.json").read_text())["valid"]


def test_missing_files_of_a_kind_are_counted_in_one_note(project):
    folder, _ = project
    inventory = json.loads((folder / "work/interior/inventory.json").read_text())
    textures = [{"kind": "texture", "problem": "missing", "path": name} for name in ("a", "b")]
    libraries = [{"kind": "library", "problem": "broken", "path": name} for name in "cde"]
    inventory["missing"] = [textures[0], *libraries, textures[1]]
    notes = blend.usage_notes(inventory, [1], RenderBlock(), True, None, True)
    assert notes[-2:] == ["2 textures missing: a, b", "3 libraries broken: c, d, e"]


def test_a_missing_texture_is_magenta_and_linked_objects_are_rendered(project):
    folder, _ = project
    files = json.loads((folder / "work/interior/inventory.json").read_text())["external_files"]
    assert [file["path"] for file in files] == ["furniture.blend", "poster.png"]
    assert files[0]["sha256"] and files[1]["sha256"] is None
    red, green, blue = np.moveaxis(view(folder, "interior", "view_0000f"), -1, 0)
    assert np.any((red > 4 * green) & (blue > 4 * green))
    assert np.any((red > 2 * green) & (red > 2 * blue))


def test_each_frames_camera_sees_both_view_layers(project):
    folder, _ = project
    content = json.loads((folder / "results/character/views/lightfield.json").read_text())
    assert content["frame"] == 24
    assert content["camera"]["focal_length"] == 35
    frames = {frame["name"]: frame["position"] for frame in content["frames"]}
    assert list(frames) == ["view_0024f", "view_0036f"]
    # The camera moves by one metre from key to key, with easing.
    assert frames["view_0024f"] == pytest.approx([0.484, -5, 1], abs=1e-3)
    assert frames["view_0036f"] == pytest.approx([0.838, -5, 1], abs=1e-3)
    depth = view(folder, "character", "view_0024f", "Z")[..., 0]
    # The depth has the floor of one layer, and in front of it the body of the other.
    assert np.isfinite(depth).mean() > 0.3
    assert np.any(np.abs(depth - 4.85) < 0.1)


def test_the_camera_of_the_file_has_its_lens_shift_and_its_focus(project):
    folder, _ = project
    content = json.loads((folder / "results/product/views/lightfield.json").read_text())
    assert content["camera"]["focal_length"] == 50
    assert content["camera"]["principal_point"] == pytest.approx([16, 19.2], abs=1e-5)
    colour = view(folder, "product", "view_0001f")
    depth = view(folder, "product", "view_0001f", "Z")[..., 0]
    behind = np.abs(depth - 4.85) < 0.01
    # Out of focus, the depth stays sharp, but colours mix with the sky around.
    assert behind.sum() > 20
    red = colour[..., 0] / colour.sum(axis=-1)
    assert red[behind].mean() < 0.6
    # The film is not transparent, so the sky shows.
    sky = colour[np.isinf(depth)]
    np.testing.assert_allclose(np.median(sky, axis=0), [0.2, 0.3, 0.6], atol=0.01)


APERTURE = """
import sys
from pathlib import Path
import bpy
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.rendering.scenes import blend_file
from lightfield.rendering.setup import cycles
blend_file.open_scene(Path(sys.argv[1]))
bpy.data.cameras["Hero"].lens = 85
path = Path(sys.argv[2])
blend_file.save_scene(path)
lens = lenses.from_camera({"lens": "equirectangular", "resolution": [32, 16]})
render = {"samples": 1, "adaptive_threshold": 0, "denoise": False, "depth_of_field": True}
views = LightField({**lens.to_lightfield(), "frame": 1, "render": render}, [])
cycles.set_up(path, None, views, "cpu", 1)
camera = bpy.context.scene.camera.data
print(camera.type, round(camera.lens / camera.dof.aperture_fstop))
"""


def test_a_panorama_has_the_aperture_of_the_file(project, run_program, tmp_path):
    program = tmp_path / "aperture.py"
    program.write_text(APERTURE)
    said = run_program(program, project[0] / "product.blend", tmp_path / "other.blend").stdout
    assert said.endswith("PANO 425\n")


def test_a_changed_texture_makes_another_scene(project):
    folder, _ = project
    path = folder / "results/product/views/lightfield.json"
    before = json.loads(path.read_text())["scene"]["fingerprint"]
    images.write_png(folder / "label.png", np.zeros((4, 4, 3), np.uint8))
    result = build(folder, "results/product/views/lightfield.json")
    assert result.returncode == 0, result.stdout + result.stderr
    assert json.loads(path.read_text())["scene"]["fingerprint"] != before


def test_an_edited_blend_is_taken_without_the_lock_file_that_its_error_names(project):
    folder, _ = project
    edited = folder / "product.blend"
    edited.write_bytes((folder / "furniture.blend").read_bytes())
    proof = "work/product/blend.json"
    lock = "configs/scenes/product.lock.json"
    result = build(folder, proof)
    assert result.returncode != 0
    assert f"; to take the new file, delete {lock}" in result.stderr
    result = build(folder, proof, "--dry-run")
    assert result.returncode == 1
    (refusal,) = re.findall("^would be refused: (.*)$", result.stderr, re.M)
    assert refusal.endswith(f"; to take the new file, delete {lock}")
    (folder / lock).unlink()
    result = build(folder, proof)
    assert result.returncode == 0, result.stdout + result.stderr
    assert json.loads((folder / lock).read_text())["sha256"] == sha256(edited)
