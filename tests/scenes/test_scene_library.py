"""The common parts of scene builders: points, closed shapes, random streams, fingerprints."""

import shutil

import numpy as np
import pytest

from lightfield.configuration import keys
from lightfield.configuration.scene_source import SceneSource
from lightfield.core import names
from scenes.library.architecture import cut
from scenes.library.points import evenly, lattice, mirrored, noise, polar, smoothstep
from scenes.library.scene import Model, Scene
from scenes.library.shapes import box, copies, facets, frames, icosphere, join, lathe, prism, tube

SCENE = Scene(3, 1.0)


def volume(shape):
    """Return the volume that a closed shape encloses. It is positive if its faces look outwards."""
    quads = shape.quads
    triangles = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]], shape.triangles])
    a, b, c = (shape.vertices[triangles[:, i]] for i in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


OAK = {"material": "Oak"}
SLANTED = [(0, 0), (2, 0), (2, 1), (1, 0.5), (0, 1)]
LINE = [(0, 0, 0), (1, 0, 0), (2, 0, 0)]
SQUARE = [(0, 0), (0, 1), (1, 1), (1, 0), (0, 0)]


@pytest.mark.parametrize(
    ("kind", "measures", "expected"),
    [
        ("box", {"size": (1, 2, 3)}, 6.0),
        ("box", {"size": (1, 1, 1), "at": mirrored(x=5), "scaled": (1, 2, 3)}, 12.0),
        ("ball", {"radius": 1}, 4 * np.pi / 3),
        ("ring", {"radius": 1, "thickness": 0.25}, 2 * np.pi * 8**0.5 / 16),  # 8 sides
        ("lathe", {"profile": [(0.5, 0), (0.5, 2)], "at": (1, 1, 1)}, np.pi / 2),
        ("tube", {"radius": 0.5, "path": LINE}, np.pi / 2),
        ("bend", {"radius": 0.5, "path": LINE}, np.pi / 2),
        ("prism", {"height": 2, "outline": SLANTED}, 3.0),
        ("frame", {"size": (1, 1), "profile": SQUARE}, 8.0),
    ],
)
def test_a_models_part_has_its_volume(kind, measures, expected):
    model = Model(SCENE)
    getattr(model, kind)(**measures, **OAK)
    assert model.materials == ["Oak"]
    assert volume(join(model.parts)) == pytest.approx(expected, rel=0.02)


def test_a_part_is_scaled_then_turned_then_moved():
    model = Model(SCENE)
    model.box(size=(1, 1, 1), at=(5, 0, 0), turned=(0, 0, 90), scaled=(4, 2, 1), **OAK)
    (part,) = model.parts
    assert part.vertices.min(axis=0) == pytest.approx([4, -2, -0.5])
    assert part.vertices.max(axis=0) == pytest.approx([6, 2, 0.5])


def test_texts_planes_and_pipes_have_their_given_size():
    word, plane, pipe = Model(SCENE), Model(SCENE), Model(SCENE)
    word.word(letters="I", size=2, depth=0.01, at=(0, 0, 1), **OAK)
    plane.plane(size=(2, 4), **OAK)
    pipe.pipe(profile=[(1, 0), (1, 3)], **OAK)
    letters, corners, wall = (model.parts[0].vertices for model in (word, plane, pipe))
    assert np.ptp(letters[:, 2]) == pytest.approx(0.01) and 1.0 < np.ptp(letters[:, 1]) < 2.0
    assert np.ptp(corners, axis=0).tolist() == [2.0, 4.0, 0.0]
    assert np.hypot(*wall[:, :2].T) == pytest.approx(1.0) and np.ptp(wall[:, 2]) == 3.0


def test_places_are_all_combinations_of_coordinates():
    expected = [[x, y, 3.0] for x in (-1.0, 0.5, 2.0) for y in (-4.0, 4.0)]
    assert lattice(x=evenly(-1, 2, 3), y=(-4, 4), z=3).tolist() == expected
    assert mirrored(x=1, y=2).tolist() == [[-1.0, 2.0, 0.0], [1.0, 2.0, 0.0]]


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (box((1, 2, 3)), 6.0),
        (lathe([(0.5, 0), (0.5, 2)], 256), np.pi / 2),
        (tube(LINE, 0.5, 256), np.pi / 2),
        (prism(SLANTED, 2), 3.0),
        (icosphere(6, 2.0), 32 * np.pi / 3),
        (SCENE.ball(1.0, 256), 4 * np.pi / 3),
        (SCENE.ring(1.0, 0.25, 256, 256), 2 * np.pi**2 / 16),
    ],
    ids=["box", "lathe", "tube", "prism", "icosphere", "ball", "ring"],
)
def test_solids_are_closed_and_look_outwards(shape, expected):
    assert volume(shape) == pytest.approx(expected, rel=2e-3)
    far = shape.moved(3, -4, 5)  # a hole in the shape would change its volume
    assert volume(far) == pytest.approx(expected, rel=2e-3)


