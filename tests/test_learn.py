"""What `make learn` learns from: exported files read, gradients, and a field of a known scene."""

import numpy as np
import pytest
from sphere import LENSES, RADIUS, write_views

import learn
from lightfield import export
from lightfield.core.progress import Progress
from lightfield.dataset.exports import settings_of
from lightfield.export.source import SourceDataset
from radiance_field import Field, _samples

RIG = {"type": "random", "count": 40, "size": [2, 2, 1]}
KINDS = {"perspective": "Z", "fisheye": "distance", "panorama": "distance"}


@pytest.fixture(scope="module")
def views(tmp_path_factory):
    """The views of nerfstudio exports from inside a sphere, as learn.py reads them, by lens."""
    folder = tmp_path_factory.mktemp("learn")
    options = {"sources": ["views"], "depth": True, "points": 100}
    settings = settings_of("nerfstudio").model_validate(options)
    found = {}
    for name in KINDS:
        write_views(folder / name / "dataset", LENSES[name], RIG)
        source = SourceDataset(folder / name / "dataset", "", ".exr")
        export.run("nerfstudio", source, settings, folder / name / "export")
        found[name] = learn.read(folder / name / "export")
    return found


@pytest.mark.parametrize("name", KINDS)
def test_exported_files_say_where_surfaces_are(views, name):
    own = views[name]
    assert (own.lens, own.kind, own.test.sum()) == (name, KINDS[name], 5)
    for test in (True, False):
        origins, rays, colour, distance = own.pixels(test)
        points = origins + rays * distance[:, None]
        np.testing.assert_allclose(np.linalg.norm(points, axis=1), RADIUS, atol=2e-3)
        expected = (40 + 175 * (points / RADIUS / 2 + 0.5)) / 255
        np.testing.assert_allclose(colour, expected, atol=4e-3)


@pytest.mark.parametrize("name", KINDS)
def test_each_wrong_reading_changes_one_thing(views, name):
    readings = dict(learn.readings(views[name]))
    true = readings.pop(learn.TRUE)
    assert true is views[name]
    parts = ("poses", "colour", "depth", "valid", "distance")
    changed = [
        {part for part in parts if not np.array_equal(getattr(one, part), getattr(true, part))}
        for one in readings.values()
    ]
    valid = {"valid"} if name == "fisheye" and not true.valid.all() else set()
    assert changed[0] == {"poses"}
    assert changed[1] - valid == {"colour", "depth", "distance"}
    assert changed[2] == {"distance"}


def test_gradients_are_those_of_the_loss(views):
    origins, rays, colour, distance = (part[::997] for part in views["perspective"].pixels(False))
    field = Field(np.zeros(3), RADIUS, 30)
    for _ in range(10):
        field.learn(origins, rays, colour, distance)
    # One that meets nothing has its light from beyond all.
    distance[0] = np.inf
    ends, taught = field._intervals(distance)
    arguments = (origins, rays, colour, ends, taught, np.full(taught.shape, 0.4, np.float32))
    _, gradients = field.loss(*arguments)
    random = np.random.default_rng(1)
    for parameter, gradient in zip(field.parameters, gradients, strict=True):
        towards = (gradient + random.standard_normal(gradient.shape) * gradient.std()).astype("f4")
        towards *= 2e-3 / np.abs(towards).max()
        before = parameter.copy()
        losses = []
        for sign in (1, -1):
            parameter[...] = before + sign * towards
            losses.append(field.loss(*arguments)[0])
        parameter[...] = before
        expected = float((gradient * towards).sum())
        assert (losses[0] - losses[1]) / 2 == pytest.approx(expected, rel=0.02)


def test_intervals_hold_the_surface_and_follow_each_other():
    field = Field(np.zeros(3), 1.0, 1)
    distance = np.array([0.05, 0.7, 30, np.inf], np.float32)
    ends, taught = field._intervals(distance)
    along, steps = _samples(ends, np.float32(0.5))
    assert (np.diff(along) > 0).all()
    np.testing.assert_allclose(ends[:, :-2] + steps[:, :-1], ends[:, 1:-1], rtol=1e-5)
    assert taught[:, -1].tolist() == [False, False, False, True]
    for ray, surface in ((1, 0.7), (2, 30)):
        assert abs(along[ray][taught[ray]] / surface - 1).max() < 0.03


@pytest.mark.slow
def test_a_field_is_learned_from_true_poses_and_not_from_shuffled_ones(views, monkeypatch):
    monkeypatch.setattr(learn, "LOOKS", 1)
    monkeypatch.setattr(learn, "LOOKED_AT", 500)
    readings = dict(learn.readings(views["panorama"]))
    progress = Progress(2, "learn", "looks")
    found = [
        learn.learn(readings[name], progress, steps=60)[1][-1]["psnr"]
        for name in (learn.TRUE, "shuffled poses")
    ]
    assert found[0] > found[1] + 5
