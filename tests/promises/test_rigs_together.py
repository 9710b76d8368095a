"""One export of several rigs: built, checked, and made again when a view of any rig is new."""

import json
from pathlib import Path

import numpy as np
import pycolmap
import pytest
import tiny
from bookkeeping import rendered
from checkouts import checkout, planned, snakemake

from lightfield.formats.lightfield import LightField

pytestmark = pytest.mark.slow
CAMERA = {"lens": "rectilinear", "fov": 80, "resolution": [24, 24]}
SCENE = {
    "licence": "CC0-1.0",
    "scene": {"builder": "room"},
    "render": {"samples": 1},
    "rigs": {
        "inner": {"type": "plane", "cameras": [2, 2], "size": 0.5, "center": [0, 0, 1.2]},
        "outer": {"type": "random", "count": 4, "clearance": 0.1, "center": [0, 0, 1.2]},
    },
    "exports": {
        "colmap": {"sources": ["views"], "together": ["inner", "outer"], "points": 200},
        "instant_ngp": {"sources": ["views"], "together": ["inner", "outer"]},
    },
    "report": {"panorama": False},
}
for rig in SCENE["rigs"].values():
    rig["camera"] = CAMERA
INNER = Path("results/tiny/inner")
MODEL = INNER / "exports/colmap"


def model(folder):
    """Return the centre of each image's camera in the COLMAP model."""
    images = pycolmap.Reconstruction(folder / MODEL / "sparse/0").images.values()
    return {Path(image.name).stem: image.projection_center() for image in images}


def listed(folder):
    """Return the names of the views in the first rig's transforms.json, which has their images."""
    frames = json.loads((folder / INNER / "transforms.json").read_text())["frames"]
    paths = [frame["file_path"] for frame in frames]
    published = (folder / INNER / "sha256sums.txt").read_text()
    assert all(f"  {path}\n" in published for path in paths)
    return {Path(path).stem for path in paths}


def test_two_rigs_in_one_export_are_built_and_grow(tmp_path):
    folder = checkout(tmp_path / "together", tiny=json.dumps(SCENE))
    said = tiny.build(folder)
    assert all(f"valid: results/tiny/{rig}/report" in said for rig in SCENE["rigs"])
    inner, outer = (
        LightField.read(folder / f"results/tiny/{rig}/lightfield.json").views
        for rig in ("inner", "outer")
    )
    expected = {view.name: view.position for view in inner}
    expected |= {f"outer_{view.name}": view.position for view in outer}
    centres = model(folder)
    assert centres.keys() == expected.keys() and len(centres) == 8
    for name, position in expected.items():
        np.testing.assert_allclose(centres[name], position, atol=1e-6)
    assert listed(folder) == expected.keys()
    outer_files = {path.name for path in (folder / "results/tiny/outer").iterdir()}
    assert not outer_files & {"exports", "transforms.json"}

    (folder / "results/tiny/outer/exr/view_0001f.exr").unlink()
    jobs = planned(folder, *tiny.CHOSEN)
    assert (jobs["render"], jobs["export"], jobs["export_to_instant_ngp"]) == (1, 1, 1)
    tiny.edit(folder, '"count": 4', '"count": 6')
    tiny.build(folder)
    assert len(model(folder)) == len(listed(folder)) == 10
    counts = {view: count for (_, view), count in rendered(folder, "tiny/outer").items()}
    assert [name for name, count in counts.items() if count > 1] == ["view_0001f"]
    assert set(rendered(folder, "tiny/inner").values()) == {1}
    assert "Nothing to be done" in snakemake(folder, "--dry-run", *tiny.CHOSEN).stderr
