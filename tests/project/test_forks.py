"""Forks run their checkout's code and rules, though most modules are imported only once for all."""

from pathlib import Path

from checkouts import checkout, snakemake

PROGRAM = """
import lightfield.core.errors
from lightfield.core import names
errors = lightfield.core.errors
for said in (names.ROOT, errors.__file__, hasattr(errors, "added")):
    print(said)
"""


def test_a_fork_runs_the_code_of_its_checkout_and_notices_changes(tmp_path, run_program):
    folder = checkout(tmp_path / "plenoforge")
    program = folder / "scripts/say.py"
    program.write_text(PROGRAM)
    module = folder / "scripts/lightfield/core/errors.py"
    assert run_program(program).stdout.splitlines() == [str(folder), str(module), "False"]
    with module.open("a") as file:
        file.write("added = True\n")
    assert run_program(program).stdout.splitlines() == [str(folder), str(module), "True"]
    # A file may also appear, and another one vanish.
    package = module.with_suffix("")
    package.mkdir()
    module.rename(package / "__init__.py")
    assert run_program(program).stdout.splitlines() == [
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
        file.write("def check_folder(folder): raise TypeError('mistaken')\n")
    (line,) = (n for n, text in enumerate(lines, 1) if "= RunConfig(" in text)
    error = f'TypeError in file "{snakefile}", line {line}:\nmistaken'
    assert error in snakemake(folder, "--dry-run").stderr
    snakefile.write_text("\n".join(["assert CONFIG", *lines]))
    error = f'NameError in file "{snakefile}", line 1:'
    assert error in snakemake(folder, "--dry-run").stderr


WITH_BLENDER = """
import os, bpy
for said in (bpy.app.tempdir, len(os.listdir("/proc/self/task"))):
    print(said)
"""


def test_a_fork_has_blender_without_threads_and_with_a_folder_of_its_own(tmp_path, run_program):
    program = tmp_path / "program.py"
    program.write_text(WITH_BLENDER)
    folders, threads = zip(
        *(run_program(program).stdout.splitlines() for _ in range(2)), strict=True
    )
    assert threads == ("1", "1")
    assert folders[0] != folders[1]
    # A fork removes it at its end.
    assert not any(Path(folder).exists() for folder in folders)
