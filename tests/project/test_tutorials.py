"""The tutorials' commands, and the README's lines of Python, run as they are written.

A tiny room takes the place of the garden.

Comments in a tutorial, which readers do not see, tell the test about the code below them:

- ``<!-- file: PATH -->``: the code is a file that the reader saves.
- ``<!-- not run: REASON -->``: the code needs what a test does not have.
- ``<!-- fails -->``: the command must be refused.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import forks
import pytest
from checkouts import ROOT, checkout
from oracles.readers.colmap import read_model

TUTORIALS = ROOT / "docs/tutorials"
# Comment, language and content of each block of code.
BLOCK = re.compile(r"(?:^<!-- (.*?) -->\n)?^```(bash|yaml)\n(.*?)^```$", re.M | re.S)
# The garden takes minutes.
GARDEN = """
scene: {builder: room}
render: {samples: 1}
rigs:
  LFSphere_e100cm_d170cm:
    type: sphere
    subdivisions: 1
    size: 0.5
    center: [0, 0, 1.3]
    camera: {lens: equidistant, fov: 180, resolution: [32, 32]}
reprojections:
  perspective:
    camera: {lens: rectilinear, fov: 90, resolution: [32, 32]}
exports:
  instant_ngp: {sources: [perspective]}
report: {panorama: false}
"""
DATASET = "results/garden_preview/LFSphere_e100cm_d170cm"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A checkout with a tiny garden, and an environment that `make` takes for complete."""
    folder = checkout(tmp_path_factory.mktemp("tutorials") / "plenoforge", garden=GARDEN)
    (folder / "Makefile").write_text((ROOT / "Makefile").read_text())
    programs = folder / ".venv/bin"
    programs.mkdir(parents=True)
    for program in Path(sys.executable).parent.iterdir():
        (programs / program.name).symlink_to(program)
    # These run in forks.
    for name in ("python", "snakemake"):
        (programs / name).unlink()
        (programs / name).symlink_to(forks.python().with_name(name))
    (programs / "activate").unlink()
    (programs / "activate").write_text(f"export PATH={programs}:$PATH\n")
    # This order, so that make sets up nothing.
    for stamp in ("packages", "complete", "complete-with-slurm"):
        (folder / ".venv" / stamp).touch()
    return folder


def script(tutorial):
    """Return a tutorial as a script for Bash."""
    lines = ["set -euo pipefail"]
    for comment, language, code in BLOCK.findall((TUTORIALS / tutorial).read_text()):
        kind, _, value = comment.partition(": ")
        if kind == "file":
            lines.append(f"cat > {value} << 'END OF FILE'\n{code}END OF FILE")
        elif language == "yaml" or kind == "not run":
            continue
        elif kind == "fails":
            lines.append(f"if ( {code} ); then echo 'this did not fail'; exit 1; fi")
        else:
            assert not comment, comment
            lines.append(code)
    return "\n".join(lines)


def run(folder, commands):
    # The environment is active only after the tutorial has activated it.
    kept = {name: value for name, value in os.environ.items() if name != "VIRTUAL_ENV"}
    result = subprocess.run(
        ["bash", "-c", commands],
        cwd=folder,
        env=kept | {"CORES": "2"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout
    return result.stdout


@pytest.mark.slow
def test_the_first_dataset_is_built_mended_and_followed_by_a_scene_of_ones_own(folder):
    output = run(folder, script("first-dataset.md"))
    assert f"valid: {DATASET}/report/index.html" in output
    assert re.search(r"view_0000f at \[.*\]: colour .*, depth \d\.\d+ m", output)
    assert (folder / DATASET / "exr/view_0003f.exr").is_file()
    assert (folder / "my_project/results/mine/ring/sha256sums.txt").is_file()
    plan = output.rpartition("phase ")[2]
    assert re.search(r"^views +1 +4 ", plan, re.M)
    assert not re.search(r"^scene ", plan, re.M)


@pytest.mark.slow
def test_the_readme_s_lines_read_the_dataset_that_make_builds(folder):
    (code,) = re.findall(r"^```python\n(.*?)^```$", (ROOT / "README.md").read_text(), re.M | re.S)
    program = (
        f"points = [[0, 0, 1]]\n{code}print(*view.rgb.shape, *directions.shape, *pixels.shape)"
    )
    output = run(folder, f"make\nPYTHONPATH=scripts python - << 'END'\n{program}\nEND")
    assert output.endswith("32 32 3 32 32 3 1 2\n")


@pytest.mark.slow
def test_ones_own_blend_is_rendered_refused_after_a_change_and_accepted(folder):
    output = run(folder, script("your-own-blend.md"))
    assert "note: character.blend: " in output
    assert "its sha256 is" in output
    for rig in ("around", "camera"):
        assert (folder / f"my_blend/results/character_tiny/{rig}/sha256sums.txt").is_file()


@pytest.mark.slow
def test_a_splat_gets_views_points_and_a_measure_that_finds_no_error_in_the_truth(folder):
    output = run(folder, script("train-a-splat.md"))
    assert "10 views train, 2 test" in output
    assert "2 views: PSNR inf dB, " in output
    assert "SSIM 1.0000, FLIP 0.0000" in output
    images = folder / "work/nerfstudio/images"
    assert len(list(images.iterdir())) == 12
    model = read_model(folder / "work/colmap/sparse/0", ".bin")
    assert len(model.images) == 12
    assert len(model.points.positions) > 100


@pytest.mark.slow
def test_a_cluster_is_planned_on_the_login_node(folder):
    output = run(folder, script("on-a-cluster.md"))
    # The smoke scene, and all cameras of the garden.
    assert re.findall(r"^views +\d+ +(\d+) ", output, re.M) == ["14", "12"]
    assert "smoke/LFCuboid_1x1x1" in output
