"""Forks run the code of the checkout that they are started for, though its import is shared."""

import subprocess

import forks
import pytest
from checkouts import checkout

PROGRAM = """
import lightfield.core.errors
from lightfield.dataset import names
print(names.ROOT, lightfield.core.errors.__file__, hasattr(lightfield.core.errors, "added"))
"""


def said_by(folder):
    """Return what the checkout's program prints."""
    command = [forks.python(), "scripts/say.py"]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout.split()


@pytest.mark.slow
def test_a_fork_runs_the_code_of_its_checkout_and_notices_changes(tmp_path):
    folder = checkout(tmp_path / "plenoforge")
    (folder / "scripts/say.py").write_text(PROGRAM)
    module = folder / "scripts/lightfield/core/errors.py"
    assert said_by(folder) == [str(folder), str(module), "False"]
    with module.open("a") as file:
        file.write("added = True\n")
    assert said_by(folder) == [str(folder), str(module), "True"]
    # A file may also appear, and another one vanish.
    package = module.with_suffix("")
    package.mkdir()
    module.rename(package / "__init__.py")
    assert said_by(folder) == [str(folder), str(package / "__init__.py"), "True"]
