"""Copies of the repository, in which a test runs Snakemake on scene YAMLs of its own."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PARTS = ("Snakefile", "config.yaml", "configs", "envs", "profiles", "captions", "rules", "scripts")


def checkout(folder, **scenes):
    """Copy what Snakemake needs to ``folder``, with ``scenes``' YAML texts in configs/scenes/."""
    for name in PARTS:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder / name)
    for name, text in scenes.items():
        (folder / "configs" / "scenes" / f"{name}.yaml").write_text(text)
    return folder


def snakemake(folder, *arguments):
    """Run Snakemake in a checkout; return its CompletedProcess."""
    return subprocess.run(
        [Path(sys.executable).with_name("snakemake"), "--cores", "1", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def planned(folder, *arguments):
    """Return how many jobs of each rule a dry run plans."""
    result = snakemake(folder, *arguments, "--dry-run", "--quiet", "rules")
    assert result.returncode == 0, result.stdout + result.stderr
    table = (result.stdout + result.stderr).split("Job stats:")[1].split("total")[0]
    return {name: int(count) for name, count in re.findall(r"^(\w+)\s+(\d+)$", table, re.M)}
