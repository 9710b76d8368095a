"""A user's scenes, poses and results in a folder of their own, outside the repository."""

import json

import forks
import pytest
from checkouts import ROOT

SCENE = """
scene: {builder: room}
render: {samples: 1}
rigs:
  LFOwn:
    type: poses
    file: poses/mine.csv
    camera: {lens: rectilinear, fov: 60, resolution: [16, 16]}
report: {panorama: false}
"""
# The example of docs/how-to/keep-your-own-folder.md.
WORKFLOW = f"""
module plenoforge:
    snakefile: "{ROOT}/Snakefile"
    config: {{"scenes": ["mine"], "preset": "full", "results": "lightfields"}}

use rule * from plenoforge as plenoforge_*

onstart: plenoforge.onstart()
onsuccess: plenoforge.onsuccess()
onerror: plenoforge.onerror()

rule count:
    default_target: True
    input: rules.plenoforge_all.input, "lightfields/mine/LFOwn/sha256sums.txt"
    output: "count.txt"
    shell: "ls lightfields/mine/LFOwn/exr/*.exr | wc -l > {{output}}"
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "configs" / "scenes").mkdir(parents=True)
    (tmp_path / "configs/scenes/mine.yaml").write_text(SCENE)
    (tmp_path / "poses").mkdir()
    (tmp_path / "poses/mine.csv").write_text("name,x,y,z,rx,ry,rz\none,0,0,1.3,1.6,0,0\n")
    return tmp_path


def snakemake(*arguments, cwd="/"):
    result = forks.run_snakemake(arguments, cwd, merge_outputs=True)
    return result.returncode, result.stdout


@pytest.mark.slow
def test_scenes_poses_results_and_work_are_in_the_users_folder(folder):
    before = set(ROOT.rglob("*.json"))
    (folder / "our tools").symlink_to(ROOT)
    folder_arguments = ("--snakefile", folder / "our tools/Snakefile", "--directory", folder)
    chosen = ("--config", "scenes=mine", "preset=full")
    code, said = snakemake(
        *folder_arguments, "--cores", "1", "results/mine/LFOwn/lightfield.json", *chosen
    )
    assert code == 0, said
    content = json.loads((folder / "results/mine/LFOwn/lightfield.json").read_text())
    assert [frame["position"] for frame in content["frames"]] == [[0, 0, 1.3]]
    assert (folder / "work/logs/mine/LFOwn/lightfield.log").is_file()
    # With the choice of that page: all rigs of these scenes.
    (folder / "config.yaml").write_text("scenes: [mine]\npreset: full\n")
    code, said = snakemake(*folder_arguments, "--cores", "1", "verify")
    assert code == 0, said
    assert "no fault in results/mine/LFOwn\n" in said
    assert set(ROOT.rglob("*.json")) == before


@pytest.mark.slow
def test_as_a_module_of_the_users_own_workflow(folder):
    (folder / "Snakefile").write_text(WORKFLOW)
    # The module has the user's own workflow, but no settings of Plenoforge.
    (folder / "config.yaml").write_text("epochs: 3\n")
    code, said = snakemake("--cores", "2", cwd=folder)
    assert code == 0, said
    assert (folder / "count.txt").read_text().strip() == "1"
    assert "\nvalid: lightfields/mine/LFOwn/report/index.html\n" in said
    code, said = snakemake("--cores", "1", cwd=folder)
    assert "Nothing to be done" in said
    code, said = snakemake("--cores", "1", "plenoforge_verify", cwd=folder)
    assert (code, "no fault in lightfields/mine/LFOwn" in said) == (0, True), said
    # The last message of a failure appears here too.
    (folder / "poses/mine.csv").write_text("name,x,y,z,rx,ry,rz\none,0,0,0,0,0,0\n")
    code, said = snakemake("--cores", "1", "--logger", "plenoforge", cwd=folder)
    assert code == 1
    assert "\nplenoforge_check_cameras failed: error: lightfields/mine/LFOwn/lightfield.j" in said
