"""A program's --help starts at once: it imports nothing that only the program's work needs."""

import re
import subprocess
import sys

import pytest
from conftest import SCRIPTS

# Each takes a noticeable part of a second to import.
HEAVY = {
    *("numpy", "scipy", "skimage", "numba", "llvmlite", "matplotlib", "pydantic", "yaml"),
    *("OpenEXR", "OpenImageIO", "bpy", "PIL", "cv2", "jinja2", "upath", "pycolmap"),
}
# The flags of these programs follow from the lenses, which are classes on numpy and pydantic.
OF_LENSES = {"numpy", "pydantic"}
NEEDED = {"lens_map": OF_LENSES, "reproject": OF_LENSES}

PROGRAMS = sorted(path.stem for path in SCRIPTS.glob("*.py"))


@pytest.mark.parametrize("program", PROGRAMS)
def test_help_imports_nothing_heavy(program):
    command = [sys.executable, "-X", "importtime", str(SCRIPTS / f"{program}.py"), "--help"]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    assert result.stdout.startswith(f"usage: {program}.py")
    imported_modules = set(re.findall(r"^import time:.*\| +(\S+)$", result.stderr, re.MULTILINE))
    assert "argparse" in imported_modules
    assert HEAVY & imported_modules == NEEDED.get(program, set())
