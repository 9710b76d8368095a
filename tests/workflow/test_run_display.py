"""The terminal during a run: bars that stay in view, warnings, failures, phases."""

import importlib.util
import io
import logging
import re
import time
from pathlib import Path

import pytest
import snakemake

from lightfield.core import progress
from lightfield.core.names import ROOT
from lightfield.workflow import run_display
from lightfield.workflow.run_display import RunDisplay, Task


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Run:
    """Jobs that a test starts and ends, and whose logs it writes, and the terminal's output."""

    def __init__(self, folder, stream):
        self.folder, self.stream, self.now = folder, stream, time.time()
        self.display = RunDisplay(stream=stream)
        self.tasks = {
            "place": self.task("place", "cameras"),
            "a": self.task("a", "views", views=10, seconds=100.0),
            "b": self.task("b", "views", views=10, seconds=100.0),
            "panorama": self.task("panorama", "report", seconds=50.0),
        }
        self.begin()

    def begin(self):
        self.display.planned(is_dry_run=False, is_shown=True)
        self.display.begin({task.log: task for task in self.tasks.values()}, cores=2)

    def task(self, name, phase, **more):
        return Task(f"scene/{name}", phase, self.folder / name, **more)

    def log(self, name, *lines):
        with (self.folder / name).open("a") as file:
            file.writelines(f"{line}\n" for line in lines)

    def start(self, *names):
        for name in names:
            number = [*self.tasks].index(name)
            log = str(self.folder / name)
            self.display.started(number, name, [log], ["output"], self.display.submission())

    def shown(self, seconds=0, running=(), finished=(), failed=()):
        """Return the new lines on the terminal after some seconds."""
        self.now += seconds
        before = len(self.stream.getvalue())
        numbers = {name: number for number, name in enumerate(self.tasks)}
        self.start(*running)
        for name in finished:
            self.display.finished(numbers[name])
        for name in failed:
            self.display.failed(numbers[name], None)
        self.display.update()
        # Without the sequences that move the cursor and set colours.
        text = re.sub(r"\x1b\[[?\d;]*\w", "", self.stream.getvalue()[before:])
        return [line.rstrip() for line in re.split(r"[\r\n]+", text) if line.strip()]


@pytest.fixture(params=[Terminal, io.StringIO])
def run(request, tmp_path, monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "80")
    run = Run(tmp_path, request.param())
    run.began = run.now
    monkeypatch.setattr(run_display.time, "time", lambda: run.now)
    yield run
    run.display.close()


@pytest.mark.parametrize("run", [Terminal], indirect=True)
def test_bars_and_one_line_show_the_progress_of_the_whole_run(run):
    # 250 s of renders on two cores.
    assert run.shown() == ["0 of 4 jobs · 0 of 20 views · 2 min 05 s left"]
    run.shown(running=["place"])
    assert "cameras: 1 job in 2 s, from 0 s to 2 s of the run" in run.shown(
        2, finished=["place"], running=["a", "b"]
    )
    run.log("a", "render scene a: 8 views to do, 2 already done")
    run.log("b", "render scene b: 10 views to do", "render scene b: 2 of 10 views, 20 s each, …")
    bar, line = run.shown(40)
    assert bar.startswith("views ") and bar.endswith(" 4 of 20 views")
    assert line.startswith("1 of 4 jobs · 4 of 20 views, 3 a minute · ")
    assert line.endswith(" left")
    run.log("a", "render scene a: 8 of 8 views, 20 s each, done in 180 s")
    run.log("b", "render scene b: 10 of 10 views, 20 s each, done in 200 s")
    shown = run.shown(160, finished=["a", "b"], running=["panorama"])
    # The run began 2 s before.
    assert "views: 18 views in 3 min 20 s, from 2 s to 3 min 22 s of the run" in shown
    # Views took 20 s instead of 10 s: 50 s become 100 s, of which 1.8 are done in a second.
    assert shown[-1] == "3 of 4 jobs · 20 of 20 views · 56 s left"
    report = "report: 1 job in 50 s, from 3 min 22 s to 4 min 12 s of the run"
    assert report in run.shown(50, finished=["panorama"])


