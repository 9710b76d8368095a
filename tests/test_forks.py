"""Forks run their checkout's code and rules, though these are read only once for all forks."""

from checkouts import checkout, snakemake

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


def test_a_fork_takes_the_rules_of_its_checkout_and_notices_changes(tmp_path):
    folder = checkout(tmp_path / "plenoforge")
    snakefile = folder / "Snakefile"
    lines = snakefile.read_text().splitlines()
    # An unchanged file of rules calls a changed function.
    with (folder / "scripts/lightfield/core/disk_space.py").open("a") as file:
        file.write("def obstacle(path): raise TypeError('mistaken')\n")
    (line,) = (n for n, text in enumerate(lines, 1) if "obstacle(Path(" in text)
    error = f'TypeError in file "{snakefile}", line {line}:\nmistaken'
    assert error in snakemake(folder, "--dry-run").stdout
    snakefile.write_text("\n".join(["assert GIVEN", *lines]))
    error = f'NameError in file "{snakefile}", line 1:'
    assert error in snakemake(folder, "--dry-run").stdout
