"""Shows a run while it works: its phases, its views, the time left, warnings and failures.

On a terminal, the phases at work have bars, which are drawn again each second. Elsewhere, as in the
log of a CI, one line is written now and then. Snakemake's logger plugin tells which jobs start, end
and fail. The jobs' logs tell how far each is.
"""

import contextlib
import math
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from lightfield.core import progress
from lightfield.core.units import count, duration
from lightfield.planning.forecast import Request
from lightfield.workflow import slurm
from lightfield.workflow.failures import StartedJob, Submission, failure_report, first_sentence

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.live import Live

# After this many seconds of work, the run's rate counts.
_SURE_AFTER = 2.0
# Without a terminal the first line of progress comes after this many seconds.
_FIRST_LINE = 30.0
# Without a terminal the next line comes after this part of the elapsed time, or FIRST_LINE.
_NEXT_LINE = 0.1
# The lines of a program's log that the user sees.
_FOR_THE_USER = ("warning: ", "note: ", "waiting for ", progress.COMPILING, progress.COMPILED)


@dataclass
class Task:
    """A job: its name, its phase and its log.

    ``views`` is the number of the dataset's views that it renders. ``seconds`` is its estimated
    time on one core, None if that is unknown.
    """

    name: str
    phase: str
    log: Path
    views: int = 0
    seconds: float | None = None
    began: float | None = None
    ended: float | None = None
    # The counts in its log: pieces that an earlier run did, pieces done since, all pieces, and the
    # seconds for each.
    already: int = 0
    done: int = 0
    total: int = 0
    each: float | None = None
    # The bytes of its log that have been read.
    read: int = field(default=0, repr=False)

    @property
    def part(self) -> float:
        """The part of its work that is done."""
        if self.ended is not None:
            return 1.0
        return (self.already + self.done) / self.total if self.total else 0.0

    def part_after(self, worked: float, seconds: float) -> float:
        """Return the part that is done after it ``worked`` so long, if all of it takes ``seconds``.

        Its log tells of whole pieces. The piece at work counts by its time, and at most as done.
        """
        if self.began is None or self.ended is not None or not seconds:
            return self.part
        pieces = self.total or self.views or 1
        untold = worked / seconds * pieces - self.done
        return min(1.0, self.part + min(max(untold, 0.0), 1.0) / pieces)

    @property
    def views_done(self) -> int:
        return round(self.views * self.part)

    @property
    def views_made(self) -> int:
        """The views of ``views_done`` that this run rendered."""
        return max(0, self.views_done - self.already)

    @property
    def at_work(self) -> str:
        """Its phase. Work on other pieces than views also says how many are done."""
        if self.views or self.total < 2:
            return self.phase
        return f"{self.phase} {self.already + self.done} of {self.total}"

    def lines(self, since: float) -> list[str]:
        """Return the complete lines that its log got since the last call.

        Ignores a log from before ``since``, in seconds since 1970: an earlier run wrote it.
        """
        try:
            if self.log.stat().st_mtime < since:
                return []
            with self.log.open("rb") as file:
                if file.seek(0, 2) < self.read:
                    # A job that is retried begins its log anew.
                    self.read = 0
                file.seek(self.read)
                content = file.read()
        except OSError:
            return []
        complete_lines = content[: content.rfind(b"\n") + 1]
        self.read += len(complete_lines)
        return complete_lines.decode(errors="replace").splitlines()


