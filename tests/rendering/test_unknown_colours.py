"""A .blend of another OpenColorIO configuration is refused, or its own names are noted."""

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from conftest import BLENDER, SCRIPTS
from test_blend_settings import of_plenoforge

from lightfield.core.errors import UserError

pytestmark = pytest.mark.slow
ALLOWED = {"scene": {"allow_missing": True}}
DEVELOPED = {"reprojections": {"png": {"look": "file"}}}


@pytest.fixture(scope="module")
def blends(tmp_path_factory):
    """Return a folder with the .blends. Only a new process takes another configuration."""
    folder = tmp_path_factory.mktemp("foreign")
    for names in ([], ["working_space"]):
        subprocess.run(
            [sys.executable, BLENDER / "foreign_colours.py", folder, *names],
            env=os.environ | {"PYTHONPATH": f"{SCRIPTS}{os.pathsep}{BLENDER}"},
            capture_output=True,
            check=True,
        )
    return folder


@pytest.fixture
def made(blends, tmp_path):
    """Return a function that makes the dataset of a .blend, and returns what it says."""

    def run(name, **yaml):
        path = tmp_path / f"{name}.blend"
        shutil.copy(blends / path.name, path)
        pixels, _, said = of_plenoforge(path, yaml)
        assert np.isfinite(pixels).all()
        return said

    return run


def test_a_texture_with_an_unknown_colour_space_is_refused_or_noted(made):
    with pytest.raises(UserError, match=r"texture\.blend: grey: a texture .*Studio sRGB"):
        made("texture")
    assert "1 texture with a colour space that Blender lacks (Studio sRGB)" in made(
        "texture", **ALLOWED
    )


def test_a_texture_that_no_pixel_needs_is_no_reason_to_refuse(made):
    assert "Studio" not in made("unused")


@pytest.mark.parametrize(
    ("name", "said", "replacement"),
    [
        ("view_transform", "view transform Studio View", "Standard"),
        ("look", "look Studio Look", "None"),
        ("display", "display Studio Display", "sRGB"),
    ],
)
def test_both_names_of_an_unknown_setting_are_noted_and_its_look_is_refused(
    made, name, said, replacement
):
    note = made(name)
    assert f"{said} (Blender lacks it, and has put {replacement} in its place)" in note
    assert "look: file is not possible" in note
    with pytest.raises(UserError, match=r"look: file: the \.blend has the .*Studio"):
        made(name, **DEVELOPED)


def test_the_unknown_view_transform_of_another_scene_changes_nothing(made):
    assert "Studio" not in made("two_scenes", scene={"scene_name": "Scene"})
    assert "view transform AgX" in made("two_scenes", **DEVELOPED)


def test_an_unknown_working_space_is_refused_or_noted(made):
    with pytest.raises(UserError, match="its working space is one that Blender's OpenColorIO"):
        made("working_space")
    assert "working space unknown, colours taken as Rec. 709" in made("working_space", **ALLOWED)