def test_copies_point_forward_and_keep_their_slots():
    corners = [(0, 0, 0), (0.1, 0.5, 0), (0, 1, 0), (0, 1, 1)]
    leaf = facets(corners, (0, 1, 2), (0, 1, 2, 3)).painted(2)
    made = copies(leaf, [(1, 0, 0), (0, 5, 0)], forward=[(0, 0, 2), (-3, 0, 0)], size=[2, 3])
    assert made.vertices[2] == pytest.approx([1, 0, 2])
    assert made.vertices[6] == pytest.approx([-3, 5, 0])
    assert made.vertices[7] == pytest.approx([-3, 5, 3])
    assert made.quads.tolist() == [[0, 1, 2, 3], [4, 5, 6, 7]]
    slots = join([leaf.painted(1), made]).face_slots()
    assert slots.tolist() == [1, 2, 2, 1, 2, 2]  # quads first


def test_each_copy_keeps_the_slot_of_each_face():
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (1, 1, 1)], float)
    slot_of = {(0, 1, 2, 3): 5, (1, 2, 3, 0): 6, (0, 1, 4): 7, (2, 3, 4): 8}
    faces = facets(corners, *slot_of)
    house = faces._replace(slots=np.array([*slot_of.values()]))
    made = copies(house, [(0, 0, 0), (9, 0, 0), (0, 9, 0)])
    copied = [*made.quads.tolist(), *made.triangles.tolist()]
    for face, slot in zip(copied, made.face_slots(), strict=True):
        assert slot_of[tuple(corner % len(corners) for corner in face)] == slot
    assert len(copied) == 12


def test_each_copy_has_its_own_size_along_each_of_its_axes():
    arrow = facets([(0, 0, 0), (1, 0, 0), (1, 1, 1)], (0, 1, 2))
    # The +X axis of a copy points to -Y, and its +Y axis to +X.
    made = copies(arrow, [(10, 0, 0), (0, 20, 0)], forward=(1, 0, 0), size=[(2, 3, 4), (5, 6, 7)])
    assert made.vertices[[1, 2]] == pytest.approx(np.array([(10, -2, 0), (13, -2, 4)]))
    assert made.vertices[[4, 5]] == pytest.approx(np.array([(0, 15, 0), (6, 15, 7)]))


def test_frames_are_rotations():
    random = np.random.default_rng(1)
    turns = frames(random.normal(size=(20, 3)), random.normal(size=(20, 3)))
    assert np.allclose(turns @ turns.transpose(0, 2, 1), np.eye(3))
    assert np.allclose(np.linalg.det(turns), 1)


def test_stones_cut_from_a_length_fill_it_and_differ():
    middle, length = cut(SCENE.random("stones"), -1.0, 3.0, 8)
    assert (middle - length / 2).tolist() == pytest.approx([-1.0, *(middle + length / 2)[:-1]])
    assert (middle + length / 2)[-1] == pytest.approx(3.0)
    assert 0.25 < length.min() < 0.45 and 0.55 < length.max() < 0.75


def test_noise_is_smooth_and_differs_by_seed():
    line = polar(np.linspace(0, 30, 3001), 0.3)
    values = noise(line, 5)
    assert np.abs(np.diff(values)).max() < 0.05
    assert 0.15 < values.std() < 0.4 and np.abs(values).max() <= 1.2
    assert np.corrcoef(values, noise(line, 6))[0, 1] < 0.3
    assert smoothstep(2.0, 1.0, [0.5, 1.5, 2.5]).tolist() == [1.0, 0.5, 0.0]


def test_each_element_has_its_own_random_stream():
    assert SCENE.random("maple").random() == SCENE.random("maple").random()
    others = [SCENE.random("pines"), Scene(4, 1.0).random("maple")]
    assert SCENE.random("maple").random() not in [other.random() for other in others]


def test_less_detail_has_a_part_of_the_triangles():
    half = Scene(0, 0.25)
    assert (half.segments(40), half.count(40)) == (20, 10)
    assert (half.segments(2, 8), half.count(2, 8)) == (8, 8)


def test_builders_are_the_folders_beside_the_library():
    assert names.builders() == ["barbershop", "garden", "lone_monk", "room", "rooms", "still_life"]


@pytest.mark.parametrize(
    ("file", "changes"),
    [
        ("library/shapes.py", True),
        ("garden/__init__.py", True),
        ("garden/pond.py", True),
        ("lone_monk/__init__.py", False),
    ],
)
def test_a_fingerprint_covers_the_library_and_the_builders_own_files(
    file, changes, tmp_path, monkeypatch
):
    builders = tmp_path / "scenes"
    shutil.copytree(names.BUILDERS, builders, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(keys, "BUILDERS", builders)
    source = SceneSource(builder="garden", parameters={"seed": 1})
    before = keys.scene_fingerprint(source)
    with (builders / file).open("a") as text:
        text.write("# changed\n")
    assert (keys.scene_fingerprint(source) != before) == changes
