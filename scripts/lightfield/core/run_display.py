"""What a run shows while it works: its phases, a line of how far it is, warnings, and failures.

On a terminal the line stays in view and is rewritten in place; elsewhere, as in the log of a CI,
it is written again now and then.
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
from lightfield.core.progress import duration

# What a job takes beside its renders, in seconds: to start a program, to read and write its files.
JOB_SECONDS = 1.5
# Not on a terminal: after so many seconds, and so much of the time until then, a line is due.
FIRST_LINE, NEXT_LINE = 30.0, 0.1
CLEAR_LINE = "\r\x1b[K"
# Of a program's log, the lines that the user is to see.
_FOR_THE_USER = re.compile(r"warning: |note: ")


@dataclass
class Task:
    """A job: its rule, ``name``, phase and log.

    ``seconds`` of one core are what its renders are expected to take, of ``views`` views, which are
    0 where none of a dataset's own is rendered.
    """

    rule: str
    name: str
    phase: str
    log: Path
    views: int = 0
    seconds: float = 0.0
    began: float | None = None
    ended: float | None = None
    # As its log has it: pieces of work that were done before, those done since, all, and the
    # seconds for each.
    kept: int = 0
    done: int = 0
    total: int = 0
    each: float | None = None
    read: int = field(default=0, repr=False)

    @property
    def part(self) -> float:
        """The part of its renders that is done."""
        if self.ended is not None:
            return 1.0
        return (self.kept + self.done) / self.total if self.total else 0.0

    @property
    def views_done(self) -> int:
        return round(self.views * self.part)

    @property
    def views_made(self) -> int:
        """Those of ``views_done`` that were not there before."""
        return max(0, self.views_done - self.kept)

    @property
    def at_work(self) -> str:
        """What it works on; if that is no views but several pieces, how many are done."""
        if self.views or self.total < 2:
            return self.phase
        return f"{self.phase} {self.kept + self.done} of {self.total}"

    def lines(self, since: float) -> list[str]:
        """Return the whole lines that its log has got; one from before ``since`` is another run's.

        ``since`` is in seconds since 1970.
        """
        try:
            if self.log.stat().st_mtime < since:
                return []
            with self.log.open("rb") as file:
                if file.seek(0, 2) < self.read:
                    # A job that is tried again begins its log anew.
                    self.read = 0
                file.seek(self.read)
                content = file.read()
        except OSError:
            return []
        complete_lines = content[: content.rfind(b"\n") + 1]
        self.read += len(complete_lines)
        return complete_lines.decode(errors="replace").splitlines()


class RunDisplay:
    """Shows how far the tasks of a run are.

    ``look`` returns the keys of the jobs that are running, finished and failed; ``explain`` why
    those of some keys failed.
    """

    def __init__(
        self,
        look: Callable[[], tuple[Iterable[Hashable], Iterable[Hashable], Iterable[Hashable]]],
        explain: Callable[[set[Hashable]], str],
        stream: TextIO | None = None,
    ) -> None:
        self._look, self._explain = look, explain
        self._stream = stream or sys.stderr
        self._terminal = self._stream.isatty()
        self._failed: set[Hashable] = set()
        self._seen: set[str] = set()
        self._drawn = False
        self._end = threading.Event()
        self._lock = threading.RLock()
        self.begin({}, 1)

    def begin(self, tasks: Mapping[Hashable, Task], cores: int) -> None:
        """Take these tasks, on which ``cores`` work."""
        self._tasks = tasks
        self._open = dict(tasks)
        self._cores = cores
        self._phases = dict.fromkeys(task.phase for task in tasks.values())
        self._began = time.time()
        self._due = FIRST_LINE

    def start(self) -> None:
        """Look each second how far the run is."""
        threading.Thread(target=self._watch, daemon=True).start()

    def stop(self) -> None:
        """Show what has happened since the last look, and no more after that."""
        if not self._end.is_set():
            self._end.set()
            self.update()
            self.clear()

    def clear(self) -> None:
        """Take the line from the terminal, for another to be written."""
        with self._lock:
            if self._drawn:
                self._write(CLEAR_LINE)
                self._drawn = False

    def _watch(self) -> None:
        while not self._end.wait(1):
            self.update()

    def update(self) -> None:
        """Look how far the run is, and show it."""
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
        """Take from a job's log how far it is, and show what is for the user."""
        for line in task.lines(self._began - 1):
            said = progress.read(line)
            if said:
                task.kept = task.kept if said.already is None else said.already
                task.done = said.done
                task.total = said.total + task.kept
                task.each = said.each
            elif _FOR_THE_USER.match(line) and line not in self._seen:
                self._seen.add(line)
                # A note names what it is about; a warning is the program's, whatever it works on.
                text = line.removeprefix("warning: ")
                self._say(line if text == line else f"warning: {task.name}: {text}")

    def _report_failed(self, failed: set[Hashable], running: set[Hashable]) -> None:
        """Say at once why a job failed, where others go on: all is said again at the end."""
        new = {key for key in failed - self._failed if key in self._tasks}
        self._failed |= failed
        if new and running:
            self._say(self._explain(new))

    def _report_phases(self) -> None:
        waiting = {task.phase for task in self._open.values()}
        for phase in [phase for phase in self._phases if phase not in waiting]:
            del self._phases[phase]
            tasks = [task for task in self._tasks.values() if task.phase == phase]
            made = sum(task.views_made for task in tasks)
            has_views = any(task.views for task in tasks)
            count = _count(made, "view") if has_views else _count(len(tasks), "job")
            began = min(task.began or self._began for task in tasks)
            ended = max(task.ended or began for task in tasks)
            self._say(f"{phase}: {count} in {duration(ended - began)}")

    def _draw(self, now: float) -> None:
        if self._terminal:
            columns = shutil.get_terminal_size().columns
            self._write(CLEAR_LINE + self.line(now)[: columns - 1])
            self._drawn = True
        elif now - self._began >= self._due:
            self._due = now - self._began + max(FIRST_LINE, NEXT_LINE * (now - self._began))
            self._say(self.line(now))

    def line(self, now: float) -> str:
        """Return how far the run is at ``now``, in seconds since 1970."""
        tasks = self._tasks.values()
        parts = [f"{len(tasks) - len(self._open)} of {_count(len(tasks), 'job')}"]
        views = sum(task.views for task in tasks)
        if views:
            parts.append(f"{sum(task.views_done for task in tasks)} of {views} views")
            made = sum(task.views_made for task in tasks)
            since = min((task.began for task in tasks if task.views and task.began), default=now)
            if made and now > since and any(task.views for task in self._open.values()):
                parts[-1] += f", {60 * made / (now - since):.3g} a minute"
        parts.append(f"{duration(self.seconds_left(now))} left")
        at_work = [task.at_work for task in self._open.values() if task.began is not None]
        return " · ".join([*parts, *dict.fromkeys(at_work)])

    def seconds_left(self, now: float) -> float:
        """Return an estimate of how long the whole run will still take.

        Renders are expected to differ from their estimates as those of this run did so far. What is
        left goes on at the rate at which work was done until now. Of what nothing is expected, a
        measurement's, what its log says is counted from when it says so.
        """
        tasks = self._tasks.values()
        spent = expected = 0.0
        for task in tasks:
            if task.views_made and task.each is not None:
                spent += task.each * task.views_made
                expected += task.seconds * task.views_made / task.views
        factor = spent / expected if expected else 1.0
        done = left = 0.0
        for task in tasks:
            rendering = factor * task.seconds
            done += rendering * task.part * (1 - task.kept / (task.total or 1))
            left += rendering * (1 - task.part)
            if task.ended is None:
                left += JOB_SECONDS
            else:
                done += JOB_SECONDS
        elapsed = now - self._began
        # Before anything is done, as fast as the cores can.
        rate = done / elapsed if done > JOB_SECONDS else float(self._cores)
        by_logs = [
            (task.total - task.kept - task.done) * task.each
            for task in self._open.values()
            if not task.seconds and task.each is not None
        ]
        return max([left / rate, *by_logs])

    def _say(self, text: str) -> None:
        self.clear()
        self._write(f"{text}\n")

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()


def _count(count: int, name: str) -> str:
    return f"{count} {name}" + ("" if count == 1 else "s")
