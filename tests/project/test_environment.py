"""Which Python `make` takes (the first that runs, else uv downloads one), and what it installs."""

import os
import re
import runpy
import shutil
import subprocess
import sys

import pytest
from checkouts import ROOT


class Machine:
    """A machine without Python. Tests add programs that answer with a text."""

    def __init__(self, home):
        self.home, self.programs = home, home / "programs"
        self.programs.mkdir()
        for name in ("bash", "dirname"):
            (self.programs / name).symlink_to(shutil.which(name))
        # Not root, because root would install missing packages.
        self.add("id", "echo 1000")

    def add(self, path, script):
        program = self.programs / path
        program.parent.mkdir(parents=True, exist_ok=True)
        program.write_text(f"#!{shutil.which('bash')}\n{script}\n")
        program.chmod(0o755)
        return str(program)

    def find(self, *arguments):
        return subprocess.run(
            [self.programs / "bash", ROOT / "envs/find_python.sh", *arguments],
            env={"PATH": f"{self.home}/shims:{self.programs}", "HOME": str(self.home)},
            capture_output=True,
            text=True,
            check=False,
        )


@pytest.fixture
def machine(tmp_path):
    return Machine(tmp_path)


def test_a_newer_python_comes_first(machine):
    machine.add("python3", "echo 3.11")
    newer = machine.add("python3.13", "echo 3.13")
    assert machine.find().stdout == f"{newer}\n"


def test_a_shim_that_does_not_run_does_not_count(machine):
    machine.add("../shims/python3.13", "echo command not found >&2; exit 127")
    older = machine.add("python3.11", "echo 3.11")
    assert machine.find().stdout == f"{older}\n"
    behind = machine.add("python3.13", "echo 3.13")
    assert machine.find().stdout == f"{behind}\n"


def test_a_python_that_pyenv_keeps_is_found(machine):
    machine.add("../shims/python3.13", "exit 127")
    kept = machine.home / ".pyenv/versions/3.13.0/bin/python3"
    machine.add(kept, "echo 3.13")
    assert machine.find().stdout == f"{kept}\n"


def test_without_any_uv_downloads_one(machine):
    machine.add("python3", "echo 3.12")
    machine.add("uv", '[[ $2 != find ]] || echo "$UV_PYTHON_INSTALL_DIR/bin/python3.13"')
    result = machine.find()
    assert result.stdout == f"{ROOT}/.python/bin/python3.13\n"
    assert "downloading" in result.stderr


def test_if_no_download_works_one_line_says_what_to_install(machine):
    machine.add("python3", "echo 3.12")
    machine.add("uv", "[[ $1 == --version ]]")
    result = machine.find()
    assert (result.returncode, result.stdout) == (1, "")
    *_, last = result.stderr.splitlines()
    assert last.startswith("error: no Python 3.13 or 3.11 runs here")
    assert "sudo apt-get install python3 python3-venv" in last


def test_a_named_python_must_run_and_be_of_a_supported_version(machine):
    older = machine.add("python3.11", "echo 3.11")
    machine.add("python3.13", "echo 3.13")
    assert machine.find(older).stdout == f"{older}\n"
    for script in ("echo 3.12", "exit 127"):
        wrong = machine.add("python3.14", script)
        result = machine.find(wrong)
        assert result.returncode == 1
        assert result.stderr.startswith(f"error: PYTHON is {wrong}, which is not Python 3.13 or")


def test_a_requested_version_is_found_beside_another(machine):
    machine.add("python3.13", "echo 3.13")
    older = machine.add("python3.11", "echo 3.11")
    assert machine.find("3.11").stdout == f"{older}\n"


def test_a_missing_version_is_downloaded(machine):
    machine.add("python3.13", "echo 3.13")
    machine.add("uv", '[[ $2 != find ]] || echo "$UV_PYTHON_INSTALL_DIR/bin/python$4"')
    result = machine.find("3.11")
    assert result.stdout == f"{ROOT}/.python/bin/python3.11\n"
    assert "downloading 3.11" in result.stderr