@pytest.mark.parametrize("run", [Terminal], indirect=True)
def test_a_first_view_that_takes_long_is_not_taken_for_no_progress(run):
    run.tasks = {
        "a": run.task("a", "views", views=10, seconds=100.0),
        "place": run.task("place", "cameras", seconds=5.0),
    }
    run.begin()
    run.shown(running=["place"])
    run.shown(5, finished=["place"], running=["a"])
    run.log("a", "render scene a: 10 views to do")
    # By its estimate, a view takes 10 s. The other nine will take as long as this one.
    *_, line = run.shown(300)
    minutes = int(line.split(" · ")[-1].split()[0])
    assert 20 < minutes <= 9 * 300 / 60


@pytest.mark.parametrize("run", [Terminal], indirect=True)
@pytest.mark.parametrize("columns", [20, 40, 200])
def test_no_line_of_the_progress_is_wider_than_the_terminal(run, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    run.log("a", "render scene a: 8 views to do, 2 already done")
    shown = run.shown(running=["a", "place"])
    assert shown and max(map(len, shown)) <= columns


def test_the_end_shows_the_forecast_beside_what_the_run_took(run):
    run.tasks["place"].seconds = 5.0
    run.shown(running=[*run.tasks])
    # An earlier run rendered 2 of 10 views.
    run.log("a", "render scene a: 8 views to do, 2 already done")
    run.shown(100, finished=[*run.tasks])
    forecast = 5 + 80 + 100 + 50
    assert run.display.summary(300) == (
        f"4 jobs in 1 min 40 s, 5 min 00 s of CPU time; the forecast was 3 min {forecast - 180} s"
    )
    assert run.display.summary(None) == "4 jobs in 1 min 40 s"
    run.tasks["place"].seconds = None
    assert run.display.summary(300) == "4 jobs in 1 min 40 s, 5 min 00 s of CPU time"


def test_a_run_that_ends_early_counts_what_it_did(run):
    run.shown(running=["a"])
    run.shown(100, finished=["a"])
    assert run.display.summary(90) == (
        "1 of 4 jobs in 1 min 40 s, 90 s of CPU time; the forecast was 1 min 40 s"
    )


@pytest.mark.parametrize("run", [Terminal], indirect=True)
def test_a_measurement_takes_the_time_that_its_log_tells(run):
    run.tasks = {"error": run.task("error", "measurement")}
    run.begin()
    run.shown(running=["error"])
    run.log("error", "garden: trials: 50 renders to do")
    run.log("error", "garden: trials: 10 of 50 renders, 3 s each, …")
    bar, line = run.shown(30)
    assert bar.startswith("measurement ") and bar.endswith(" 10 of 50")
    assert line == "0 of 1 job · 2 min 00 s left"
    run.log("error", "garden: trials: 50 of 50 renders, 3 s each, done in 150 s")
    phase = "measurement: 1 job in 2 min 30 s, from 0 s to 2 min 30 s of the run"
    assert phase in run.shown(120, finished=["error"])


def test_the_compilation_of_kernels_is_shown_once_and_not_counted(run):
    started = "compiling Cycles' kernels for NVIDIA H200: once, about 7 minutes"
    finished = "compiled Cycles' kernels for NVIDIA H200 in 6 min 38 s"
    run.shown(running=["a", "b"])
    run.log("a", "render a: 10 views to do", started)
    run.log("b", "render b: 10 views to do")
    assert started in run.shown(1)
    left = run.display.seconds_left(run.now)
    # Another job compiles, too, on another GPU.
    run.log("b", started)
    assert started not in run.shown(199)
    assert run.display.seconds_left(run.now) == pytest.approx(left, abs=2)
    run.log("a", finished)
    assert finished in run.shown(1)
    run.log("b", finished)
    run.shown(198)
    assert run.display.seconds_left(run.now) == pytest.approx(left, abs=2)
    for name in ("a", "b"):
        run.log(name, f"render {name}: 5 of 10 views, 10 s each, 50 s left")
    run.shown(50)
    assert "10 of 20 views, 11.8 a minute" in run.display.line(run.now)
    # Half of the views took 51 s. The job without a log is half as long as one of theirs.
    assert run.display.seconds_left(run.now) == pytest.approx(51 * 1.5, rel=0.05)


def test_a_job_that_fails_does_not_compile_any_more(run):
    run.shown(running=["a"])
    run.log("a", "render a: 10 views to do", "compiling Cycles' kernels for NVIDIA H200: once")
    run.shown(10)
    left = run.display.seconds_left(run.now)
    run.shown(failed=["a"])
    run.shown(100, running=["b"])
    run.log("b", "render b: 10 views to do", "render b: 1 of 10 views, 10 s each, 90 s left")
    run.shown(100)
    assert run.display.seconds_left(run.now) > 1.5 * left


def test_warnings_are_shown_once_and_other_lines_not(run):
    run.log("a", "warning: coarse", "a detail", "note: so and so")
    run.log("b", "warning: coarse")
    shown = run.shown(running=["a", "b"])
    assert [line for line in shown if line.startswith(("warning", "note"))] == [
        "warning: scene/a: coarse",
        "note: so and so",
    ]
    assert not any("coarse" in line for line in run.shown())


def test_a_failure_is_shown_at_once_while_other_jobs_continue(run):
    run.shown(running=["a", "b"])
    run.log("a", "error: no room")
    assert "a failed: error: no room" in run.shown(failed=["a"])
    run.log("b", "error: no room either")
    assert not any("either" in line for line in run.shown(failed=["b"]))
    assert "b failed: error: no room either" in run.display.failures()


def test_a_job_that_succeeds_when_it_is_tried_again_has_not_failed(run):
    run.log("a", "error: no room")
    run.shown(running=["a"])
    run.shown(failed=["a", "a"])
    run.shown(running=["a"])
    run.shown(finished=["a"])
    assert run.display.failures() == ""


def test_a_group_names_only_its_job_that_failed(run):
    names = ["a", "b", "place"]
    for name in names:
        run.log(name, f"of {name}")
    (run.folder / "made").touch()
    group = run.display.submission("shard")
    for number, name in enumerate(names):
        outputs = [str(run.folder / ("made" if name == "a" else "missing"))]
        run.display.started(number, name, [str(run.folder / name)], outputs, group)
    (run.folder / "place").unlink()
    for number in range(3):
        run.display.failed(number, None)
    assert run.display.failures() == f"b failed: of b\n  log: {run.folder / 'b'}"


@pytest.mark.parametrize("run", [io.StringIO], indirect=True)
def test_a_log_file_gets_a_line_at_intervals(run):
    lines = run.shown(running=["a"])
    for _ in range(3600):
        lines += run.shown(1)
    assert 30 < len(lines) < 60
    assert run.shown(10 * 24 * 3600)[0].startswith("0 of 4 jobs · 0 of 20 views · ")
    assert lines[-1].endswith(" left · views")


def test_logs_of_other_runs_are_not_read(run):
    run.log("a", "warning: of old")
    run.now += 60
    run.begin()
    assert not any("of old" in line for line in run.shown(running=["a"]))


@pytest.mark.parametrize(
    ("remark", "file"),
    [
        ("Singularity containers: ignored", "workflow.py"),
        ("Restored previous version", "jobs.py"),
        ("Exiting because a job execution failed", "scheduling/job_scheduler.py"),
        ("At least one job did not complete successfully", "workflow.py"),
    ],
)
def test_the_terminal_leaves_out_remarks_of_snakemake_that_do_not_help(remark, file):
    source = (Path(snakemake.__file__).parent / file).read_text(encoding="utf-8")
    assert remark in source
    if remark.startswith("At least"):
        remark = f"WorkflowError:\n{remark}"
    path = ROOT / "envs" / "snakemake_logger_plugin_plenoforge" / "__init__.py"
    spec = importlib.util.spec_from_file_location("plugin", path)
    plugin = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(plugin)
    handler = plugin.LogHandler.__new__(plugin.LogHandler)
    handler.has_started = False
    for message, is_shown in ((remark, False), ("a rule of the lint", True)):
        record = logging.LogRecord("snakemake", logging.INFO, "", 1, message, (), None)
        assert handler.is_worth_a_line(record) == is_shown


def test_progress_lines_can_be_parsed(capsys):
    shard = progress.Progress(2, "render results/a: b 0:2", already=3)
    shard.done()
    shard.done()
    first, last = map(progress.read, capsys.readouterr().err.splitlines())
    assert (first.done, first.total, first.already) == (0, 2, 3)
    assert (last.done, last.total, last.already) == (2, 2, None)
    assert 0 <= last.each < 1
    assert progress.read("3 of 4 views") is None


def test_the_end_of_a_run_is_shown_from_the_folder_of_the_run(tmp_path, monkeypatch):
    """With --directory, Snakemake leaves that folder before the display closes."""
    monkeypatch.chdir(tmp_path)
    display = RunDisplay()
    display.is_told = True
    folders = []
    display.at_close(lambda: folders.append(Path.cwd()))
    monkeypatch.chdir("/")
    display.close()
    assert folders == [tmp_path]
