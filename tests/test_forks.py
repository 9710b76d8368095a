"""Forks run the code of the checkout that they are started for, though its import is shared."""

from checkouts import checkout

PROGRAM = """
import lightfield.core.errors
from lightfield.dataset import names
print(names.ROOT, lightfield.core.errors.__file__, hasattr(lightfield.core.errors, "added"))
"""


def test_a_fork_runs_the_code_of_its_checkout_and_notices_changes(tmp_path, run_program):
    folder = checkout(tmp_path / "plenoforge")
    program = folder / "scripts/say.py"
    program.write_text(PROGRAM)
    module = folder / "scripts/lightfield/core/errors.py"
    assert run_program(program).stdout.split() == [str(folder), str(module), "False"]
    with module.open("a") as file:
        file.write("added = True\n")
    assert run_program(program).stdout.split() == [str(folder), str(module), "True"]
    # A file may also appear, and another one vanish.
    package = module.with_suffix("")
    package.mkdir()
    module.rename(package / "__init__.py")
    assert run_program(program).stdout.split() == [
        str(folder),
        str(package / "__init__.py"),
        "True",
    ]
