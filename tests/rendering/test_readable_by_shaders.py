"""Passes change nothing that a shader or driver can read: the colour is Blender's own."""

import json

import numpy as np
import pytest
from conftest import BLENDER
from readable_views import CHOICES, SCALE, TILE

from lightfield.core.files import read_json
from lightfield.imaging import images


@pytest.fixture(scope="module")
def made(tmp_path_factory, run_program):
    folder = tmp_path_factory.mktemp("readable")
    run_program(BLENDER / "readable_views.py", folder)
    return folder


def channels(path):
    return images.read_image(path).channels


@pytest.fixture(scope="module")
def blenders_own(made):
    """The colour (h, w, 3) as half floats, rendered by Blender alone."""
    planes = channels(made / "blender.exr")
    return np.stack([planes[name] for name in "RGB"], axis=-1).astype(np.float16)


@pytest.fixture(scope="module")
def tiles(made):
    """The colour of each tile in Blender's own render, and the part of the view that it is in."""
    middles = json.loads((made / "tiles.json").read_text())
    half = TILE // 2
    return {
        name: (slice(y - half, y + half), slice(x - half, x + half))
        for name, (x, y) in middles.items()
    }


@pytest.mark.parametrize("choice", CHOICES)
def test_the_colour_is_blenders_own_with_every_pass(choice, made, blenders_own, tiles):
    planes = channels(made / choice / "exr/view_0000f.exr")
    colour = np.stack([planes[name] for name in "RGB"], axis=-1)
    differing = {name for name, part in tiles.items() if (colour[part] != blenders_own[part]).any()}
    assert not differing
    np.testing.assert_array_equal(colour, blenders_own)


@pytest.mark.parametrize("choice", CHOICES)
def test_depth_is_the_same_with_every_pass(choice, made, tiles):
    """Also where an index cuts a surface out or moves it."""
    depth, plain = (channels(made / name / "exr/view_0000f.exr")["Z"] for name in (choice, "none"))
    np.testing.assert_array_equal(depth, plain)
    cut_out, cut, lifted = (np.median(plain[tiles[name]]) for name in ("cut 0", "cut 1", "lifted"))
    assert (cut_out, cut) == (np.float32(17.4), np.float32(16.4))
    assert lifted < cut - 0.1


def test_tiles_show_what_the_file_says(blenders_own, tiles):
    expected = {
        "Object Index object": 7,
        "Object Index collection": 7,
        "Object Index particle": 7,
        "Object Index nodes": 7,
        "Material Index object": 5,
        "OBJECT pass_index object": 7,
        "OBJECT material_slots[0].material.pass_index object": 5,
        "INSTANCER pass_index collection": 23,
        "INSTANCER both collection": 17,
        "INSTANCER both particle": 19,
        "INSTANCER both nodes": 21,
        "OBJECT own object": 11,
        "OBJECT of_data object": 13,
        "of_layer": 37,
        "of_scene": 39,
        "of_world": 43,
        'objects["source"].pass_index': 31,
        "group 300": 600,
        "shared 2": 7,
        "shared 3": 8,
        "keyed": 41,
        "hidden keyed": 41,
        "driven": 5,
        "linked": 9,
    }
    middle = TILE // 2
    shown = {name: blenders_own[tiles[name]][middle, middle].tolist() for name in expected}
    assert shown == {name: [value * SCALE] * 3 for name, value in expected.items()}


def test_numbers_are_unique_although_shaders_read_equal_indices(made, tiles):
    middle = TILE // 2
    for kind in ("object", "material"):
        numbers = read_json(made / "all" / kind / "names.json")
        assert list(numbers.values()) == list(range(1, len(numbers) + 1))
        shown = channels(made / "all" / kind / "view_0000f.exr")["Y"]
        for name in ("Location object", "Random nodes", "keyed", "follower", "mesh"):
            assert shown[tiles[name]][middle, middle] == numbers[name]
