"""Scenes of users that Cycles renders wrong without an error: what is wrong is said, once."""

from pathlib import Path

import numpy as np
import pytest

from lightfield.imaging import images


@pytest.fixture(scope="module")
def folder(run_program, tmp_path_factory):
    """A folder with the .blend of each scene."""
    folder = tmp_path_factory.mktemp("users")
    run_program(Path(__file__).with_name("users_scenes.py"), folder)
    return folder


ASPECT = """
scene: {blend: aspect.blend}
render: {samples: 1}
rigs:
  View:
    type: blend_camera
    camera: {lens: file, resolution: [32, 32]}
"""


def test_a_pixel_aspect_is_said_to_be_ignored_and_pixels_are_square(folder, run_program):
    (folder / "configs/scenes").mkdir(parents=True)
    (folder / "configs/scenes/aspect.yaml").write_text(ASPECT)
    blend = ("--scene", "aspect", "--blend", "aspect.blend")
    run_program("check_blend.py", *blend, "--output", "blend.json", cwd=folder)
    said = run_program("inventory.py", *blend, "--output", "inventory.json", cwd=folder).stdout
    (note,) = [line for line in said.splitlines() if line.startswith("note: ")]
    assert "pixel aspect 2 ignored" in note
    words = ("--scene", "aspect", "--rig", "View", "--inventory", "inventory.json")
    run_program("make_lightfield.py", *words, "--output", "View/lightfield.json", cwd=folder)
    words = ("--blend", "aspect.blend", "--lightfield", "View/lightfield.json")
    run_program("render_shard.py", *words, "--output", "View/exr", cwd=folder)
    depth = images.read_image(folder / "View/exr/view_0001f.exr").channels["Z"]
    seen = np.isfinite(depth)
    assert 4 < seen.any(axis=0).sum() == seen.any(axis=1).sum() < 32