class RunDisplay:
    """Shows the progress of a run's tasks.

    `Handlers` calls `begin` and `at_close`. Snakemake's logger plugin calls what says what
    Snakemake does. ``forecast`` prints the end of a dry run. ``find_log`` returns the file of a log
    that Snakemake names.
    """

    def __init__(
        self,
        forecast: Callable[[], object] = lambda: None,
        find_log: Callable[[str], Path] = Path,
        stream: TextIO | None = None,
    ) -> None:
        self._forecast = forecast
        self._find_log = find_log
        self._stream = stream or sys.stderr
        self._live: Live | None = None
        # Whether Snakemake's logger plugin calls this.
        self.is_told = False
        # The name of the run's jobs in Slurm, if Snakemake submits them there.
        self.slurm_run: str | None = None
        # Why the run was ended from outside Snakemake.
        self.end: str | None = None
        # What the jobs of a dry run would request, by their logs.
        self.requests: dict[str, Request] = {}
        self._is_shown = False
        self._folder = Path.cwd()
        self._at_close: list[Callable[[], object]] = []
        # The jobs that run or ran, and what belongs to them, by Snakemake's numbers.
        self._jobs: dict[int, StartedJob] = {}
        self._submissions: dict[int, Submission] = {}
        self._started: dict[int, Task] = {}
        self._running: set[int] = set()
        self._failed: set[int] = set()
        self._new_failures: set[int] = set()
        # The jobs that the executor has submitted to a cluster one by one.
        self._submitted: set[int] = set()
        # Why sbatch refuses groups, by their rules.
        self._refusals: dict[str, str | None] = {}
        self._shown_warnings: set[str] = set()
        # The jobs that compile, and the times from which and until which any job did.
        self._compiling: set[Path] = set()
        self._compilations: list[list[float]] = []
        self._end = threading.Event()
        self._lock = threading.RLock()
        self._set_tasks({}, 1)

    def _set_tasks(self, tasks: Mapping[Path, Task], cores: int) -> None:
        self._tasks = dict(tasks)
        self._open = dict(tasks)
        self._cores = cores
        self._phases = dict.fromkeys(task.phase for task in tasks.values())
        self._began = time.time()
        self._due = _FIRST_LINE

    def begin(self, tasks: Mapping[Path, Task], cores: int) -> None:
        """Begin to show these tasks, by their logs. They share ``cores``."""
        with self._lock:
            self._set_tasks(tasks, cores)

    def start(self) -> None:
        """Update the display each second, until it is closed."""
        threading.Thread(target=self._watch, daemon=True).start()

    def at_close(self, action: Callable[[], object]) -> None:
        """Call ``action`` after Snakemake's last message. Without the logger plugin, at once."""
        if self.is_told:
            self._at_close.append(action)
        else:
            action()

    # What Snakemake does, by its logger plugin.

    def planned(self, *, is_dry_run: bool, is_shown: bool) -> None:
        """Take notice of Snakemake's plan, which has jobs, and whether to show the progress."""
        if is_dry_run and self._forecast not in self._at_close:
            self._at_close.append(self._forecast)
        self._is_shown = is_shown

    def requested(
        self, rule: str, logs: Sequence[str], cores: int, resources: Mapping[str, Any]
    ) -> None:
        """Take notice of what a job in a dry run would request of a cluster."""
        if logs:
            self.requests[logs[0]] = Request(rule, cores, resources)

    def submission(self, group: str | None = None) -> Submission:
        """Return the jobs that start next as one: a single job, or a group by its name."""
        return Submission(group)

    def started(
        self,
        number: int,
        rule: str,
        logs: Sequence[str],
        outputs: Sequence[str],
        submission: Submission,
        cores: int = 1,
        resources: Mapping[str, Any] | None = None,
    ) -> None:
        """Take notice of a job that starts, perhaps for another time, and of what it requests."""
        with self._lock:
            now = time.time()
            path = self._find_log(logs[0]) if logs else None
            request = Request(rule, cores, resources or {})
            self._jobs[number] = StartedJob(
                request, path, [Path(output) for output in outputs], now
            )
            submission.jobs.append(self._jobs[number])
            self._submissions[number] = submission
            self._running.add(number)
            self._submitted.discard(number)
            self._failed.discard(number)
            # A job without outputs takes seconds, and answers on the terminal.
            if path and outputs:
                if path not in self._tasks:
                    self._tasks[path] = self._open[path] = Task(path.stem, rule, path)
                    self._phases[rule] = None
                task = self._started[number] = self._tasks[path]
                task.began = task.began or now

    def finished(self, number: int) -> None:
        """Take notice of a job that is finished."""
        with self._lock:
            self._running.discard(number)
            if task := self._started.get(number):
                self._follow(task)
                self._end_compilation(task)
                task.ended = time.time()
                self._open.pop(task.log, None)

    def submitted(self, number: int) -> None:
        """Take notice of a job that the executor has submitted to a cluster, in no group."""
        with self._lock:
            self._submitted.add(number)

    def on_cluster(self) -> frozenset[int]:
        """Return the numbers of the jobs on a cluster for which Snakemake waits."""
        with self._lock:
            submissions = self._submissions
            return frozenset(
                number
                for number in self._running
                if number in self._submitted or submissions[number].group
            )

    def failed(self, number: int, message: str | None, batch_job: str | None = None) -> None:
        """Take notice of a job that failed. This may come twice.

        ``message`` is the executor's, and ``batch_job`` the number in the batch system of a job
        that has been submitted to one.
        """
        with self._lock:
            self._running.discard(number)
            if task := self._started.get(number):
                self._end_compilation(task)
            if number in self._jobs and number not in self._failed:
                self._jobs[number].message = first_sentence(message or "")
                self._jobs[number].batch_job = batch_job
                self._failed.add(number)
                self._new_failures.add(number)

    def say(self, text: str) -> None:
        """Write a line above the progress."""
        with self._lock:
            if self._live:
                self._live.console.print(text)
            else:
                self._stream.write(f"{text}\n")
                self._stream.flush()

    def close(self) -> None:
        """Show the end of the run: Snakemake has written its last message."""
        self._end.set()
        with self._lock:
            if self._is_shown:
                self.update()
            if self._live:
                self._live.stop()
                self._live = None
        # With --directory, Snakemake has left the folder of the run. Paths are relative to it.
        with contextlib.chdir(self._folder):
            while self._at_close:
                self._at_close.pop(0)()

    # What `Handlers` prints at the end.

    def failures(self) -> str:
        """Return why the jobs of this run failed."""
        # Snakemake does not say which job lacks an output. Such a job does not end.
        return self._explain(self._failed or self._running)

    def summary(self, cpu_seconds: float | None) -> str:
        """Return what the run did and took, and its forecast, if these are known.

        Empty if it had no tasks. With Snakemake's ``--until`` a run ends before all tasks have run.
        """
        if not self._tasks:
            return ""
        ended = [task for task in self._tasks.values() if task.ended is not None]
        jobs = count(len(self._tasks), "job")
        if len(ended) < len(self._tasks):
            jobs = f"{len(ended)} of {jobs}"
        text = f"{jobs} in {duration(time.time() - self._began)}"
        if cpu_seconds is None:
            return text
        text += f", {duration(cpu_seconds)} of CPU time"
        if any(task.seconds is None for task in ended):
            return text
        return f"{text}; the forecast was {duration(_expected_seconds(ended))}"

    # What it shows meanwhile.

    def _watch(self) -> None:
        while not self._end.wait(1):
            if self._is_shown:
                self.update()

    def update(self) -> None:
        """Read the logs of the jobs that run, and show the state of the run."""
        with self._lock:
            for task in self._open.values():
                if task.began is not None:
                    self._follow(task)
            self._report_failed()
            self._report_phases()
            if self._open and not self._end.is_set():
                self._draw(time.time())

    def _follow(self, task: Task) -> None:
        """Read a job's progress from its log, and show the lines for the user."""
        for line in task.lines(self._began - 1):
            report = progress.read(line)
            if report:
                if report.already is not None:
                    task.already = report.already
                task.done = report.done
                task.total = report.total + task.already
                task.each = report.each
                continue
            if line.startswith(progress.COMPILING):
                if not self._compiling:
                    self._compilations.append([time.time(), math.inf])
                self._compiling.add(task.log)
            elif line.startswith(progress.COMPILED):
                self._end_compilation(task)
            if line.startswith(_FOR_THE_USER) and line not in self._shown_warnings:
                self._shown_warnings.add(line)
                # A note names its subject. A warning does not, so add the task.
                text = line.removeprefix("warning: ")
                self.say(line if text == line else f"warning: {task.name}: {text}")

    def _end_compilation(self, task: Task) -> None:
        """Take notice that a job does not compile any more, if it did."""
        if task.log in self._compiling:
            self._compiling.remove(task.log)
            if not self._compiling:
                self._compilations[-1][1] = time.time()

    def _worked(self, began: float, now: float) -> float:
        """Return the seconds of work from ``began`` to ``now``, without compilations."""
        compiled = sum(
            max(0.0, min(end, now) - max(start, began)) for start, end in self._compilations
        )
        return now - began - compiled

    def _report_failed(self) -> None:
        """Say at once why a job failed, if others go on. The end of the run repeats it."""
        new = self._new_failures & self._failed
        self._new_failures.clear()
        if new and self._running:
            self.say(self._explain(new))

    def _explain(self, numbers: Iterable[int]) -> str:
        submissions = {id(each): each for each in map(self._submissions.__getitem__, numbers)}
        causes = [
            cause for each in submissions.values() for cause in each.causes(self._why_refused)
        ]
        return failure_report(sorted(causes, key=str))

    def _why_refused(self, submission: Submission) -> str | None:
        """Return why Slurm has refused a group of jobs. None for other submissions."""
        if self.slurm_run is None or submission.group is None or submission.batch_job:
            return None
        # Groups of the same rules request about the same.
        if submission.rules not in self._refusals:
            requests = [job.request for job in submission.jobs]
            self._refusals[submission.rules] = slurm.refusal(requests)
        return self._refusals[submission.rules]

    def _report_phases(self) -> None:
        waiting = {task.phase for task in self._open.values()}
        for phase in [phase for phase in self._phases if phase not in waiting]:
            del self._phases[phase]
            tasks = [task for task in self._tasks.values() if task.phase == phase]
            views_made = sum(task.views_made for task in tasks)
            has_views = any(task.views for task in tasks)
            done = count(views_made, "view") if has_views else count(len(tasks), "job")
            began = min(task.began or self._began for task in tasks)
            ended = max(task.ended or began for task in tasks)
            # Phases overlap: without its place in the run, a time would be added to the others.
            first, last = (duration(max(0, round(at - self._began))) for at in (began, ended))
            took = duration(ended - began)
            self.say(f"{phase}: {done} in {took}, from {first} to {last} of the run")

    def _draw(self, now: float) -> None:
        if self._stream.isatty():
            self._live = self._live or _new_live(self._stream)
            self._live.update(self._bars(now), refresh=True)
        elif now - self._began >= self._due:
            self._due = now - self._began + max(_FIRST_LINE, _NEXT_LINE * (now - self._began))
            at_work = dict.fromkeys(task.at_work for task in self._tasks_at_work())
            self.say(" · ".join([self.line(now), *at_work]))

    def _bars(self, now: float) -> "RenderableType":
        """Return a bar for each phase at work, and the line of progress."""
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        bars = Table.grid(padding=(0, 1), expand=True)
        bars.add_column(no_wrap=True)
        bars.add_column(ratio=1)
        bars.add_column(no_wrap=True, justify="right")
        for phase in dict.fromkeys(task.phase for task in self._tasks_at_work()):
            tasks = [task for task in self._tasks.values() if task.phase == phase]
            part = sum(task.part for task in tasks) / len(tasks)
            bars.add_row(phase, ProgressBar(total=1.0, completed=part), _state(tasks))
        return Group(bars, Text(self.line(now), no_wrap=True, overflow="ellipsis"))

    def _tasks_at_work(self) -> list[Task]:
        return [self._started[number] for number in sorted(self._running & self._started.keys())]

    def line(self, now: float) -> str:
        """Return the line of progress at ``now``, in seconds since 1970."""
        tasks = self._tasks.values()
        parts = [f"{len(tasks) - len(self._open)} of {count(len(tasks), 'job')}"]
        views = sum(task.views for task in tasks)
        if views:
            parts.append(f"{sum(task.views_done for task in tasks)} of {views} views")
            views_made = sum(task.views_made for task in tasks)
            since = min((task.began for task in tasks if task.views and task.began), default=now)
            worked = self._worked(since, now)
            if views_made and worked > 0 and any(task.views for task in self._open.values()):
                parts[-1] += f", {60 * views_made / worked:.3g} a minute"
        parts.append(f"{duration(self.seconds_left(now))} left")
        return " · ".join(parts)

    def seconds_left(self, now: float) -> float:
        """Return an estimate of the seconds until the run ends.

        The remaining work is taken to go on at this run's rate until now. Jobs without an estimate,
        such as measurements, take as long as their logs say.
        """
        slowness = self._slowness()
        done = 0.0
        remaining = 0.0
        for task in self._tasks.values():
            seconds = slowness * (task.seconds or 0.0)
            part = task.part_after(self._worked(task.began or now, now), seconds)
            done += seconds * part * (1 - task.already / (task.total or 1))
            remaining += seconds * (1 - part)
        elapsed = self._worked(self._began, now)
        # Before much is done, assume that all cores work.
        rate = done / elapsed if done > _SURE_AFTER else float(self._cores)
        seconds_by_logs = [
            (task.total - task.already - task.done) * task.each
            for task in self._open.values()
            if task.seconds is None and task.each is not None
        ]
        return max([remaining / rate, *seconds_by_logs])

    def _slowness(self) -> float:
        """Return the seconds that this run's views took, divided by their estimates."""
        spent = 0.0
        expected = 0.0
        for task in self._tasks.values():
            if task.views_made and task.each is not None:
                spent += task.each * task.views_made
                expected += (task.seconds or 0.0) * task.views_made / task.views
        return spent / expected if expected else 1.0


def _new_live(stream: TextIO) -> "Live":
    """Return what draws at the end of a terminal."""
    # It takes long to import.
    from rich.console import Console
    from rich.live import Live

    console = Console(file=stream, highlight=False, markup=False, emoji=False, soft_wrap=True)
    live = Live(console=console, auto_refresh=False, transient=True)
    live.start()
    return live


def _state(tasks: Sequence[Task]) -> str:
    """Return how much of the work of a phase is done."""
    if views := sum(task.views for task in tasks):
        return f"{sum(task.views_done for task in tasks)} of {views} views"
    if len(tasks) == 1 and tasks[0].total > 1:
        return f"{tasks[0].already + tasks[0].done} of {tasks[0].total}"
    return f"{sum(task.ended is not None for task in tasks)} of {count(len(tasks), 'job')}"


def _expected_seconds(tasks: Iterable[Task]) -> float:
    """Return the estimated CPU seconds of tasks, without the work of earlier runs."""
    return sum((task.seconds or 0.0) * (1 - task.already / (task.total or 1)) for task in tasks)
