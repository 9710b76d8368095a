"""Fixtures and helpers that several tests share. They run the programs as a user runs them."""

import clean_environment  # noqa: F401

# isort: split

import compileall
import fcntl
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import forks
import pytest
import tiny
from checkouts import checkout, copy_or_link, snakemake
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = ROOT / "scripts"
# Programs that run in Blender, and write what tests read.
BLENDER = ROOT / "tests" / "blender"

# For the programs that tests start, as in the jobs of the workflow.
os.environ |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


# Fixtures that start programs, a browser, Blender or Snakemake, or that compute for long.
SLOW = {
    "run_program",
    "smoke",
    "built_tiny",
    "blender",
    "browser",
    "cycles",
    "planned",
    "renders",
    "simulated",
}


def pytest_sessionstart(session):
    """Do once what all workers need. Each checkout takes the compiled files."""
    if not hasattr(session.config, "workerinput"):
        if session.config.getoption("numprocesses", None):
            forks.share_server()
        # The server imports libraries meanwhile.
        compileall.compile_dir(SCRIPTS, quiet=2)


# Each of these files takes more than half a minute. The first four begin at once. Of these, only
# provenance compiles kernels, for the smoke dataset. The later files use the compiled kernels.
LONG = (
    "every_rule",
    "provenance",
    "failing_jobs",
    "frames",
    "slurm",
    "storage",
    "soak",
    "workflow",
    "damage",
)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark tests with these fixtures as slow, and sort the files. Other slow tests mark themselves.

    The longest files come first. Then come files with few tests, because these take long. Files
    without slow tests come last. So all workers end at about the same time.
    """
    tests = {item.path: [] for item in items}
    for item in items:
        if SLOW & set(item.fixturenames):
            item.add_marker("slow")
        tests[item.path].append(item.get_closest_marker("slow") is not None)
    places = {f"test_{name}.py": place for place, name in enumerate(LONG)}
    order = {
        path: (places.get(path.name, len(places)), not any(slow), len(slow))
        for path, slow in tests.items()
    }
    items.sort(key=lambda item: order[item.path])


@pytest.fixture(scope="session")
def run_program():
    """Run a program of scripts/, or at a path. Return its CompletedProcess.

    With ``in_fork`` False it imports the libraries itself.
    """

    def run(name, *arguments, check=True, in_fork=True, **options):
        program = name if isinstance(name, Path) else SCRIPTS / name
        python = forks.python() if in_fork else sys.executable
        result = subprocess.run(
            [python, program, *map(str, arguments)],
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


@pytest.fixture(scope="session")
def reproject_dataset(tmp_path_factory, run_program):
    """Reproject a dataset's views into ``folder`` by the content of a settings file.

    Return the program's CompletedProcess.
    """

    def run(dataset, folder, settings, *arguments, **options):
        # Validation finds files that do not belong to the dataset's folder.
        file = tmp_path_factory.mktemp("settings") / f"{folder.name}.json"
        file.write_text(json.dumps(settings))
        return run_program(
            "reproject.py",
            "--settings",
            file,
            "--input-cfg",
            dataset / "lightfield.json",
            "--input-dir",
            dataset / "exr",
            "--output-dir",
            folder,
            "--output-cfg",
            folder / "lightfield.json",
            *arguments,
            **options,
        )

    return run


@pytest.fixture
def in_forks(monkeypatch):
    """Run Snakemake and the programs that the project starts by itself in forks, too."""
    python = forks.python()
    monkeypatch.setattr(sys, "executable", str(python))
    monkeypatch.setenv("PATH", f"{python.parent}:{os.environ['PATH']}")


def mount_disk(folder, options):
    """Mount a small file system at a folder. Return False if that is not allowed."""
    command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", folder]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


@contextmanager
def largest_file(size):
    """Limit all files to ``size`` bytes, with RLIMIT_FSIZE."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture
def small_disk(tmp_path):
    """A small file system of its own if one can be mounted, else a plain folder."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = mount_disk(folder, "size=1m")
    yield folder, mounted
    if mounted:
        subprocess.run(["umount", folder], check=True)


@pytest.fixture
def nobody(monkeypatch):
    """A folder for a test that runs without the rights of root.

    The test has them again before monkeypatch returns to the checkout: it may lie in root's folder.
    """
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
    """Return a copy of a folder that ``build(folder)`` builds once for all workers.

    The first worker builds it, and the others wait. If a build fails, the next worker tries.
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
    copy = tmp_path_factory.mktemp(name) / "plenoforge"
    # copytree keeps the files' times, so the copy stays up to date.
    shutil.copytree(finished.resolve(), copy, symlinks=True, copy_function=copy_or_link)
    return copy


