"""In which order the jobs of a build start, and how many cores they take."""

import json
import re

import pytest
import tiny
from checkouts import snakemake

PANORAMA = "Rendering the panorama of tiny/LFPlane"
VIEWS = "Rendering views"
SECOND_RIG = """
  LFRing:
    type: ring
    count: 2
    size: 0.5
    center: [0, 0, 1.2]
    camera: {lens: equidistant, fov: 180, resolution: [16, 16]}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A checkout with a scene of two rigs, whose pages show panoramas."""
    folder = tiny.checked_out(tmp_path_factory.mktemp("order") / "plenoforge")
    tiny.edit(folder, "report: {panorama: false}", "report: {panorama: true}")
    tiny.edit(folder, "\nreprojections:", f"{SECOND_RIG}reprojections:")
    return folder


@pytest.mark.slow
def test_the_panorama_is_rendered_before_the_views_so_that_no_core_waits_for_it(folder):
    config = ("--config", "scenes=[tiny]", "rigs=LFPlane", "preset=full", "views_per_shard=2")
    target = f"results/{tiny.NAME}/report/overview.png"
    result = snakemake(folder, "--cores", "2", *config, "--", target)
    assert result.returncode == 0, result.stdout + result.stderr
    (log,) = (folder / ".snakemake/log").glob("*.log")
    rendered = re.findall(rf"^Job \d+: ({PANORAMA}|{VIEWS})", log.read_text(), re.M)
    assert rendered == [PANORAMA, *[VIEWS] * len(tiny.SHARDS)]


@pytest.mark.parametrize(("rigs", "cores", "cpus"), [("LFRing", 8, [8]), ("all", 8, [4, 4])])
def test_panoramas_share_the_cores(folder, rigs, cores, cpus):
    config = ("--config", "scenes=[tiny]", f"rigs={rigs}", "preset=full")
    options = ("--dry-run", "--forceall", "--cores", str(cores), "--logger", "jobs")
    plan = snakemake(folder, *options, *config).stderr
    jobs = [json.loads(line) for line in plan.splitlines() if line.startswith("{")]
    assert [job["cpus"] for job in jobs if job["rule"] == "render_panorama"] == cpus
