"""Shows a run while it works: its phases, a line of progress, warnings, and failures.

On a terminal the line of progress is rewritten in place. Elsewhere, as in the log of a CI, it is
written again now and then.
"""

import re
import shutil
import sys
import threading
import time
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

from lightfield.core import progress
from lightfield.core.units import count, duration

# After this many seconds of work, the run's rate counts.
_SURE_AFTER = 2.0
# Without a terminal the first line of progress comes after this many seconds.
_FIRST_LINE = 30.0
# Without a terminal the next line comes after this part of the elapsed time, or FIRST_LINE.
_NEXT_LINE = 0.1
CLEAR_LINE = "\r\x1b[K"
# The lines of a program's log that the user sees.
_FOR_THE_USER = re.compile(r"warning: |note: ")


@dataclass
class Task:
    """A job: its rule, ``name``, phase and log.

    ``views`` is the number of the dataset's views that it renders. ``seconds`` is its estimated
    time on one core, None if that is unknown.
    """

    rule: str
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

    ``look`` returns the keys of the jobs that are running, finished and failed. ``explain`` returns
    why the jobs of some keys failed.
    """

    def __init__(
        self,
        look: Callable[[], tuple[Iterable[Hashable], Iterable[Hashable], Iterable[Hashable]]],
        explain: Callable[[set[Hashable]], str],
        stream: TextIO | None = None,
    ) -> None:
        self._look = look
        self._explain = explain
        self._stream = stream or sys.stderr
        self._terminal = self._stream.isatty()
        self._failed: set[Hashable] = set()
        self._shown_warnings: set[str] = set()
        self._drawn = False
        self._end = threading.Event()
        self._lock = threading.RLock()
        self.begin({}, 1)

    def begin(self, tasks: Mapping[Hashable, Task], cores: int) -> None:
        """Begin to show these tasks, which share ``cores``."""
        self._tasks = tasks
        self._open = dict(tasks)
        self._cores = cores
        self._phases = dict.fromkeys(task.phase for task in tasks.values())
        self._began = time.time()
        self._due = _FIRST_LINE

    def start(self) -> None:
        """Update the display each second, until `stop`."""
        threading.Thread(target=self._watch, daemon=True).start()

    def stop(self) -> None:
        """Update the display a last time."""
        if not self._end.is_set():
            self._end.set()
            self.update()
            self.clear()

    def summary(self, cpu_seconds: float | None) -> str:
        """Return what the run did and took, and its forecast, if these are known.

        With Snakemake's ``--until`` a run ends before all tasks have run.
        """
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

    def clear(self) -> None:
        """Remove the line of progress from the terminal, so that other text can be written."""
        with self._lock:
            if self._drawn:
                self._write(CLEAR_LINE)
                self._drawn = False

    def _watch(self) -> None:
        while not self._end.wait(1):
            self.update()

    def update(self) -> None:
        """Look at the state of the run, and show it."""
        with self._lock:
            running, finished, failed = map(set, self._look())
            now = time.time()
            for key, task in list(self._open.items()):
                if task.began is None and key in running | finished | failed:
                    task.began = now
                if task.began is not None:
                    self._follow(task)
                if key in finished:
                    task.ended = now
                    del self._open[key]
            self._report_failed(failed, running)
            self._report_phases()
            if self._open and not self._end.is_set():
                self._draw(now)

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
            elif _FOR_THE_USER.match(line) and line not in self._shown_warnings:
                self._shown_warnings.add(line)
                # A note names its subject. A warning does not, so add the task.
                text = line.removeprefix("warning: ")
                self._say(line if text == line else f"warning: {task.name}: {text}")

    def _report_failed(self, failed: set[Hashable], running: set[Hashable]) -> None:
        """Say at once why a job failed, if others go on. The end of the run repeats it."""
        new = {key for key in failed - self._failed if key in self._tasks}
        self._failed |= failed
        if new and running:
            self._say(self._explain(new))

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
            self._say(f"{phase}: {done} in {duration(ended - began)}")

    def _draw(self, now: float) -> None:
        if self._terminal:
            columns = shutil.get_terminal_size().columns
            self._write(CLEAR_LINE + self.line(now)[: columns - 1])
            self._drawn = True
        elif now - self._began >= self._due:
            self._due = now - self._began + max(_FIRST_LINE, _NEXT_LINE * (now - self._began))
            self._say(self.line(now))

    def line(self, now: float) -> str:
        """Return the line of progress at ``now``, in seconds since 1970."""
        tasks = self._tasks.values()
        parts = [f"{len(tasks) - len(self._open)} of {count(len(tasks), 'job')}"]
        views = sum(task.views for task in tasks)
        if views:
            parts.append(f"{sum(task.views_done for task in tasks)} of {views} views")
            views_made = sum(task.views_made for task in tasks)
            since = min((task.began for task in tasks if task.views and task.began), default=now)
            if views_made and now > since and any(task.views for task in self._open.values()):
                parts[-1] += f", {60 * views_made / (now - since):.3g} a minute"
        parts.append(f"{duration(self.seconds_left(now))} left")
        at_work = [task.at_work for task in self._open.values() if task.began is not None]
        return " · ".join([*parts, *dict.fromkeys(at_work)])

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
            done += seconds * task.part * (1 - task.already / (task.total or 1))
            remaining += seconds * (1 - task.part)
        elapsed = now - self._began
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

    def _say(self, text: str) -> None:
        self.clear()
        self._write(f"{text}\n")

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()


def _expected_seconds(tasks: Iterable[Task]) -> float:
    """Return the estimated CPU seconds of tasks, without the work of earlier runs."""
    return sum((task.seconds or 0.0) * (1 - task.already / (task.total or 1)) for task in tasks)
