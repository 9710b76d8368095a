"""A build with light groups: other lights are developed without rendering again."""

import json

import pytest
from bookkeeping import rendered
from checkouts import checkout, planned, snakemake

pytestmark = pytest.mark.slow

# The room has one lamp, and no sky.
LIT = """
scene: {builder: room}
render: {samples: 1, light_groups: each}
rigs:
  LFOne:
    type: lattice
    cameras: [2, 1, 1]
    size: 0.3
    center: [0, 0, 1.2]
    camera: {lens: equidistant, fov: 180, resolution: [16, 16]}
relight:
  dim: {lamp: 0.25}
  olat: each
report: {panorama: true}
"""
CHOSEN = ("--config", "scenes=lit", "preset=full")


def test_a_build_relights_and_does_not_render_for_another_light(tmp_path):
    folder = checkout(tmp_path / "plenoforge", lit=LIT)
    result = snakemake(folder, *CHOSEN)
    assert result.returncode == 0, result.stdout + result.stderr
    dataset = folder / "results/lit/LFOne"
    for name in ("exr", "Combined_lamp", "dim"):
        assert len([*dataset.glob(f"{name}/*.exr")]) == 2
    assert (dataset / "olat/view_0001f_lamp.exr").exists()
    validation = json.loads((dataset / "validation.json").read_text())
    assert validation["valid"]
    assert {"light_groups", "olat/colour"} <= {check["name"] for check in validation["checks"]}
    assert 'id="light-0"' in (dataset / "report/index.html").read_text()
    views = rendered(folder)
    scene = folder / "configs/scenes/lit.yaml"
    scene.write_text(LIT.replace("0.25", "[1, 0.5, 0.25]"))
    assert not {"render", "render_panorama", "inventory", "lightfield"} & {
        *planned(folder, *CHOSEN)
    }
    result = snakemake(folder, "results/lit/LFOne/validation.json", *CHOSEN)
    assert result.returncode == 0, result.stdout + result.stderr
    assert rendered(folder) == views
    light = json.loads((dataset / "dim/lightfield.json").read_text())["reprojection"]["relight"]
    assert light == {"lamp": [1, 0.5, 0.25]}
