"""A scene without light is refused before it is rendered. One that Cycles lights is not."""

import json

import pytest
from conftest import BLENDER

DARK = [
    "nothing",
    "black_world",
    "world_without_strength",
    "world_without_nodes",
    "lamp_without_power",
    "black_lamp",
    "hidden_lamp",
    "lamp_in_an_excluded_collection",
    "emission_without_strength",
    "black_emission",
    "plain_paint",
    "emitting_material_of_no_object",
]
LIT = [
    "shining_lamp",
    "lamp_that_keyframes_turn_on",
    "lamp_that_keyframes_show",
    "blue_world",
    "world_that_a_driver_lights",
    "world_of_a_colour_without_shader",
    "emission",
    "emission_in_a_group",
    "emission_of_the_principled_shader",
    "fire",
    "glowing_fog",
    "world_of_a_picture",
    "emission_of_a_picture",
    "emission_that_keyframes_turn_on",
    "emission_that_a_modifier_gives",
    "lamp_of_a_light_group",
    "lamp_of_a_library",
]


@pytest.fixture(scope="module")
def folder(run_program, tmp_path_factory):
    """A folder with a .blend of each case, and the result of its render."""
    folder = tmp_path_factory.mktemp("light")
    run_program(BLENDER / "light_renders.py", folder)
    return folder


@pytest.mark.parametrize("name", DARK + LIT)
def test_a_scene_counts_as_lit_if_cycles_renders_light(name, folder):
    result = json.loads((folder / "results.json").read_text())[name]
    assert (result["brightest"] > 0) == (name in LIT)
    assert result["may_be_lit"] == (name in LIT)


def test_a_scene_without_light_is_refused_in_one_line(folder, run_program, tmp_path):
    blend, output = folder / "black_world.blend", tmp_path / "inventory.json"
    result = run_program("inventory.py", "--blend", blend, "--output", output, check=False)
    assert result.returncode == 1
    (line,) = [line for line in result.stderr.splitlines() if "error" in line]
    assert line.startswith(f"error: {blend}: has no light")
    assert "world with a colour" in line
    assert not output.exists()
