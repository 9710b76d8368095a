"""What several tests share: the programs in scripts/, run as a user runs them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from checkouts import checkout, snakemake

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = ROOT / "scripts"


# Fixtures that start programs, a browser, Blender or Snakemake.
SLOW = {"run_program", "smoke", "blender", "browser", "cycles", "planned", "renders"}


def pytest_collection_modifyitems(items):
    """Mark as slow what uses these fixtures; other tests say it themselves."""
    for item in items:
        if SLOW & set(item.fixturenames):
            item.add_marker("slow")


@pytest.fixture(scope="session")
def run_program():
    """Run one of the programs in scripts/ (or a path); return its CompletedProcess."""

    def run(name, *arguments, check=True, **options):
        program = name if isinstance(name, Path) else SCRIPTS / name
        result = subprocess.run(
            [sys.executable, program, *map(str, arguments)],
            capture_output=True,
            text=True,
            check=False,
            env=os.environ | {"PYTHONPATH": str(SCRIPTS)},
            **options,
        )
        if check:
            assert result.returncode == 0, result.stderr
        return result

    return run


@pytest.fixture(scope="session")
def room(tmp_path_factory, run_program):
    """The small closed room of scripts/scenes/room/, as a .blend."""
    path = tmp_path_factory.mktemp("room") / "room.blend"
    run_program("build_scene.py", "--builder", "room", "--output", path)
    return path


@pytest.fixture(scope="session")
def smoke(tmp_path_factory):
    """A checkout in which the smoke dataset has been built."""
    folder = checkout(tmp_path_factory.mktemp("smoke") / "plenoforge")
    result = snakemake(folder, "--cores", "2", "smoke")
    assert result.returncode == 0, result.stdout + result.stderr
    return folder
