"""Forks use the modules of the checkout in which they run."""

import shutil
import subprocess
from pathlib import Path

import forks
import pytest

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[1]
# Says where the project is, whether its settings have been built, and a constant.
PROGRAM = """
from lightfield.core import yaml_files
from lightfield.dataset import configuration, names

print(names.ROOT, configuration.ROOT, names.__file__, yaml_files.LARGEST_YAML)
print(configuration.Preset.__pydantic_complete__)
"""


@pytest.fixture
def folder(tmp_path):
    """A copy of the programs, with one that describes its modules."""
    shutil.copytree(ROOT / "scripts", tmp_path / "scripts")
    (tmp_path / "scripts/describe.py").write_text(PROGRAM)
    return tmp_path


def described(folder):
    command = [forks.python(), folder / "scripts/describe.py"]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    return result.stdout.split()


def places(folder):
    return [str(folder), str(folder), str(folder / "scripts/lightfield/dataset/names.py")]


def test_equal_files_are_not_imported_again_and_lead_to_the_checkout(folder):
    assert described(folder) == [*places(folder), str(2**16), "True"]


def test_a_changed_file_is_imported_by_the_next_fork(folder):
    path = folder / "scripts/lightfield/core/yaml_files.py"
    path.write_text(path.read_text().replace("2**16", "2**15"))
    # A module whose settings nobody has used is not built.
    assert described(folder) == [*places(folder), str(2**15), "False"]


def test_a_file_more_is_noticed(folder):
    (folder / "scripts/lightfield/dataset/more.py").touch()
    assert described(folder) == [*places(folder), str(2**16), "False"]


def test_a_builder_more_is_noticed(folder):
    (folder / "scripts/scenes/more").mkdir()
    assert described(folder) == [*places(folder), str(2**16), "False"]
