"""The inertial sensor of a path: checked, published, mended, and changed without a new view."""

import json
from pathlib import Path

import pytest
import tiny
from bookkeeping import rendered
from checkouts import checkout, planned, snakemake

pytestmark = pytest.mark.slow
SCENE = {
    "licence": "CC0-1.0",
    "scene": {"builder": "room"},
    "render": {"samples": 1},
    "rigs": {
        "walk": {
            "type": "path",
            "count": 4,
            "center": [0, 0, 1.2],
            "keys": [
                {"position": [-0.4, 0, 0]},
                {"position": [0, 0.3, 0]},
                {"position": [0.4, 0, 0]},
            ],
            "camera": {"lens": "rectilinear", "fov": 80, "resolution": [24, 24]},
            "imu": {"seconds": 2, "rate": 100, "gyroscope_noise_density": 0.001, "seed": 5},
        }
    },
    "reprojections": {"png": {}},
    "report": {"panorama": False},
}
WALK = Path("results/tiny/walk")
FILES = {"imu/imu.csv", "imu/groundtruth.csv", "imu/views.csv"}


def test_the_files_of_a_sensor_are_published_mended_and_changed(tmp_path):
    folder = checkout(tmp_path / "sensor", tiny=json.dumps(SCENE))
    said = tiny.build(folder)
    assert "valid: results/tiny/walk/report" in said
    published = (folder / WALK / "sha256sums.txt").read_text().split()
    assert {*published} >= FILES
    recorded = json.loads((folder / WALK / "lightfield.json").read_text())["imu"]
    assert (recorded["seconds"], recorded["rate"], recorded["gravity"]) == (2, 100, 9.81)
    before = {name: (folder / WALK / name).read_bytes() for name in FILES}

    (folder / WALK / "imu/imu.csv").write_text("damaged")
    (folder / WALK / "imu/views.csv").unlink()
    assert planned(folder, *tiny.CHOSEN)["lightfield"] == 1
    tiny.build(folder)
    assert {name: (folder / WALK / name).read_bytes() for name in FILES} == before

    tiny.edit(folder, '"seed": 5', '"seed": 6')
    tiny.build(folder)
    after = {name: (folder / WALK / name).read_bytes() for name in FILES}
    assert {name for name in FILES if after[name] != before[name]} == {"imu/imu.csv"}
    assert {*rendered(folder, "tiny/walk").values()} == {1}
    assert "Nothing to be done" in snakemake(folder, "--dry-run", *tiny.CHOSEN).stderr

    imu = json.dumps(SCENE["rigs"]["walk"]["imu"] | {"seed": 6})
    tiny.edit(folder, f', "imu": {imu}', "")
    tiny.build(folder)
    assert not (folder / WALK / "imu").exists()
    assert {*rendered(folder, "tiny/walk").values()} == {1}
