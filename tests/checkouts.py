"""Makes copies of the repository, in which tests run Snakemake on scene YAMLs of their own."""

import filecmp
import json
import os
import re
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import forks

ROOT = Path(__file__).resolve().parents[1]
PARTS = ("Snakefile", "config.yaml", "configs", "envs", "profiles", "captions", "rules", "scripts")

# A scene of views that exist already, with all that its author must say to publish them.
PUBLISHED_VIEWS = """
description: Views of others
publish:
  creators: [{name: Ada Lovelace}]
  licence: CC-BY-4.0
  url: https://example.org/dataset
  publisher: Zenodo
  date: 2026-11-30
  limitations: Few pixels.
  biases: One room.
  personal_information: None.
  use_cases: Tests.
  social_impact: None.
scene: {dataset: published}
"""

# A sequence, whose frames share an export: all keys of its scene YAML but `scene`.
SEQUENCE = """
render: {samples: 4}
rigs:
  LFMoving:
    type: plane
    cameras: [2, 1]
    size: 1
    frames: {first: 1, last: 2}
    camera: {lens: rectilinear, fov: 60, resolution: [16, 16]}
exports:
  dnerf: {sources: [views], points: 9}
"""


def checkout(folder, **scenes):
    """Copy what Snakemake needs to ``folder``. ``scenes`` are YAML texts for configs/scenes/.

    Also takes compiled files, but not those that another process is writing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    unfinished = shutil.ignore_patterns("*.pyc.*", "*.tmp.*")
    for name in PARTS:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=unfinished, copy_function=copy_or_link)
        else:
            shutil.copy(source, folder / name)
    for name, text in scenes.items():
        (folder / "configs" / "scenes" / f"{name}.yaml").write_text(text)
    return folder


def copy_or_link(source, target):
    """Copy a file. Link a compiled one: Python and Numba only replace such files."""
    if "__pycache__" in source:
        with suppress(OSError):
            # Fails on another disk.
            os.link(source, target)
            return
    shutil.copy2(source, target)


def with_consumers(folder, python=sys.executable):
    """Put a stand-in for the consumers' environment into a checkout.

    ``python`` runs its programs.
    """
    environment = folder / ".venv-consumers"
    (environment / "bin").mkdir(parents=True)
    (environment / "bin/python").symlink_to(python)
    (environment / "complete").touch()


def start_snakemake(folder, *arguments, **options):
    """Start Snakemake in a checkout, in a session of its own. Return the process."""
    return subprocess.Popen(
        [Path(sys.executable).with_name("snakemake"), "--cores", "1", *arguments],
        cwd=folder,
        start_new_session=True,
        **{"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL} | options,
    )


def snakemake(folder, *arguments, env=None):
    """Run Snakemake in a checkout. Return its CompletedProcess. ``env`` adds to the environment."""
    return forks.run_snakemake(["--cores", "1", *arguments], folder, env)


def planned(folder, *arguments):
    """Return how many jobs of each rule a dry run plans."""
    result = snakemake(folder, *arguments, "--dry-run", "--printshellcmds")
    assert result.returncode == 0, result.stdout + result.stderr
    table = (result.stdout + result.stderr).split("Job stats:")[1].split("total")[0]
    return {name: int(count) for name, count in re.findall(r"^(\w+)\s+(\d+)$", table, re.M)}


def jobs_on(stderr):
    """Return the jobs that Snakemake printed with ``--logger jobs``."""
    return [json.loads(line) for line in stderr.splitlines() if line.startswith("{")]


def published(folder, dataset=""):
    """Return the files of all datasets, or of one, by relative path. Leaves out reports."""
    results = folder / "results"
    return {
        path.relative_to(results): path
        for path in sorted((results / dataset).rglob("*"))
        if path.is_file()
        and "report" not in path.relative_to(results).parts
        # Leave out the index of all reports.
        and path.parent != results
    }


def assert_same_bytes(folder, other_folder, dataset=""):
    first, second = published(folder, dataset), published(other_folder, dataset)
    assert list(first) == list(second)
    different = [n for n in first if not filecmp.cmp(first[n], second[n], shallow=False)]
    assert not different