def test_a_version_that_cannot_be_downloaded_is_an_error_of_one_line(machine):
    machine.add("python3.13", "echo 3.13")
    machine.add("uv", "[[ $1 == --version ]]")
    result = machine.find("3.11")
    assert (result.returncode, result.stdout) == (1, "")
    *_, last = result.stderr.splitlines()
    assert last.startswith("error: no Python 3.11 runs here, and none could be downloaded")


@pytest.fixture
def check_system(machine, monkeypatch):
    """Check a system without the tests' packages. Its apt-get writes down its arguments."""
    installs = f'> "${{0%/*}}/$name"; {shutil.which("chmod")} +x "${{0%/*}}/$name"'
    machine.add("apt-get", f'echo "$@" >> "$0.log"; for name in "${{@:4}}"; do {installs}; done')
    monkeypatch.setenv("PATH", str(machine.programs))
    monkeypatch.setattr(sys, "argv", ["check_system.py", "--tests"])

    def check(user):
        monkeypatch.setattr(os, "geteuid", lambda: user)
        runpy.run_path(str(ROOT / "envs/check_system.py"), run_name="__main__")

    check.log = machine.programs / "apt-get.log"
    return check


def test_root_installs_what_is_missing(check_system):
    check_system(0)
    assert check_system.log.read_text().splitlines() == [
        "--quiet=2 update",
        "--quiet=2 install --yes chromium ffmpeg rsync",
    ]
    # A second check installs nothing.
    check_system(0)
    assert len(check_system.log.read_text().splitlines()) == 2


def test_other_users_are_told_the_command_that_installs_it(check_system):
    with pytest.raises(
        SystemExit, match=r"^error: .*: sudo apt-get install chromium ffmpeg rsync$"
    ):
        check_system(1000)
    assert not check_system.log.exists()


ENVIRONMENTS = (".venv", ".venv-other", ".venv-consumers", ".venv-s3-server", ".venv-docs")


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_make_does_not_replace_the_environment_of_another_checkout(name, tmp_path):
    shutil.copy(ROOT / "Makefile", tmp_path)
    shutil.copytree(ROOT / "envs", tmp_path / "envs")
    if name != ".venv":
        # The others are made by this one's Python.
        (tmp_path / ".venv").mkdir()
        (tmp_path / ".venv/packages").touch()
    other = tmp_path / "other"
    other.mkdir()
    (other / "installed").touch()
    (tmp_path / name).symlink_to(other)
    result = subprocess.run(
        ["make", f"{name}/complete"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert result.returncode != 0
    assert result.stderr.startswith(f"error: {name} is a link to {other}, which make would replace")
    assert [path.name for path in other.iterdir()] == ["installed"]


PLUGIN = "snakemake-executor-plugin-slurm"
VERSIONS = ("3.11", "3.13")


def locked(name, version):
    """Return the lines of a lock with a package and its version."""
    lock = (ROOT / f"envs/{name}-{version}.txt").read_text()
    return dict(re.findall(r"^([a-z0-9.-]+)==([^\s\\;]+)", lock, re.M))


@pytest.mark.parametrize("version", VERSIONS)
def test_a_build_without_slurm_installs_neither_the_executor_nor_pandas(version):
    """Snakemake imports all executors at each start, and this one imports pandas."""
    assert not {PLUGIN, "pandas"} & locked("requirements", version).keys()
    assert not {PLUGIN, "pandas"} & locked("requirements-storage", version).keys()


@pytest.mark.parametrize("version", VERSIONS)
def test_slurm_and_a_storage_add_to_a_build_and_change_no_version_of_it(version):
    build, tests = locked("requirements", version), locked("requirements-test", version)
    slurm, storage = (locked(f"requirements-{name}", version) for name in ("slurm", "storage"))
    assert PLUGIN in slurm and PLUGIN in tests
    assert build.items() <= slurm.items() <= tests.items()
    assert build.items() <= storage.items()
    assert all(slurm[name] == storage[name] for name in slurm.keys() & storage.keys())
