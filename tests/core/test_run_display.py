"""The terminal during a run: a line that stays in view, warnings, failures, phases."""

import io
import time

import pytest

from lightfield.core import progress
from lightfield.workflow import run_display
from lightfield.workflow.run_display import RunDisplay, Task


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Run:
    """Jobs whose states and logs a test writes, and the terminal's output."""

    def __init__(self, folder, stream):
        self.folder, self.stream, self.now = folder, stream, time.time()
        self.states = {"running": set(), "finished": set(), "failed": set()}
        self.display = RunDisplay(lambda: tuple(self.states.values()), self.explain, stream)
        self.tasks = {
            "place": self.task("place", "cameras"),
            "a": self.task("a", "views", views=10, seconds=100.0),
            "b": self.task("b", "views", views=10, seconds=100.0),
            "panorama": self.task("panorama", "report", seconds=50.0),
        }
        self.display.begin(self.tasks, cores=2)

    def task(self, name, phase, **more):
        return Task(name, f"scene/{name}", phase, self.folder / name, **more)

    def explain(self, names):
        return "".join(f"{name} failed: no room" for name in sorted(names))

    def log(self, name, *lines):
        with (self.folder / name).open("a") as file:
            file.writelines(f"{line}\n" for line in lines)

    def shown(self, seconds=0, **states):
        """Return the new lines on the terminal after some seconds."""
        self.now += seconds
        for state, names in states.items():
            for others in self.states.values():
                others -= set(names)
            self.states[state] |= set(names)
        before = len(self.stream.getvalue())
        self.display.update()
        text = self.stream.getvalue()[before:].replace(run_display.CLEAR_LINE, "\n")
        return [line for line in text.splitlines() if line]


@pytest.fixture(params=[Terminal, io.StringIO])
def run(request, tmp_path, monkeypatch):
    run = Run(tmp_path, request.param())
    run.began = run.now
    monkeypatch.setattr(run_display.time, "time", lambda: run.now)
    return run


@pytest.mark.parametrize("run", [Terminal], indirect=True)
def test_one_line_shows_the_progress_of_the_whole_run(run):
    # 250 s of renders on two cores.
    assert run.shown() == ["0 of 4 jobs · 0 of 20 views · 2 min 05 s left"]
    run.shown(running=["place"])
    assert run.shown(2, finished=["place"], running=["a", "b"])[0] == "cameras: 1 job in 2 s"
    run.log("a", "render scene a: 8 views to do, 2 already done")
    run.log("b", "render scene b: 10 views to do", "render scene b: 2 of 10 views, 20 s each, …")
    (line,) = run.shown(40)
    assert line.startswith("1 of 4 jobs · 4 of 20 views, 3 a minute · ")
    assert line.endswith(" left · views")
    run.log("a", "render scene a: 8 of 8 views, 20 s each, done in 180 s")
    run.log("b", "render scene b: 10 of 10 views, 20 s each, done in 200 s")
    shown = run.shown(160, finished=["a", "b"], running=["panorama"])
    assert shown[0] == "views: 18 views in 3 min 20 s"
    # Views took 20 s instead of 10 s: 50 s become 100 s, of which 1.8 are done in a second.
    assert run.display.line(run.now) == "3 of 4 jobs · 20 of 20 views · 56 s left · report"
    assert run.shown(50, finished=["panorama"]) == ["report: 1 job in 50 s"]


def test_the_end_shows_the_forecast_beside_what_the_run_took(run):
    run.tasks["place"].seconds = 5.0
    run.shown(running=["a"])
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
    run.display.begin(run.tasks, cores=2)
    run.shown(running=["error"])
    run.log("error", "garden: trials: 50 renders to do")
    run.log("error", "garden: trials: 10 of 50 renders, 3 s each, …")
    assert run.shown(30) == ["0 of 1 job · 2 min 00 s left · measurement 10 of 50"]
    run.log("error", "garden: trials: 50 of 50 renders, 3 s each, done in 150 s")
    assert run.shown(120, finished=["error"])[-1] == "measurement: 1 job in 2 min 30 s"


def test_warnings_are_shown_once_and_other_lines_not(run):
    run.log("a", "warning: coarse", "a detail", "note: so and so")
    run.log("b", "warning: coarse")
    shown = run.shown(running=["a", "b"])
    assert [line for line in shown if " left" not in line] == [
        "warning: scene/a: coarse",
        "note: so and so",
    ]
    assert not any("coarse" in line for line in run.shown())


def test_a_failure_is_shown_at_once_while_other_jobs_continue(run):
    run.shown(running=["a", "b"])
    assert run.shown(failed=["a"])[0] == "a failed: no room"


@pytest.mark.parametrize("run", [io.StringIO], indirect=True)
def test_a_log_file_gets_a_line_at_intervals(run):
    lines = []
    for _ in range(3600):
        lines += run.shown(1, running=["a"])
    assert 30 < len(lines) < 60
    assert run.shown(10 * 24 * 3600)[0].startswith("0 of 4 jobs · 0 of 20 views · ")


def test_logs_of_other_runs_are_not_read(run):
    run.log("a", "warning: of old")
    run.now += 60
    run.display.begin(run.tasks, cores=2)
    assert not any("of old" in line for line in run.shown(running=["a"]))


def test_progress_lines_can_be_parsed(capsys):
    shard = progress.Progress(2, "render results/a: b 0:2", already=3)
    shard.done()
    shard.done()
    first, last = map(progress.read, capsys.readouterr().err.splitlines())
    assert (first.done, first.total, first.already) == (0, 2, 3)
    assert (last.done, last.total, last.already) == (2, 2, None)
    assert 0 <= last.each < 1
    assert progress.read("3 of 4 views") is None
