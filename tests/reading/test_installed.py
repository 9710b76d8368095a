"""The part of the library that `pip install` installs reads datasets without the rest."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from checkouts import ROOT
from conftest import SCRIPTS
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from sphere import LENSES, write_views

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
# What an installed reader must not import, whatever the test's own Python has.
REFUSED = ("bpy", "numba", "scipy", "snakemake", "skimage", "yaml", "matplotlib", "PIL", "cv2")
READ = """
import sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in sys.argv[2:]:
            raise ImportError(name + " is not installed")

sys.meta_path.insert(0, Refuse())
import lightfield
assert not [name for name in sys.modules if name.partition(".")[0] in ("numpy", "pydantic")]
from lightfield import open_corpus, open_dataset

data = open_dataset(sys.argv[1])
view = data.views[1]
origins, directions = view.rays()
pixels, visible = view.project(origins[8, 8] + view.distance[8, 8] * directions[8:9, 8])
assert abs(pixels - 8.5).max() < 1e-3 and visible.all()
assert view.rgb.shape == (16, 16, 3)
assert "OpenImageIO" not in sys.modules
assert data.reprojections["perspective"].views[0].rgb.shape == (48, 64, 3)
print(lightfield.__file__)
files = {name for name, module in sys.modules.items() if getattr(module, "__file__", None)}
print(*{name.partition(".")[0] for name in files})
"""
CAMERA = {"lens": "equidistant", "fov": 180, "resolution": [16, 16]}
RIG = {"type": "plane", "cameras": [2, 1], "size": 0.4}


@pytest.fixture
def installed(tmp_path):
    """The packages of the wheel in a folder, as in site-packages."""
    settings = PROJECT["tool"]["setuptools"]
    assert settings["package-dir"] == {"": "scripts"}
    folder = tmp_path / "site-packages"
    for package in settings["packages"]:
        place = Path(*package.split("."))
        for file in (SCRIPTS / place).glob("*.py"):
            target = folder / place / file.name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, target)
    return folder


@pytest.mark.slow
def test_the_installed_packages_read_a_dataset_with_their_dependencies_alone(installed, tmp_path):
    write_views(tmp_path / "dataset", CAMERA, RIG)
    write_views(tmp_path / "dataset/perspective", LENSES["perspective"], RIG, suffix=".png")
    result = subprocess.run(
        [sys.executable, "-c", READ, tmp_path / "dataset", *REFUSED],
        env={"PYTHONPATH": str(installed), "PATH": ""},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    file, modules = result.stdout.splitlines()
    assert Path(file).is_relative_to(installed)
    # All that it imports is its own, Python's own, or belongs to a dependency of pyproject.toml.
    # Some systems' Python has a module sitecustomize, which it imports at its start.
    names = {name for name in modules.split() if not name.startswith("_")} - {"sitecustomize"}
    dependencies = {"numpy", "OpenEXR", "Imath", "OpenImageIO", "pydantic", "typing_extensions"}
    of_pydantic = {"pydantic_core", "annotated_types", "typing_inspection"}
    others = names - set(sys.stdlib_module_names) - {"lightfield"} - dependencies - of_pydantic
    assert not others
    assert DEPENDENCIES.keys() | {"imath"} == {canonicalize_name(name) for name in dependencies}


def requirements(lines):
    """Return the requirements in lines by their packages' names, without comments and options."""
    texts = (line.partition("#")[0].strip() for line in lines)
    each = [Requirement(text) for text in texts if text and not text.startswith("-")]
    return {canonicalize_name(requirement.name): requirement for requirement in each}


DEPENDENCIES = requirements(PROJECT["project"]["dependencies"])
LOCKS = [ROOT / f"envs/requirements-{version}.txt" for version in ("3.11", "3.13")]


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.stem)
def test_the_installed_reader_takes_the_versions_of_the_environment(lock):
    lines = re.findall(r"^\S+==[^\s\\;]+", lock.read_text(), re.M)
    locked = requirements(lines)
    for name, requirement in DEPENDENCIES.items():
        (version,) = (each.version for each in locked[name].specifier)
        assert version in requirement.specifier, name


@pytest.mark.parametrize("name", ["openimageio", "openexr", "pydantic"])
def test_the_installed_reader_takes_no_version_that_the_environment_would_not(name):
    """Another OpenImageIO may read damaged files that this one refuses."""
    lines = (ROOT / "envs/requirements.in").read_text().splitlines()
    assert DEPENDENCIES[name].specifier == requirements(lines)[name].specifier


@pytest.mark.slow
def test_a_program_beside_the_installed_library_is_not_started_anew(installed):
    """Jupyter's kernel is such a program. Of ours, each starts anew in a clean environment."""
    program = installed / "kernel_launcher.py"
    program.write_text(
        "import os, lightfield\nprint(os.environ['PYTHONPATH'], os.getpid(), sep='\\n')\n"
    )
    process = subprocess.Popen(
        [sys.executable, program],
        env={"PYTHONPATH": str(installed)},
        stdout=subprocess.PIPE,
        text=True,
    )
    output, _ = process.communicate()
    assert output.splitlines() == [str(installed), str(process.pid)]
