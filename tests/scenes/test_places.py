"""Places: a number draws a scene's layout, materials and light. Without it nothing changes."""

import shutil
from functools import cache
from importlib import import_module
from itertools import combinations

import bpy
import numpy as np
import pytest

from lightfield.configuration import keys
from lightfield.configuration.keys import scene_fingerprint
from lightfield.configuration.scene_source import SceneSource
from lightfield.core import names
from lightfield.stages.scene import BuildSettings
from scenes.barbershop.plan import SIZES
from scenes.library.variation import Draw

# Each builder with the modules that draw its places and that hold its original.
DRAWING = {
    "barbershop": ("place", "plan"),
    "garden": ("place", "plan"),
    "lone_monk": ("place", "plan"),
    "rooms": ("place", None),
    "still_life": ("plan", "plan"),
}
PLACES = range(40)


@cache
def drawn(builder, place):
    return import_module(f"scenes.{builder}.{DRAWING[builder][0]}").drawn(place)


def build(builder, **parameters):
    """Build a scene from an empty file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    parameters = {"seed": 1, "detail": 0.02} | parameters
    import_module(f"scenes.{builder}").build(parameters)
    return {obj.name: np.array(obj.matrix_world) for obj in bpy.data.objects}


def element_names(builder):
    return {element.__name__ for element in import_module(f"scenes.{builder}").ELEMENTS}


@pytest.mark.parametrize("builder", DRAWING)
def test_a_place_is_drawn_the_same_each_time_and_no_two_are_equal(builder):
    plans = [repr(drawn(builder, place)) for place in PLACES]
    assert plans[3] == repr(drawn.__wrapped__(builder, 3))
    assert len(set(plans)) == len(plans)


@pytest.mark.parametrize("builder", DRAWING)
def test_a_place_names_elements_that_the_scene_has(builder):
    for place in PLACES:
        plan = drawn(builder, place)
        assert {*plan.absent, *plan.moves} <= element_names(builder)


@pytest.mark.parametrize("builder", [name for name, (_, original) in DRAWING.items() if original])
def test_the_original_moves_omits_and_tints_nothing(builder):
    original = import_module(f"scenes.{builder}.plan").ORIGINAL
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
    still_life = import_module("scenes.still_life.plan")
    for place in PLACES:
        plan = drawn("still_life", place)
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


def corners(piece, rooms):
    """The rectangle of a piece at a wall: x0, y0, x1, y1."""
    return rooms.turned_rectangle(
        rooms.AT_WALLS[piece.name][:4], piece.x, piece.y, round(piece.turned / 90)
    )


def test_the_pieces_of_a_room_stand_apart_within_it_and_leave_the_rigs_free():
    rooms = import_module("scenes.rooms.place")
    for place in PLACES:
        room = drawn("rooms", place)
        taken = [(-0.6, -0.6, 0.6, 0.6)]
        for piece in room.furniture:
            if piece.name not in rooms.AT_WALLS or piece.turned % 90:
                continue
            x0, y0, x1, y1 = corners(piece, rooms)
            assert all(x0 > x3 or x2 > x1 or y0 > y3 or y2 > y1 for x2, y2, x3, y3 in taken)
            taken.append((x0, y0, x1, y1))
            half = np.array(room.size[:2]) / 2 + 0.01
            assert (np.abs(np.subtract((x0, y0), room.center)) < half).all()
            assert (np.abs(np.subtract((x1, y1), room.center)) < half).all()


@pytest.mark.parametrize("place", range(100))
def test_the_furniture_of_a_barbershop_stands_apart_and_leaves_rigs_and_doors_free(place):
    layout_module = import_module("scenes.barbershop.layout")
    layout = layout_module.drawn_layout(Draw(place))
    half = np.array(layout.room[:2]) / 2 + 1e-3
    rigs, counter, chairs, *others = layout.taken
    for x0, y0, x1, y1 in layout.taken:
        assert (np.abs([(x0, y0), (x1, y1)]) <= half).all()
    for first, second in combinations([counter, *others], 2):
        assert min(first[2], second[2]) <= max(first[0], second[0]) or (
            min(first[3], second[3]) <= max(first[1], second[1])
        )
    for other in [chairs, *others]:
        assert layout_module.apart(rigs, other)
    assert (np.array(rigs) == (-0.76, -1.56, 0.76, 1.56)).all()


@pytest.mark.parametrize("place", range(100))
def test_windows_and_door_of_a_barbershop_stand_side_by_side_in_the_front_wall(place):
    plan = drawn("barbershop", place)
    spans = [(each.along - each.width / 2, each.along + each.width / 2) for each in plan.windows]
    spans = sorted([*spans, (plan.door - 0.475, plan.door + 0.475)])
    ends = np.array([-plan.half_x, *np.ravel(spans), plan.half_x])
    assert (np.diff(ends)[::2] > 0.4).all()  # the wall between the openings
    assert all(each.width > 1 for each in plan.windows)
    assert plan.staff_door


def test_barbershops_differ_in_their_plan():
    plans = [drawn("barbershop", place) for place in range(100)]
    assert {plan.counter_wall for plan in plans} == {"left", "right", "back"}
    assert {len(plan.stations) for plan in plans} == {2, 3, 4}
    assert {len(plan.windows) for plan in plans} == {1, 2}
    assert {plan.door > plan.windows[0].along for plan in plans} == {True, False}
    assert len({plan.room for plan in plans}) > 50
    assert len({plan.prints for plan in plans}) == 100


@pytest.mark.parametrize("place", range(100))
def test_what_hangs_on_the_walls_of_a_barbershop_is_not_over_doors_or_behind_tall_furniture(place):
    plan = drawn("barbershop", place)
    for each in plan.prints:
        assert each.wall != plan.counter_wall
        half = SIZES[each.name][0] / 2
        for window in plan.windows if each.wall == "front" else ():
            assert abs(each.along - window.along) > half + window.width / 2
        if each.wall == "front":
            assert abs(each.along - plan.door) > half + 0.475
        if each.wall == plan.staff_door[0]:
            assert abs(each.along - plan.staff_door[1]) > half + 0.425
        assert abs(each.along) + half < plan.wall_length(each.wall) / 2


def test_the_rigs_of_a_garden_stand_free_in_its_court():
    for place in PLACES:
        plan = drawn("garden", place)
        for x, y, radius in [*plan.rock_islands, (*plan.fire, 0.45), (*plan.maple, 0.3)]:
            assert np.hypot(x, y) - radius > 1.42  # from the middle to a corner of the rigs
        assert plan.court_distance(*plan.fire) < 0
        assert all(plan.pond_distance(x, y) > 0.3 for x, y in plan.pines)


@pytest.mark.parametrize("place", range(100))
def test_the_rigs_of_a_cloister_stand_free_in_its_court(place):
    plan = drawn("lone_monk", place)
    rig = -np.array(plan.center)
    assert np.abs(rig).max() + 2 < plan.front - 1  # the arcades
    assert np.abs(rig).max() - 2 > 1.25  # the middle
    assert np.abs(rig - plan.monk[:2]).max() > 2.3
    for spots, reach in ((plan.olives, 2.0), (plan.cypresses, 0.65), ((plan.chair,), 0.5)):
        for spot in spots:
            assert np.abs(rig - spot).max() > 2 + reach
            assert np.abs(spot).max() < plan.front - 1


@pytest.mark.parametrize("place", range(100))
def test_each_side_of_a_cloister_has_a_church_a_house_or_a_low_wall(place):
    plan = drawn("lone_monk", place)
    sides = [house.side for house in plan.houses] + [*plan.low_sides]
    if "church" not in plan.absent:
        sides.append(plan.church_side)
    assert sorted(sides) == [0, 1, 2, 3]
    assert plan.bays % 2 == 1  # so that a gate is in the middle
    assert plan.arch_radius + 2.45 < 3.8  # the arches end below the eaves


def test_cloisters_differ_in_their_plan():
    plans = [drawn("lone_monk", place) for place in range(100)]
    assert {plan.bays for plan in plans} == {7, 9, 11}
    assert {plan.middle for plan in plans} == {"well", "fountain", "cross", "statue", "tree"}
    assert {plan.ground for plan in plans} == {"lawn", "gravel", "paved"}
    assert {len(plan.houses) for plan in plans} == {1, 2, 3}
    assert {len(house.tops) for plan in plans for house in plan.houses} == {1, 2}


def test_a_value_is_equal_whatever_else_is_drawn():
    first, second = Draw(7), Draw(7)
    second.choice("another", "abc")
    assert first.uniform("width", 0, 1) == second.uniform("width", 0, 1)
    assert first.uniform("width", 0, 1) != Draw(8).uniform("width", 0, 1)
    assert Draw(7).uniform("width", 0, 1) == 0.18


def test_a_rooms_identity_changes_with_the_scenes_whose_pieces_it_borrows(tmp_path, monkeypatch):
    builders = tmp_path / "scenes"
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(names.BUILDERS, builders, ignore=ignored)
    monkeypatch.setattr(keys, "BUILDERS", builders)
    source = SceneSource(builder="rooms")
    before = keys.scene_fingerprint(source)
    with (builders / "lone_monk" / "furniture.py").open("a") as text:
        text.write("# changed\n")
    assert keys.scene_fingerprint(source) != before


@pytest.mark.slow
@pytest.mark.parametrize("builder", ["still_life", "rooms"])
def test_a_place_builds_with_its_own_layout(builder):
    first, again, other = (build(builder, place=place) for place in (3, 3, 4))
    assert first.keys() == again.keys()
    assert all(np.array_equal(first[name], again[name]) for name in first)
    shared = first.keys() & other.keys()
    assert first.keys() != other.keys() or any(
        not np.allclose(first[name], other[name]) for name in shared
    )


@pytest.mark.slow
def test_the_original_is_built_without_a_place():
    names_of_original = build("still_life").keys()
    assert {"Kettle", "Carafe", "Bowl", "Knife", "Chick"} <= names_of_original
