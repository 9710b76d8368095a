"""A user's scenes, poses and results in a folder of their own, outside the repository."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

SCENE = """
scene: {builder: room}
render: {samples: 1}
rigs:
  LFOwn:
    type: poses
    file: poses/mine.csv
    camera: {lens: rectilinear, fov: 60, resolution: [32, 32]}
"""


@pytest.mark.slow
def test_scenes_poses_results_and_work_are_in_the_users_folder(tmp_path):
    (tmp_path / "configs" / "scenes").mkdir(parents=True)
    (tmp_path / "configs/scenes/mine.yaml").write_text(SCENE)
    (tmp_path / "poses").mkdir()
    (tmp_path / "poses/mine.csv").write_text("name,x,y,z,rx,ry,rz\none,1,2,3,0,0,0\n")
    before = set(ROOT.rglob("*.json"))
    result = subprocess.run(
        [
            Path(sys.executable).with_name("snakemake"),
            *("--snakefile", ROOT / "Snakefile", "--directory", tmp_path, "--cores", "1"),
            "results/mine/LFOwn/lightfield.json",
            *("--config", "scenes=mine", "preset=full"),
        ],
        cwd="/",
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    content = json.loads((tmp_path / "results/mine/LFOwn/lightfield.json").read_text())
    assert [frame["position"] for frame in content["frames"]] == [[1, 2, 3]]
    assert (tmp_path / "work/logs/mine/LFOwn/lightfield.log").is_file()
    assert set(ROOT.rglob("*.json")) == before