def build_smoke(folder):
    """Build the smoke dataset in a checkout."""
    checkout(folder)
    result = snakemake(folder, "--cores", "2", "smoke")
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.fixture(scope="module")
def smoke(tmp_path_factory, request):
    """A checkout in which the smoke dataset has been built. Each file's tests have their own."""
    return built_once(build_smoke, "smoke", request.config, tmp_path_factory)


def build_tiny(folder):
    """Build the scene of tiny.py in a checkout."""
    tiny.build(tiny.checked_out(folder))


@pytest.fixture(scope="module")
def built_tiny(tmp_path_factory, request):
    """A checkout in which the scene of tiny.py has been built. Do not change it."""
    return built_once(build_tiny, "tiny", request.config, tmp_path_factory)


@pytest.fixture
def tiny_build(built_tiny, tmp_path):
    """A copy of this checkout, which a test may change."""
    return shutil.copytree(built_tiny, tmp_path / "plenoforge", symlinks=True)


@pytest.fixture(scope="session")
def browser():
    path = shutil.which("chromium")
    if not path:
        pytest.fail("these tests need Chromium: sudo apt-get install chromium")
    arguments = ["--no-sandbox", "--disable-background-networking", "--use-angle=swiftshader"]
    arguments += ["--enable-unsafe-swiftshader", "--js-flags=--expose-gc"]
    # Otherwise the browser rounds the memory that a page uses.
    arguments += ["--enable-precise-memory-info"]
    # Without a graphics card, the processor puts a page together faster than SwiftShader does.
    arguments += ["--disable-gpu-compositing"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=arguments)
        yield browser
        browser.close()


# The browser says this each time that it puts a picture of the walk into the page.
READ_BACK = "GPU stall due to ReadPixels"
# Takes WebGL 2 away from a page.
WITHOUT_WEBGL_2 = """
HTMLCanvasElement.prototype.getContext = ((get) => function (kind, ...more) {
    return kind === "webgl2" ? null : get.call(this, kind, ...more);
})(HTMLCanvasElement.prototype.getContext);
"""


# Draws an eighth of the walk's pixels, across and down.
SMALL_WALK = 0.125


@pytest.fixture(scope="session")
def tabs():
    """The tabs that no test uses, by their options. A page loads faster in a tab that is open."""
    return {}


def error_listeners(errors):
    """Return what listens to a page, by event, and adds its errors to a list."""

    def note(message):
        if READ_BACK not in message.text:
            errors.append(message.text)

    return {"console": note, "pageerror": lambda error: errors.append(str(error))}


@pytest.fixture
def show(browser, tabs):
    """Open pages. At the end of the test no page may have had an error.

    The walk has ``walk_scale`` pixels for each pixel of the page, across and down. With 0, the page
    has no walk. Software draws it, so a page opens in half the time without it or with a small one.
    """
    log = SimpleNamespace(errors=[], requests=[])
    shown = []
    listeners = error_listeners(log.errors)
    listeners["request"] = lambda request: log.requests.append(request.url)

    def show(path, width=600, walk_scale=0.0, **options):
        kind = walk_scale, *options.items()
        if kind not in tabs:
            context = browser.new_context(**options)
            script = f"devicePixelRatio = {walk_scale}" if walk_scale else WITHOUT_WEBGL_2
            context.add_init_script(script)
            tabs[kind] = context.new_page()
        tab = tabs.pop(kind)
        shown.append((kind, tab))
        tab.set_viewport_size({"width": width, "height": 900})
        for event, listener in listeners.items():
            tab.on(event, listener)
        tab.goto(path.as_uri())
        return tab

    yield show
    for kind, tab in shown:
        for event, listener in listeners.items():
            tab.remove_listener(event, listener)
        # The next page is not under the mouse.
        tab.mouse.move(0, 0)
        tab.goto("about:blank")
        tabs[kind] = tab
    assert not log.errors
    assert log.requests
    assert all(url.startswith(("file:", "data:")) for url in log.requests)
