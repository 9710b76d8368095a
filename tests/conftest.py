"""What several tests share: the programs in scripts/, run as a user runs them."""

import compileall
import fcntl
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import pytest
from checkouts import checkout, snakemake
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = ROOT / "scripts"


# Fixtures that start programs, a browser, Blender or Snakemake, or compute for long.
SLOW = {"run_program", "smoke", "blender", "browser", "cycles", "planned", "renders", "simulated"}


def pytest_sessionstart(session):
    """Compile the programs once, before there are workers: each checkout takes that with it."""
    if not hasattr(session.config, "workerinput"):
        compileall.compile_dir(SCRIPTS, quiet=2)


# Each of these takes more than a minute.
LONG = ("slurm", "every_rule", "workflow", "damage", "failures", "storage", "soak", "provenance")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark as slow what uses these fixtures; other tests say it themselves.

    The longest files come first, then those of few tests, which take long, and those without a
    slow one last, so that the workers end together.
    """
    tests = {item.path: [] for item in items}
    for item in items:
        if SLOW & set(item.fixturenames):
            item.add_marker("slow")
        tests[item.path].append(item.get_closest_marker("slow") is not None)
    long = [f"test_{name}.py" for name in LONG]
    order = {
        path: (path.name not in long, not any(slow), len(slow)) for path, slow in tests.items()
    }
    items.sort(key=lambda item: order[item.path])


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


def mount_disk(folder, options):
    """Mount a small file system at a folder; return False where that is not allowed."""
    words = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", folder]
    return subprocess.run(words, capture_output=True, check=False).returncode == 0


@pytest.fixture
def small_disk(tmp_path):
    """A small file system of its own where that may be mounted, else a plain folder."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = mount_disk(folder, "size=1m")
    yield folder, mounted
    if mounted:
        subprocess.run(["umount", folder], check=True)


@pytest.fixture
def nobody():
    """A folder of its own for a test that has not the rights of root."""
    with tempfile.TemporaryDirectory() as name:
        if os.geteuid():
            yield Path(name)
            return
        os.chown(name, 65534, 65534)
        os.seteuid(65534)
        yield Path(name)
        os.seteuid(0)


@pytest.fixture(scope="session")
def room(tmp_path_factory, run_program):
    """The small closed room of scripts/scenes/room/, as a .blend."""
    path = tmp_path_factory.mktemp("room") / "room.blend"
    run_program("build_scene.py", "--builder", "room", "--output", path)
    return path


def built_once(build, name, config, tmp_path_factory):
    """Return a worker's own copy of a folder that ``build(folder)`` makes once for all workers.

    The first worker that asks builds it, and the others wait. Where it fails the next one tries.
    """
    is_worker = hasattr(config, "workerinput")
    shared = tmp_path_factory.getbasetemp()
    shared = shared.parent if is_worker else shared
    finished = shared / f"{name}.finished"
    with (shared / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not finished.exists():
            folder = tmp_path_factory.mktemp(name) / "built"
            build(folder)
            finished.symlink_to(folder)
    own = tmp_path_factory.mktemp(name) / "plenoforge"
    # With its times: what was built stays up to date.
    shutil.copytree(finished.resolve(), own, symlinks=True)
    return own


def build_smoke(folder):
    checkout(folder)
    result = snakemake(folder, "--cores", "2", "smoke")
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.fixture(scope="session")
def smoke(tmp_path_factory, request):
    """A checkout in which the smoke dataset has been built."""
    return built_once(build_smoke, "smoke", request.config, tmp_path_factory)


@pytest.fixture(scope="session")
def browser():
    path = shutil.which("chromium")
    if not path:
        pytest.fail("these tests need Chromium: sudo apt-get install chromium")
    words = ["--no-sandbox", "--disable-background-networking", "--use-angle=swiftshader"]
    words += ["--enable-unsafe-swiftshader", "--js-flags=--expose-gc"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=words)
        yield browser
        browser.close()


@pytest.fixture
def show(browser):
    """Open a page; when the test is over, nothing may have gone wrong on any."""
    seen = SimpleNamespace(errors=[], requests=[])
    contexts = []

    def show(path, width=1280, **options):
        size = {"width": width, "height": 900}
        context = browser.new_context(viewport=size, **options)
        contexts.append(context)
        tab = context.new_page()
        tab.on("console", lambda message: seen.errors.append(message.text))
        tab.on("pageerror", lambda error: seen.errors.append(str(error)))
        tab.on("request", lambda request: seen.requests.append(request.url))
        tab.goto(path.as_uri())
        return tab

    yield show
    for context in contexts:
        context.close()
    assert not seen.errors
    assert seen.requests
    assert all(url.startswith(("file:", "data:")) for url in seen.requests)
