"""How many bytes the views of a page have."""

import json
import zlib

import numpy as np
import pytest
from sphere import write_views

from lightfield.geometry import rigs
from lightfield.reading.dataset import OpenDataset
from lightfield.report import views

CAMERA = {"lens": "equidistant", "fov": 180, "resolution": [128, 128]}
RIG = {"type": "ring", "count": 8, "size": 1.0, "camera": CAMERA}


def look_at_noise(lens, matrix):
    """Return noise of light and depth, which no codec makes small."""
    noise = np.random.default_rng(zlib.crc32(matrix.tobytes())).random((lens.height, lens.width, 4))
    return noise[..., :3], np.where(np.isnan(lens.pixel_rays()[..., 0]), np.nan, 1 + noise[..., 3])


@pytest.fixture(scope="module")
def noisy(tmp_path_factory):
    folder = tmp_path_factory.mktemp("noisy") / "dataset"
    write_views(folder, CAMERA, rigs.from_settings(RIG), see=look_at_noise)
    return folder


def collected(folder):
    return views.collect(OpenDataset.in_folder(folder), rigs.from_settings(RIG)).data


def test_views_keep_their_size_if_the_page_stays_small(noisy):
    assert collected(noisy)["size"] == [128, 128]


@pytest.mark.parametrize(("most", "size"), [(350_000, 96), (220_000, 64)])
def test_too_many_bytes_make_views_smaller(noisy, monkeypatch, most, size):
    monkeypatch.setattr(views, "MOST_BYTES", most)
    data = collected(noisy)
    assert data["size"] == [size, size]
    assert len(json.dumps([data[key] for key in ("embedded", "points", "walk")])) <= most
