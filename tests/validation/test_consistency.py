"""What views tell of each other's surfaces, with known walls, motions and scales."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lightfield.geometry import lenses
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.validation import consistency
from lightfield.validation.consistency import Answer, Camera, Comparison, Patches

AGREE, OCCLUDED, CONTRADICT, UNKNOWN = (
    getattr(consistency, name) for name in ("AGREE", "OCCLUDED", "CONTRADICT", "UNKNOWN")
)
AWAY = 4.0  # The metres to the wall.
FOCAL = 256  # The focal length in pixels.
NARROW = Rectilinear(width=64, height=64, focal_length=FOCAL * 36 / 64)
STEP = AWAY / FOCAL  # The metres of the wall that a pixel sees.


def at(x=0.0, y=0.0, z=0.0, turn=None, lens=NARROW, depth="z", grain=0.0):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    if turn is not None:
        matrix[:3, :3] = Rotation.from_euler("xyz", turn, degrees=True).as_matrix()
    return Camera(lens, matrix, depth, grain)


def wall(away=AWAY, lens=NARROW):
    return np.full((lens.height, lens.width), away)


def patches(points, normal=(0, 0, 1.0), spread=0.0, footprint=STEP, error=0.0):
    points = np.asarray(points, float)
    ones = np.ones(len(points))
    normals, curvature = ones[:, None] * normal, np.zeros((len(points), 3))
    return Patches(points, normals, ones * spread, ones * footprint, ones * error, curvature)


def on_wall(columns, rows=32, away=AWAY, **more):
    """Return patches where the camera at the origin sees the wall at these pixel coordinates."""
    columns, rows = np.broadcast_arrays(np.asarray(columns, float), np.asarray(rows, float))
    across = np.stack([columns - 32, 32 - rows], axis=-1) / FOCAL
    return patches(np.column_stack([across * away, -away * np.ones(len(across))]), **more)


# ---- patches --------------------------------------------------------------------------------


@pytest.mark.parametrize("depth", ["z", "distance"])
@pytest.mark.parametrize("grain", [0.0, 0.05])
def test_patches_lie_on_the_wall_and_are_as_wide_as_a_pixel_sees(depth, grain):
    lens = Rectilinear(width=64, height=48, focal_length=18)  # The focal length is 32 pixels.
    cos = -lens.pixel_rays()[..., 2]
    turn = Rotation.from_euler("xyz", [40, 20, -70], degrees=True).as_matrix()
    camera = at(1, -2, 3, [40, 20, -70], lens, depth, grain)
    image = wall(2.0, lens) / (1 if depth == "z" else cos)
    patches_of_wall = consistency.sample(camera, image.astype(np.float32), 48)
    assert len(patches_of_wall) == 48
    local = (patches_of_wall.points - [1, -2, 3]) @ turn
    np.testing.assert_allclose(local[:, 2], -2, rtol=1e-6)
    # There is one patch in each square of 8 pixels.
    pixels = np.floor(lens.pixels(local)).astype(int)
    assert len({(x // 8, y // 8) for x, y in pixels.tolist()}) == 48
    np.testing.assert_allclose(patches_of_wall.normals @ turn, [[0, 0, 1]] * 48, atol=1e-5)
    distance = np.linalg.norm(local, axis=1)
    cosine = 2 / distance
    # A step of tan θ along x turns the ray by √(1 + y²) cos² θ, and a step along y likewise.
    both = np.sqrt(1 + (local[:, :2] / 2) ** 2).prod(axis=1)
    angle = np.maximum(np.sqrt(both) * cosine**2 / 32, grain)
    np.testing.assert_allclose(patches_of_wall.footprint, distance * angle, rtol=2e-3)
    assert (patches_of_wall.spread < 1e-3 * patches_of_wall.footprint).all()
    beside = grain * np.sqrt((1 - cosine**2) / 2)
    np.testing.assert_allclose(patches_of_wall.error, distance * (2.0**-23 + beside), rtol=1e-2)


def test_patches_reach_the_last_pixel_that_has_neighbours_and_are_no_denser_than_two_pixels():
    patches_of_wall = consistency.sample(at(), wall(), 10**6)
    assert len(patches_of_wall) == 32 * 32
    pixels = NARROW.pixels(patches_of_wall.points)
    np.testing.assert_allclose(pixels.min(axis=0), 1.5, atol=1e-6)
    np.testing.assert_allclose(pixels.max(axis=0), 62.5, atol=1e-6)
    np.testing.assert_allclose(patches_of_wall.footprint, STEP, rtol=0.02)
    assert len(consistency.sample(at(), wall(), 16)) == 16


@pytest.mark.parametrize("smooth", [np.s_[:, :8], np.s_[:, 8:], np.s_[:8], np.s_[8:]])
def test_each_cell_gives_a_smooth_place(smooth):
    rough = np.random.default_rng(1).normal(AWAY, 0.2 * STEP, (16, 16))
    rough[smooth] = AWAY
    sampled = consistency.sample(at(), np.tile(rough, (4, 4)), 16)
    assert len(sampled) == 16
    assert sampled.spread.max() < 1e-6 * STEP
    assert len(consistency.sample(at(), np.full((64, 64), np.inf), 16)) == 0
    assert len(consistency.sample(at(), wall()[:2], 16)) == 0


def test_smoothness_is_relative_to_the_size_of_pixels():
    # The checks differ by a fifth of a pixel at 1 m, and by a tenth of one at 8 m.
    away, amount = np.array([[1.0], [8.0]]), np.array([[0.2], [0.1]])
    halves = away + np.where(np.arange(8) % 2, 1, -1) * amount * away / FOCAL
    rows = np.stack([halves.ravel(), 2 * np.repeat(away, 8) - halves.ravel()])
    sampled = consistency.sample(at(), np.tile(rows, (32, 4)), 16)
    assert len(sampled) == 16
    np.testing.assert_allclose(sampled.points[:, 2], -8, rtol=1e-2)


def test_spread_is_the_deviation_of_depth_from_a_plane():
    chequered = AWAY + 0.1 * STEP * (-1.0) ** np.indices((64, 64)).sum(axis=0)
    sampled = consistency.sample(at(), chequered, 10**6)
    assert len(sampled) == 1024
    # Five of nine pixels are farther than the other four. Their plane has three unknowns.
    heights = np.array([1, -1, 1, -1, 1, -1, 1, -1, 1]) * 0.1 * STEP
    expected = np.sqrt(((heights - heights.mean()) ** 2).sum() / 6)
    np.testing.assert_allclose(sampled.spread, expected, rtol=0.01)


@pytest.mark.parametrize("depth", ["z", "distance"])
def test_a_curved_surface_lies_before_its_plane(depth):
    # The ball of 1 m is 3 m away, so a pixel sees some 12 mm of it.
    lens = Rectilinear(width=64, height=64, focal_length=160 * 36 / 64)
    camera = at(lens=lens, depth=depth)
    rays = lens.pixel_rays()
    middle = np.array([0, 0, -3.0])
    half = rays @ middle
    with np.errstate(invalid="ignore"):
        distance = half - np.sqrt(half**2 - 8)
    recorded = np.where(np.isnan(distance), np.inf, distance)
    recorded = recorded * -rays[..., 2] if depth == "z" else recorded
    sampled = consistency.sample(camera, recorded, 400)
    inside = 1 - np.linalg.norm(sampled.points - middle, axis=1)
    assert inside.max() > 1e-4
    surface = sampled.points + sampled.normals * sampled.height()[:, None]
    assert np.abs(np.linalg.norm(surface - middle, axis=1) - 1).max() < inside.max() / 20


@pytest.mark.parametrize(("spread", "smooth"), [(0.33, True), (0.37, False)])
def test_depth_that_fits_no_plane_is_not_a_surface(spread, smooth):
    # The deviations of nine chequered pixels from their mean have 80 / 9 as sum of squares.
    chequered = np.where(np.indices((64, 64)).sum(axis=0) % 2, 1, -1)
    depth = AWAY + chequered * spread * STEP * np.sqrt(6 * 9 / 80)
    assert len(consistency.sample(at(), depth, 16)) == (16 if smooth else 0)


def test_a_floor_is_a_surface_except_at_grazing_angles():
    lens = Equidistant(width=256, height=256, fov=3)
    rays = lens.pixel_rays()
    with np.errstate(divide="ignore"):
        distance = np.where(rays[..., 1] < 0, -1 / rays[..., 1], np.inf)
    sampled = consistency.sample(at(lens=lens, depth="distance"), distance, 4000)
    cosine = 1 / np.linalg.norm(sampled.points, axis=1)
    assert 0.2 < cosine.min() < 0.21
    np.testing.assert_allclose(sampled.normals, [[0, 1, 0]] * len(sampled), atol=1e-6)


# ---- comparisons ----------------------------------------------------------------------------

ROW = np.linspace(20.3, 44.3, 40)


def verdicts(asked, depth, camera=None):
    comparison = consistency.compare(asked, camera or at(), depth)
    assert len(comparison.verdict) == len(asked)
    return set(comparison.verdict.tolist())


def chequered(amount):
    return wall() + np.where(np.indices((64, 64)).sum(axis=0) % 2, 1, -1) * amount * STEP


@pytest.mark.parametrize(
    ("asked", "depth", "tolerance", "slack"),
    [
        # In footprints: 0.05, 4 deviations of the centre of nine points, and both errors.
        ({}, wall(), 0.05, 0.001),
        ({"spread": 0.3 * STEP}, wall(), 0.4 + 0.05, 0.001),
        ({"error": 0.2 * STEP}, wall(), 0.2 + 0.05, 0.001),
        ({"footprint": 4 * STEP}, wall(), 4 * 0.05, 0.001),
        # The plane of nine chequered pixels is known to √(1/9 + 1/12) of their deviation.
        ({}, chequered(0.2), 4 * 0.2 * np.sqrt(80 / 54 * (1 / 9 + 1 / 12)) + 0.05, 0.03),
    ],
)
def test_a_point_agrees_within_the_tolerance_of_both_surfaces(asked, depth, tolerance, slack):
    for sign, verdict in ((1, CONTRADICT), (-1, OCCLUDED)):
        within, beyond = (sign * (tolerance + d) * STEP for d in (-slack - 0.001, slack + 0.001))
        near = on_wall(ROW, away=AWAY - within, **asked)
        assert verdicts(near, depth) == {AGREE}
        assert verdicts(on_wall(ROW, away=AWAY - beyond, **asked), depth) == {verdict}


def test_residuals_are_in_footprints_and_have_an_expected_deviation():
    asked = on_wall(ROW, away=AWAY - 0.2 * STEP, spread=0.3 * STEP, error=1.2 * STEP)
    comparison = consistency.compare(asked, at(), wall())
    assert comparison.smooth.all()
    np.testing.assert_allclose(comparison.footprint, STEP, rtol=0.02)
    np.testing.assert_allclose(comparison.residual, 0.2, rtol=0.02)
    # An error spread evenly within its bound has a √12th of it as deviation.
    expected = np.sqrt(0.1**2 + (0.05 / 4) ** 2 + 1.2**2 / 12)
    np.testing.assert_allclose(comparison.expected, expected, rtol=0.02)
    coarse = replace(asked, error=0 * asked.error)
    comparison = consistency.compare(coarse, at(grain=0.1), wall())
    grain = 0.1 * AWAY * np.abs(ROW - 32) / FOCAL / np.sqrt(2)
    unit = np.maximum(comparison.footprint, STEP)
    np.testing.assert_allclose(comparison.footprint, 0.1 * AWAY, rtol=0.01)
    finest = 0.05 / 4 * unit
    variance = (0.1 * STEP) ** 2 + finest**2 + grain**2 / 12
    np.testing.assert_allclose(comparison.expected, np.sqrt(variance) / unit, rtol=0.05)


@pytest.mark.parametrize(
    ("right", "away", "verdict"),
    [
        # At a step the answer is a range, widened by a footprint and the tolerance. The plane
        # across the step deviates by 3/8 of a footprint: 4 deviations are 0.66 of a footprint.
        (5.0, 3.0 - 1.65 * STEP, AGREE),
        (5.0, 3.0 - 1.77 * STEP, CONTRADICT),
        (5.0, 4.0, AGREE),
        (5.0, 5.0 + 1.65 * STEP, AGREE),
        (5.0, 5.0 + 1.77 * STEP, OCCLUDED),
        # Beside the sky there is no plane, so the tolerance is the least.
        (np.inf, 9.0, AGREE),
        (np.inf, 3.0 - 1.04 * STEP, AGREE),
        (np.inf, 3.0 - 1.06 * STEP, CONTRADICT),
        # A neighbour without a source tells nothing.
        (np.nan, 3.0, UNKNOWN),
    ],
)
def test_at_an_edge_anything_between_the_two_surfaces_agrees(right, away, verdict):
    depth = np.where(np.arange(64) < 32, 3.0, right) * np.ones((64, 1))
    # The world's origin does not matter. Beside the sky, the grain of depth does not either.
    for place, grain in (((0, 0, 0), 0), ((30, -20, 10), 0), ((3, 4, 0), 0.002)):
        if np.isfinite(right) and grain:
            continue
        asked = on_wall(np.full(3, 31.5), away=away)
        asked = replace(asked, points=asked.points + place)
        assert verdicts(asked, depth, at(*place, grain=grain)) == {verdict}


def test_a_surface_before_the_sky_contradicts():
    assert verdicts(on_wall(ROW), wall(np.inf)) == {CONTRADICT}
    # Without a source there is no answer.
    unknown = consistency.ask(on_wall(ROW), at(), at(), wall(np.nan))
    assert (unknown.agree, unknown.occluded, unknown.contradict) == (0, 0, 0)


@pytest.mark.parametrize(
    ("column", "row", "seen"),
    [
        (63, 32, 0),
        (32, 63, 0),
        (1.01, 32, 1),
        (0.99, 32, 0),
        (62.99, 32, 1),
        (63.01, 32, 0),
        (32, 1.01, 1),
        (32, 63.01, 0),
    ],
)
def test_only_points_inside_a_view_with_neighbours_are_compared(column, row, seen):
    comparison = consistency.compare(on_wall([column], [row]), at(), wall())
    assert len(comparison.verdict) == seen


def test_surfaces_seen_from_behind_or_at_grazing_angles_are_not_compared():
    for degrees, seen in ((0, 1), (78, 1), (79, 0), (180, 0)):
        normal = Rotation.from_euler("y", degrees, degrees=True).apply([0, 0, 1])
        comparison = consistency.compare(on_wall([32.0], normal=normal), at(), wall())
        assert len(comparison.verdict) == seen
    assert len(consistency.compare(on_wall(ROW), at(turn=[0, 180, 0]), wall()).verdict) == 0


def test_thirty_points_on_one_surface_measure():
    for count, by, measured in ((30, 0.9, 30), (29, 0.9, None), (40, 1.1, None), (40, -0.9, 40)):
        asked = on_wall(np.linspace(20, 44, count), away=AWAY - by * STEP)
        part = consistency.compare(asked, at(), wall()).measuring()
        assert measured == (part and len(part.residual))
        answer = consistency.ask(asked, at(), at(), wall())
        assert answer.measured == (measured or 0)
        assert (answer.displacement is None) == (measured is None)
        verdict = "contradict" if by > 0 else "occluded"
        assert getattr(answer, verdict) == count and answer.agree == 0


# ---- motion and scales ----------------------------------------------------------------------


def surfaces(count, seed):
    """Return points all around at 1 to 4 m, their normals at oblique angles, and footprints."""
    random = np.random.default_rng(seed)
    rays = random.normal(size=(count, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    normals = random.normal(size=(count, 3)) - 2 * rays
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return rays * random.uniform(1, 4, (count, 1)), normals, random.uniform(0.01, 0.03, count)


def compared(asked, surface_points, normals, footprint, residual=None, expected=0.1):
    """Return the comparison of points (n, 3) with surfaces at other points."""
    ones = np.ones(len(asked))
    if residual is None:
        residual = ((asked - surface_points) * normals).sum(axis=1) / footprint
    first, second = (
        Patches(points, normals, 0 * ones, footprint, 0 * ones, np.zeros((len(points), 3)))
        for points in (asked, surface_points)
    )
    verdict = np.full(len(asked), AGREE)
    expected = expected * ones
    return Comparison(verdict, ones > 0, first, second, residual, footprint, expected, residual)


def test_displacement_is_the_motion_in_pixels_that_brings_surfaces_together():
    points, normals, footprint = surfaces(80, 1)
    camera = at(0.3, -0.2, 0.5)
    shift, turn = np.array([0.004, -0.007, 0.002]), np.array([-0.001, 0.003, 0.002])
    moved = shift + np.cross(turn, points - camera.position)
    measured = compared(points - moved, points, normals, footprint)
    motion, _ = consistency.displacement(measured, camera)
    pixels = np.linalg.norm(moved, axis=1) / footprint
    assert motion == pytest.approx(np.sqrt((pixels**2).mean()), rel=0.01)
    # A few points of another surface hardly count.
    residual = measured.curved_residual + 3 * (np.arange(80) % 20 == 0)
    robust, _ = consistency.displacement(replace(measured, curved_residual=residual), camera)
    assert robust == pytest.approx(motion, rel=0.1)


def test_displacement_has_the_deviation_expected_from_noise():
    points, normals, footprint = surfaces(60, 2)
    random = np.random.default_rng(3)
    of_points = random.uniform(0.05, 0.3, 60)
    motions = []
    for _ in range(100):
        noise = random.normal(0, of_points)
        measured = compared(points, points, normals, footprint, noise, of_points)
        motions.append(consistency.displacement(measured, at()))
    moved, expected = np.sqrt((np.array(motions) ** 2).mean(axis=0))
    assert moved == pytest.approx(expected, rel=0.1)
    # Noise that is larger than expected shows in what the motion leaves.
    noise = random.normal(0, 0.2, 60)
    measured = compared(points, points, normals, footprint, noise, expected=0.01)
    told = compared(points, points, normals, footprint, noise, expected=0.2)
    assert consistency.displacement(measured, at())[1] == pytest.approx(
        consistency.displacement(told, at())[1], rel=0.25
    )
    # A motion along the wall does not show, so nothing moves.
    flat = on_wall(ROW, rows=np.tile([20, 28, 36, 44], 10))
    along = compared(flat.points + np.array([0.1, 0, 0]), flat.points, flat.normals, flat.footprint)
    assert consistency.displacement(along, at())[0] < 1e-6


@pytest.mark.parametrize(("angle", "depth"), [(1e-3, 0.0), (0.0, 1e-3), (-1e-3, 2e-3)])
def test_scales_are_the_missing_factors_of_angles_and_depths(angle, depth):
    points, normals, footprint = surfaces(400, 4)
    right = lenses.from_camera({"lens": "equidistant", "resolution": [512, 512], "fov": 300})
    wrong = replace(right, fov=right.fov * (1 + angle))
    answers, cameras = consistency.NOTHING, [at(0.3, 0, 0.2), at(-0.1, 0.4, 0, [20, 50, -30])]
    for asking, answering in (cameras, cameras[::-1]):
        recorded = []
        for camera in (asking, answering):
            arms = (points - camera.position) @ camera.world_from_camera[:3, :3]
            distance = np.linalg.norm(arms, axis=1, keepdims=True) * (1 + depth)
            rays = wrong.rays(*right.pixels(arms).T)
            recorded.append(rays * distance @ camera.world_from_camera[:3, :3].T + camera.position)
        usable = np.isfinite(recorded).all(axis=(0, 2))
        measured = compared(*(each[usable] for each in (*recorded, normals, footprint)))
        moments = consistency.scale_moments(measured, asking, answering)
        answers += Answer(moments=moments, measured=int(usable.sum()))
    scales, deviation = consistency.scales(answers)
    np.testing.assert_allclose(scales, [-angle, -depth], atol=2e-5)
    # Nothing is left but rounding.
    assert (deviation < 1e-5).all()


def test_large_residuals_count_less():
    points, normals, footprint = surfaces(33, 7)
    residual = np.where(np.arange(33) < 30, 1.0, 3.0) * np.where(np.arange(33) % 2, 1, -1)
    measured = compared(points, points, normals, footprint, residual)
    moments = consistency.scale_moments(measured, at(1, 0, 0), at())
    # Beyond 1.5 medians the weight falls as the residual grows.
    assert moments[2, 2] == pytest.approx(30 + 3 * 1.5 / 3 * 3**2)


def test_a_scale_that_moves_no_point_by_what_rounding_does_is_not_determined():
    """All views look at a table's top from one height. Only rounding tilts it, and shifts it."""
    rng = np.random.default_rng(0)
    by_angle = 7 * rng.standard_normal(800)
    by_depth = 0.003 * rng.standard_normal(800)
    residual = 0.0125 * by_depth + 3e-5 * rng.standard_normal(800)
    columns = np.stack([by_angle, by_depth, -residual], axis=1)
    answers = Answer(moments=columns.T @ columns, measured=800)
    (_, depth), (angle_deviation, depth_deviation) = consistency.scales(answers)
    assert depth_deviation > 2 * abs(depth)
    assert angle_deviation < 1e-4


