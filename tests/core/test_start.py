"""Programs import only what a command uses. Above all, their --help imports nothing heavy."""

import re
import subprocess
import sys

import numpy as np
import pytest
from conftest import SCRIPTS

from lightfield.core.files import write_json
from lightfield.geometry import lenses
from lightfield.imaging import images

# Each takes a noticeable part of a second to import.
HEAVY = {
    "scipy",
    "skimage",
    "numba",
    "llvmlite",
    "matplotlib",
    "trimesh",
    "OpenEXR",
    "OpenImageIO",
    "bpy",
    "PIL",
    "cv2",
    "jinja2",
    "upath",
    "pycolmap",
}
# Flags follow from models of settings. The models of lenses and rigs are classes on numpy.
OF_LENSES_AND_SCENES = {"numpy", "yaml"}
# The settings of these programs have no lenses, rigs or scenes.
LIGHT = [
    "build_members",
    "calibrate",
    "check_device",
    "corpus",
    "costs",
    "count_members",
    "error_vs_time",
    "evaluate",
    "evaluate_surface",
    "flow",
    "gpu_check",
    "import_views",
    "list_scenes",
    "plan",
    "probe",
    "prune",
    "render_shard",
    "splits",
    "status",
    "synthesis_quality",
    "synthesize",
    "validate",
    "validate_sequence",
    "verify",
]

PROGRAMS = sorted(path.stem for path in SCRIPTS.glob("*.py"))


def imports_of(program, *words):
    """Run a program, and return the names of all modules that it imports."""
    command = [sys.executable, "-X", "importtime", SCRIPTS / f"{program}.py", *words]
    result = subprocess.run([*map(str, command)], capture_output=True, text=True, check=True)
    return set(re.findall(r"^import time:.*\| +(\S+)$", result.stderr, re.MULTILINE))


@pytest.mark.parametrize("program", PROGRAMS)
def test_help_imports_nothing_heavy(program):
    imported_modules = imports_of(program, "--help")
    assert "argparse" in imported_modules
    assert not HEAVY & imported_modules
    if program in LIGHT:
        assert not OF_LENSES_AND_SCENES & imported_modules


def test_an_exr_is_reprojected_without_what_it_does_not_use(tmp_path):
    lens = lenses.from_camera({"lens": "equidistant", "fov": 180, "resolution": [8, 8]})
    write_json(tmp_path / "lightfield.json", lens.to_lightfield())
    images.write_exr(tmp_path / "a.exr", dict.fromkeys("RGB", np.ones((8, 8), np.float16)))
    arguments = ["--single", tmp_path / "a.exr", "--input-cfg", tmp_path / "lightfield.json"]
    arguments += ["--exr", "--rectilinear", "18,36", "-o", tmp_path / "made"]
    # Kernels may be compiled in the first run, but not in the second.
    for _ in range(2):
        imported_modules = imports_of("reproject", *arguments)
    assert (tmp_path / "made/a.exr").is_file()
    assert "numba.core" in imported_modules
    compiling = {"numba.cpython.listobj", "scipy.linalg"}
    assert not imported_modules & {"matplotlib", "yaml.loader", "OpenImageIO", "bpy", *compiling}
