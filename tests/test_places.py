"""Places: a number draws a scene's layout, materials and light. Without it nothing changes."""

from importlib import import_module

import bpy
import numpy as np
import pytest

from lightfield.dataset.config import SceneSource
from lightfield.dataset.job_settings import BuildSettings
from lightfield.dataset.keys import scene_fingerprint

BUILDERS = ["still_life"]
PLACES = range(40)


def plan_of(builder):
    return import_module(f"scenes.{builder}.plan")


def build(builder, **parameters):
    """Build a scene from an empty file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    parameters = {"seed": 1, "detail": 0.02} | parameters
    import_module(f"scenes.{builder}").build(parameters)
    return {obj.name: np.array(obj.matrix_world) for obj in bpy.data.objects}


def element_names(builder):
    return {element.__name__ for element in import_module(f"scenes.{builder}").ELEMENTS}


@pytest.mark.parametrize("builder", BUILDERS)
def test_a_place_is_drawn_the_same_each_time_and_no_two_are_equal(builder):
    plans = [repr(plan_of(builder).drawn(place)) for place in PLACES]
    assert plans[3] == repr(plan_of(builder).drawn(3))
    assert len(set(plans)) == len(plans)


@pytest.mark.parametrize("builder", BUILDERS)
def test_a_place_names_elements_that_the_scene_has(builder):
    for place in PLACES:
        plan = plan_of(builder).drawn(place)
        assert {*plan.absent, *plan.moves} <= element_names(builder)


@pytest.mark.parametrize("builder", BUILDERS)
def test_the_original_moves_omits_and_tints_nothing(builder):
    original = plan_of(builder).ORIGINAL
    assert not (original.absent or original.moves or original.tints)


def test_a_scene_without_a_place_keeps_its_settings_and_a_place_is_another_scene():
    def settings(**parameters):
        source = SceneSource(builder="garden", parameters=parameters)
        job = BuildSettings(builder="garden", parameters=source.parameters)
        return job.as_json()["parameters"], scene_fingerprint(source)

    without, identity = settings(seed=1)
    assert without == {"seed": 1, "detail": 1.0}
    assert settings(seed=1, place=7)[1] != identity


def test_the_pieces_of_a_still_life_stand_apart_on_the_board():
    still_life = plan_of("still_life")
    for place in PLACES:
        plan = still_life.drawn(place)
        standing = []
        for piece in still_life.PIECES:
            if piece.elements[0] in plan.moves:
                move = plan.moves[piece.elements[0]]
                angle = np.radians(move.turned)
                turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
                middle, reach = np.array(piece.discs[0][:2]), piece.discs[0][2]
                at = move.scale * turn @ middle + move.end
                standing.append((at, move.scale * reach))
        for number, (at, reach) in enumerate(standing):
            assert np.hypot(*at) + reach < still_life.RADIUS
            for other, other_reach in standing[:number]:
                assert np.hypot(*(at - other)) > reach + other_reach


@pytest.mark.slow
def test_a_place_builds_with_its_own_layout():
    original = build("still_life")
    assert build("still_life", place=None).keys() == original.keys()
    third, fourth = build("still_life", place=3), build("still_life", place=4)
    shared = (third.keys() & fourth.keys()) - {"Board"}
    assert any(not np.allclose(third[name], fourth[name]) for name in shared)
