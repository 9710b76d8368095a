"""What the workflow itself asks Slurm, beside Snakemake's executor.

It asks whether Slurm answers, whether it still has jobs of the run, and why it refuses some.
"""

import os
import shlex
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Sequence, Set

from lightfield.core.errors import UserError
from lightfield.core.units import duration
from lightfield.planning.forecast import Request

# Seconds between two looks at Slurm's queue.
_PAUSE = 30.0
# A run that waits so many seconds for jobs that Slurm does not have is ended. Snakemake's executor
# looks at least every 180 seconds, and then waits for the files of a job that has ended.
PATIENCE = 360.0
# Slurm's commands take some seconds if the controller does not answer.
_LONGEST_ANSWER = 60.0
# Resources of a rule that the executor passes to sbatch, and sbatch's options for them.
_OPTIONS = {
    "slurm_account": "--account",
    "slurm_partition": "--partition",
    "qos": "--qos",
    "constraint": "--constraint",
    "slurm_reservation": "--reservation",
}


def check_slurm() -> None:
    """Raise `UserError` if no Slurm answers here."""
    _, problem = _ask("sinfo")
    if problem:
        raise UserError(f"--executor slurm: no Slurm answers: {problem}: run this on a login node")


def refusal(requests: Sequence[Request]) -> str | None:
    """Return why sbatch refuses a job that runs these jobs one after the other. Or None.

    Snakemake keeps no message of its executor about a group, so this asks sbatch again. Submits
    nothing.
    """
    resources = [request.resources for request in requests]
    options = [f"--cpus-per-task={max(request.cores for request in requests)}"]
    options.append(f"--time={sum(each.get('runtime') or 0 for each in resources)}")
    options.append(f"--mem={max(each.get('mem_mb') or 0 for each in resources)}M")
    gpus = max(each.get("gpu") or 0 for each in resources)
    options += [f"--gpus={gpus}"] if gpus else []
    for name, option in _OPTIONS.items():
        values = [each[name] for each in resources if each.get(name)]
        options += [f"{option}={values[0]}"] if values else []
    for each in resources[:1]:
        options += shlex.split(str(each.get("slurm_extra") or ""))
    _, problem = _ask("sbatch", "--test-only", *options, "--wrap=true")
    return f"sbatch refused it: {problem}" if problem else None


def _ask(*command: str) -> tuple[str, str]:
    """Return the output of one of Slurm's commands, and its last words if it failed."""
    try:
        asked = subprocess.run(
            command,
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=_LONGEST_ANSWER,
            check=False,
        )
    except OSError:
        return "", f"there is no command {command[0]}"
    except subprocess.TimeoutExpired:
        return "", f"{command[0]} did not answer within {duration(_LONGEST_ANSWER)}"
    lines = asked.stderr.strip().splitlines() or ["it said nothing"]
    return asked.stdout, lines[-1] if asked.returncode else ""


class Watch:
    """Ends a run that waits for jobs that Slurm does not have any more.

    Snakemake's executor gives up a job if Slurm does not answer it for a while, as while the
    controller restarts. Snakemake then waits for the job for ever, also after SIGTERM.

    ``run`` is the name that the executor gives the run's jobs in Slurm. ``waits_for`` returns
    the jobs for which Snakemake waits, by number, ``say`` writes a line, and ``end`` ends the run.
    """

    def __init__(
        self,
        run: str,
        waits_for: Callable[[], Set[int]],
        say: Callable[[str], None],
        end: Callable[[str], None],
    ) -> None:
        self._run = run
        self._waits_for = waits_for
        self._say = say
        self._end = end
        self._jobs: Set[int] = frozenset()
        # When Slurm was first seen without these jobs, in seconds of time.monotonic().
        self._missing_since: float | None = None
        self._is_answered = True

    def start(self) -> None:
        """Look at Slurm's queue now and then, until the program ends."""
        threading.Thread(target=self._keep_looking, daemon=True).start()

    def _keep_looking(self) -> None:
        while not self.look(time.monotonic()):
            time.sleep(_PAUSE)

    def look(self, now: float) -> bool:
        """Look at Slurm's queue once. Return whether this has ended the run."""
        jobs = self._waits_for()
        if not jobs or jobs != self._jobs or self._has_jobs():
            self._jobs = jobs
            self._missing_since = None
            return False
        if self._missing_since is None:
            self._missing_since = now
        missing = now - self._missing_since
        if missing < PATIENCE:
            return False
        self._end(
            f"error: Slurm has had no job of this run for {duration(missing)}, but Snakemake waits "
            f"for {len(jobs)}: its executor has lost them, as it does if Slurm does not answer for "
            "a while; the same command goes on"
        )
        return True

    def _has_jobs(self) -> bool:
        """Return whether Slurm has jobs of the run, or does not answer. Say the latter once."""
        queue, problem = _ask("squeue", "--noheader", "--format=%i", f"--name={self._run}")
        if problem and self._is_answered:
            self._say(f"warning: Slurm does not answer: {problem}; its jobs go on meanwhile")
        elif not problem and not self._is_answered:
            self._say("note: Slurm answers again")
        self._is_answered = not problem
        return bool(problem or queue.strip())


def interrupt() -> None:
    """Interrupt this program, as Ctrl-C does."""
    os.kill(os.getpid(), signal.SIGINT)
