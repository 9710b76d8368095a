"""Builds a batch of members: one after the other, in a process that may die without the others.

A member has failed if a stage refused it, or if Blender crashed at it. A cause outside the member,
such as a full disk, is no failure of it: the other members are built, and then the job fails.

A worker process builds the members. If a signal ends it, another worker goes on with the next
member. The history in the batch's receipt says what each process did. So if this process dies as
well, the next run knows which member was at hand, and builds it last: a user may have killed the
run, or the member may have taken all memory. A member at which processes were killed in three runs
in a row has failed, so that the rest of its family can be collected.

Each member has a receipt of its own. The batch's receipt has the files that the members were read
from, and a few small files that stand for each member. A plan looks at these alone.
"""

import os
import signal
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import psutil

from lightfield.configuration.family import RECORD, Member
from lightfield.core import cli, leftovers
from lightfield.core.errors import UserError
from lightfield.core.files import append_json_line
from lightfield.core.names import HEADS, SPLITS
from lightfield.core.progress import Progress
from lightfield.engine import receipts
from lightfield.engine.receipts import PART_SUFFIX, OpenReceipt
from lightfield.family.member import MemberBuild, cause_of
from lightfield.formats.layout import SUMS
from lightfield.stages.family import BuildMembers
from lightfield.workflow.failures import signal_cause
from lightfield.workflow.history import History

# These signals stop a run. They are no fault of the member at hand.
_STOPS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
# With these, a process ends itself at a member: Blender crashed, or a view hung. Others come from
# outside: the system ends a process with SIGKILL if memory runs out.
_CRASHES = (
    signal.SIGSEGV,
    signal.SIGABRT,
    signal.SIGILL,
    signal.SIGFPE,
    signal.SIGTRAP,
    signal.SIGALRM,
)
# A member at which processes were killed in so many runs in a row has failed.
_MOST_DEATHS = 3
# The files that stand for a member in the receipt of its batch.
_OF_MEMBER = (RECORD, SPLITS, HEADS, SUMS)


def run(job: BuildMembers) -> None:
    """Build the members of a batch that are not finished.

    Raises `UserError` if the run is stopped, if a file has changed after a member was read from it,
    or if anything else outside the members kept one of them from being built.
    """
    builds = {member.name: MemberBuild(job.settings, member) for member in job.settings.members}
    leftovers.remove()
    failed: list[str] = []
    lines = _history(job)
    last = member_at_hand(lines)
    for deadly in sorted(deadly_members(lines)):
        if deadly in builds:
            builds[deadly].note_death(
                f"{_MOST_DEATHS} runs died at it: most likely memory ran out, or Blender crashed"
            )
            failed.append(deadly)
        _note(job, {"failed": deadly})
    history = History()
    killed: dict[str, str] = {}
    while signal_number := _work(job, [*failed, *killed], last):
        name = member_at_hand(_history(job))
        if name is None:
            raise UserError(f"killed by {signal.Signals(signal_number).name}")
        if signal_number in _STOPS:
            _note(job, {"stopped": name})
            raise UserError(f"killed by {signal.Signals(signal_number).name}")
        if signal_number in _CRASHES:
            builds[name].note_death(signal_cause(signal_number))
            _note(job, {"failed": name})
            failed.append(name)
        else:
            _note(job, {"killed": name})
            killed[name] = signal_cause(signal_number)
    if killed:
        raise UserError("; ".join(f"member {name}: {cause}" for name, cause in killed.items()))
    if batch := receipts.current():
        _note_members(batch, builds.values())
    history.end()


def _history(job: BuildMembers) -> list[dict[str, Any]]:
    return receipts.history(job.receipt) if job.receipt else []


def _note(job: BuildMembers, entry: Mapping[str, Any]) -> None:
    """Add a line to the history of the batch, whose receipt the worker's parent has open."""
    if job.receipt:
        append_json_line(job.receipt.with_suffix(PART_SUFFIX), entry)