def test_the_deviation_of_scales_is_that_of_their_noise():
    points, normals, footprint = surfaces(300, 5)
    asking, answering = at(0.3, 0, 0.2), at(-0.1, 0.4, 0)
    random = np.random.default_rng(6)
    ratios = []
    for _ in range(60):
        noise = random.normal(0, 0.2, 300)
        measured = compared(points, points, normals, footprint, noise)
        moments = consistency.scale_moments(measured, asking, answering)
        scales, deviation = consistency.scales(Answer(moments=moments, measured=300))
        ratios.append(scales / deviation)
    np.testing.assert_allclose(np.sqrt((np.array(ratios) ** 2).mean(axis=0)), 1, atol=0.25)
    for few in (Answer(moments=moments, measured=29), Answer(measured=30)):
        scales, deviation = consistency.scales(few)
        assert (scales == 0).all() and np.isinf(deviation).all()
    assert np.isfinite(consistency.scales(Answer(moments=moments, measured=30))[1]).all()
    # Depth's scale does not show from one place.
    alone = consistency.scale_moments(measured, asking, replace(asking))
    assert np.isinf(consistency.scales(Answer(moments=alone, measured=300))[1]).all()


# ---- pairs and answers ----------------------------------------------------------------------


def test_a_view_is_compared_with_three_near_ones_and_three_farther_ones():
    line = [at(0.001 * number) for number in range(61)]
    seen, few = on_wall(np.linspace(10, 50, 30)), on_wall(np.linspace(10, 50, 29))
    nothing = patches(np.zeros((0, 3)))

    def pairs(cameras, own=seen):
        return consistency.view_pairs(cameras, [own] + [nothing] * (len(cameras) - 1))

    # The farther views begin at a quarter, a half and three quarters of the 48 nearest.
    assert pairs(line) == [(0, other) for other in (1, 2, 3, 13, 25, 37)]
    assert pairs(line, few) == []
    blind = list(line)
    for number in (1, 25):
        blind[number] = at(0.001 * number, turn=[0, 180, 0])
    assert pairs(blind) == [(0, other) for other in (2, 3, 4, 13, 26, 37)]
    assert pairs(line[:5]) == [(0, other) for other in (1, 2, 3, 4)]
    # Cameras at one place are neighbours too. Each pair appears once.
    assert consistency.view_pairs([at(), at(), at()], [seen] * 3) == [(0, 1), (0, 2), (1, 2)]


def test_answers_add_up():
    answer = Answer(20, 3, 7, 0.5, 0.1, np.eye(3), 25)
    other = Answer(8, 1, 2, None, None, 2 * np.eye(3), 0)
    both = answer + other + Answer(displacement=1.0, expected=0.3)
    assert (both.agree, both.occluded, both.contradict, both.measured) == (28, 4, 9, 25)
    assert (both.displacement, both.expected) == (0.75, 0.2)
    np.testing.assert_array_equal(both.moments, 3 * np.eye(3))
    assert (consistency.NOTHING + other).displacement is None
    # Only the 30 points of the deciding pair count.
    assert Answer(27, 9, 3).contradiction == 0.1
    assert Answer(26, 9, 3).contradiction is None
