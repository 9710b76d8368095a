"""The views from which `make learn` learns: exports, as benchmarks/nerfstudio_views.py reads them.

`make consumers` checks with torch that a radiance field learns from them.
"""

import numpy as np
import pytest
from checkouts import checkout, snakemake
from sphere import LENSES, RADIUS, write_views

import nerfstudio_views
from lightfield import export
from lightfield.configuration.exports import settings_of
from lightfield.export.source import SourceDataset

RIG = {"type": "random", "count": 40, "size": [2, 2, 1]}
KINDS = {"perspective": "Z", "fisheye": "distance", "panorama": "distance"}


@pytest.fixture(scope="module")
def views(tmp_path_factory):
    """The views of nerfstudio exports from inside a sphere, by lens."""
    folder = tmp_path_factory.mktemp("learn")
    options = {"sources": ["views"], "depth": True, "points": 100}
    settings = settings_of("nerfstudio").model_validate(options)
    views_by_lens = {}
    for name in KINDS:
        write_views(folder / name / "dataset", LENSES[name], RIG)
        source = SourceDataset(folder / name / "dataset", "", ".exr")
        export.run("nerfstudio", source, settings, folder / name / "export")
        views_by_lens[name] = nerfstudio_views.read(folder / name / "export")
    return views_by_lens


@pytest.mark.parametrize("name", KINDS)
def test_exported_views_know_where_surfaces_are(views, name):
    exported = views[name]
    assert (exported.lens, exported.kind, exported.test.sum()) == (name, KINDS[name], 5)
    for test in (True, False):
        origins, rays, colour, distance = exported.pixels(test)
        points = origins + rays * distance[:, None]
        np.testing.assert_allclose(np.linalg.norm(points, axis=1), RADIUS, atol=2e-3)
        expected = (40 + 175 * (points / RADIUS / 2 + 0.5)) / 255
        np.testing.assert_allclose(colour, expected, atol=4e-3)


@pytest.mark.parametrize("name", KINDS)
def test_each_wrong_reading_changes_one_thing(views, name):
    readings = dict(nerfstudio_views.readings(views[name]))
    true = readings.pop(nerfstudio_views.TRUE)
    assert true is views[name]
    parts = ("poses", "colour", "depth", "valid", "distance")
    changed = [
        {part for part in parts if not np.array_equal(getattr(wrong, part), getattr(true, part))}
        for wrong in readings.values()
    ]
    valid = {"valid"} if name == "fisheye" and not true.valid.all() else set()
    assert changed[0] == {"poses"}
    assert changed[1] - valid == {"colour", "depth", "distance"}
    assert changed[2] == {"distance"}


@pytest.mark.slow
def test_learn_without_torch_says_which_command_to_run(tmp_path):
    folder = checkout(tmp_path)
    scene = ("--config", "scenes=[object_learn]", "rigs=all", "preset=full")
    result = snakemake(folder, "learn", *scene)
    assert result.returncode != 0
    (error,) = [line for line in result.stderr.splitlines() if line.startswith("error: ")]
    assert "make -C . .venv-consumers/complete" in error
    assert "Traceback" not in result.stderr
    # It fails before the first job.
    assert not list(folder.rglob("*.blend"))