def _work(job: BuildMembers, failed: Sequence[str], last: str | None) -> int:
    """Let a worker build the members but for ``failed``, and the ``last`` one at the end.

    Returns the signal that ended the worker, or 0.
    """
    members = [member for member in job.settings.members if member.name not in failed]
    members.sort(key=lambda member: member.name == last)
    worker = get_context("spawn").Process(target=build_members, args=(job, members))
    worker.start()
    worker.join()
    assert worker.exitcode is not None
    if worker.exitcode > 0:
        # It has said why.
        sys.exit(worker.exitcode)
    return -worker.exitcode


def build_members(job: BuildMembers, members: Sequence[Member]) -> None:
    """Build the members that are not finished, and note each. This is the worker's process."""
    cli.guarded(lambda: _build_members(job, members))


def _build_members(job: BuildMembers, members: Sequence[Member]) -> None:
    builds = [MemberBuild(job.settings, member) for member in members]
    missing = [build for build in builds if not build.is_finished()]
    progress = Progress(
        len(missing), f"build {job.settings.family}", "members", already=len(builds) - len(missing)
    )
    parent = os.getppid()
    errors: list[Exception] = []
    for build in missing:
        if os.getppid() != parent:
            raise UserError("the run has ended")
        try:
            record = _build(job, build)
        except (UserError, OSError, MemoryError) as error:
            errors.append(error)
            _report(f"member {build.member.name} is not finished: {cause_of(error)}")
        else:
            if record["state"] == "failed":
                failure = record["failure"]
                cause = f"{failure['stage']}: {failure['cause']}"
                _report(f"member {build.member.name} failed: {cause}")
            progress.done()
    if errors:
        raise errors[0]


def _build(job: BuildMembers, build: MemberBuild) -> dict[str, Any]:
    """Build a member, and return its record. Note when it began and ended."""
    name = build.member.name
    _note(job, {"member": name, "began": round(time.time(), 3)})
    began = time.process_time()
    try:
        record = build.build(job.device, job.threads)
    except BaseException:
        # Without this line, the process would count as killed at the member.
        _note(job, {"stopped": name})
        raise
    _note(
        job,
        {
            "member": name,
            "state": record["state"],
            "finished": round(time.time(), 3),
            "cpu_seconds": round(time.process_time() - began, 3),
            "memory_bytes": psutil.Process().memory_info().rss,
        },
    )
    return record


def _report(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _note_members(batch: OpenReceipt, builds: Iterable[MemberBuild]) -> None:
    """Note what the members were read from, and the files that stand for them.

    Raises `UserError` for a file that has changed after a member was read from it.
    """
    for build in builds:
        member = receipts.read(build.receipt)
        if member is None:
            raise UserError(f"{build.receipt}: is missing or damaged; start the run again")
        for path, digest in member.inputs.items():
            batch.add_input(path)
            if batch.inputs[path] != digest:
                raise UserError(
                    f"{path}: has changed since {build.member.name} was built; start the run again"
                )
        for path, output in member.outputs.items():
            if Path(path).name in _OF_MEMBER:
                batch.outputs[path] = output


def member_at_hand(lines: Sequence[Mapping[str, Any]]) -> str | None:
    """Return the member that the last process of a history was building when it ended, if any."""
    name = None
    for line in lines:
        if "began" in line:
            name = line.get("member")
        elif line.keys() & {"finished", "failed", "killed", "stopped", "started", "ended"}:
            name = None
    return name


def deadly_members(lines: Sequence[Mapping[str, Any]]) -> set[str]:
    """Return the members at which a process was killed in each of the last `_MOST_DEATHS` runs."""
    runs: list[list[Mapping[str, Any]]] = []
    for line in lines:
        if "started" in line:
            runs.append([])
        elif runs:
            runs[-1].append(line)
    if len(runs) < _MOST_DEATHS:
        return set()
    return set.intersection(*map(_killed_members, runs[-_MOST_DEATHS:]))


def _killed_members(run: Sequence[Mapping[str, Any]]) -> set[str]:
    """Return the members of a run at which a worker was killed, or the whole run."""
    names = {line["killed"] for line in run if "killed" in line}
    at_hand = member_at_hand(run)
    return names if at_hand is None else {*names, at_hand}
