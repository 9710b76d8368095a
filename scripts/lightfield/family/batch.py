"""Builds a batch of members: one after the other, in a process that may die without the others.

A worker process builds the members. A signal may end it, as when memory runs out or Blender
crashes. Then the member at hand has failed, and another worker goes on with the next. The history
in the batch's receipt says what each process did. So if this process dies as well, the next run
knows which member was at hand, and builds it last: a user may have killed the run, or the member
may have taken all memory. A member at which three runs in a row have died has failed.

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
from lightfield.core import cli, leftovers, receipts
from lightfield.core.errors import UserError
from lightfield.core.files import append_json_line
from lightfield.core.names import SPLITS
from lightfield.core.progress import Progress
from lightfield.core.receipts import PART_SUFFIX, OpenReceipt
from lightfield.family.member import MemberBuild
from lightfield.formats.layout import SUMS
from lightfield.stages.family import BuildMembers
from lightfield.workflow.failures import signal_cause
from lightfield.workflow.history import History

# These signals stop a run. They are no fault of the member at hand.
_STOPS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
# A member at which so many runs died has failed.
_MOST_DEATHS = 3
# The files that stand for a member in the receipt of its batch.
_OF_MEMBER = (RECORD, SPLITS, SUMS)


def run(job: BuildMembers) -> None:
    """Build the members of a batch that are not finished.

    Raises `UserError` if nothing can be written, if the run is stopped, or if a file has changed
    after a member was read from it.
    """
    builds = {member.name: MemberBuild(job.settings, member) for member in job.settings.members}
    leftovers.remove()
    failed: list[str] = []
    lines = _history(job)
    last = member_at_hand(lines)
    if name := deadly_member(lines):
        if name in builds:
            builds[name].note_death(
                f"{_MOST_DEATHS} runs died at it: most likely memory ran out, or Blender crashed"
            )
            failed.append(name)
        _note(job, {"failed": name})
    history = History()
    while signal_number := _work(job, failed, last):
        name = member_at_hand(_history(job))
        if name is None or signal_number in _STOPS:
            raise UserError(f"killed by {signal.Signals(signal_number).name}")
        builds[name].note_death(signal_cause(signal_number))
        _note(job, {"failed": name})
        failed.append(name)
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
    for build in missing:
        if os.getppid() != parent:
            raise UserError("the run has ended")
        _note(job, {"member": build.member.name, "began": round(time.time(), 3)})
        began = time.process_time()
        record = build.build(job.device, job.threads)
        _note(
            job,
            {
                "member": build.member.name,
                "state": record["state"],
                "finished": round(time.time(), 3),
                "cpu_seconds": round(time.process_time() - began, 3),
                "memory_bytes": psutil.Process().memory_info().rss,
            },
        )
        if record["state"] == "failed":
            failure = record["failure"]
            print(
                f"member {build.member.name} failed: {failure['stage']}: {failure['cause']}",
                file=sys.stderr,
                flush=True,
            )
        progress.done()


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
        elif line.keys() & {"finished", "failed", "started", "ended"}:
            name = None
    return name


def deadly_member(lines: Sequence[Mapping[str, Any]]) -> str | None:
    """Return the member at which the last `_MOST_DEATHS` runs of a history died, if any."""
    runs: list[list[Mapping[str, Any]]] = []
    for line in lines:
        if "started" in line:
            runs.append([])
        elif runs:
            runs[-1].append(line)
    at_hand = [member_at_hand(run) for run in runs[-_MOST_DEATHS:]]
    if len(at_hand) < _MOST_DEATHS or len(set(at_hand)) > 1:
        return None
    return at_hand[0]
