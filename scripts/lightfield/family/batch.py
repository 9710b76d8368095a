"""Builds a batch of members: one after the other, in a process that may die without the others.

A worker process builds the members. A signal may end it, as when memory runs out or Blender
crashes. Then the member at hand has failed, and another worker goes on with the next. A journal
beside the batch's record says what each process did. So if this process dies as well, the next run
knows which member was at hand, and builds it last: a user may have killed the run, or the member
may have taken all memory. A member at which three runs in a row have died has failed. Without a
common folder, the journal lies in the storage, because the next run may be on another node.
"""

import os
import signal
import socket
import sys
import time
from collections.abc import Mapping, Sequence
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import psutil

from lightfield.configuration.family import Member
from lightfield.core import cli, leftovers
from lightfield.core.errors import UserError
from lightfield.core.files import (
    append_json_line,
    read_json,
    read_json_lines,
    size_and_time,
    write_json,
)
from lightfield.core.paths import place_in
from lightfield.core.progress import Progress
from lightfield.family.member import MemberBuild
from lightfield.stages.family import BuildMembers
from lightfield.workflow.failures import signal_cause
from lightfield.workflow.shard_files import JOURNAL_SUFFIX
from lightfield.workflow.view_store import ViewStore

# These signals stop a run. They are no fault of the member at hand.
_STOPS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
# A member at which so many runs died has failed.
_MOST_DEATHS = 3


def run(job: BuildMembers) -> None:
    """Build the members of a batch that are not finished, and write its record.

    Raises `UserError` if nothing can be written, or if the run is stopped.
    """
    settings = job.settings
    journal = _brought_journal(job.record, Path(settings.work))
    builds = {member.name: MemberBuild(settings, member) for member in settings.members}
    leftovers.remove()
    failed: list[str] = []
    lines = list(read_json_lines(journal)) if journal.exists() else []
    last = member_at_hand(lines)
    if name := deadly_member(lines):
        if name in builds:
            builds[name].fail(
                builds[name].last_stage(),
                f"{_MOST_DEATHS} runs died at it: most likely memory ran out, or Blender crashed",
            )
            failed.append(name)
        _note(journal, {"failed": name})
    started = {"started": round(time.time(), 3), "host": socket.gethostname(), "pid": os.getpid()}
    _note(journal, started)
    while signal_number := _work(job, journal, failed, last):
        name = member_at_hand(read_json_lines(journal))
        if name is None or signal_number in _STOPS:
            raise UserError(f"killed by {signal.Signals(signal_number).name}")
        builds[name].fail(builds[name].last_stage(), signal_cause(signal_number))
        _note(journal, {"failed": name})
        failed.append(name)
    write_json(job.record, _content(builds))
    _note(journal, {"ended": round(time.time(), 3)})


def _brought_journal(record: Path, work: Path) -> Path:
    """Return the path of a batch's journal. Brings it from the storage, if there is one."""
    journal = record.with_suffix(JOURNAL_SUFFIX)
    store = ViewStore.configured()
    if not store:
        return journal
    # The record is named in the folder of Snakemake's copies, to which ``work`` is a link.
    place = place_in(work, journal)
    if place is None:
        raise UserError(f"{record}: must be in {work}")
    journal = work / place
    store.bring(str(journal))
    return journal


def _note(journal: Path, entry: Mapping[str, Any]) -> None:
    """Append a line to the journal, and keep it where the next run finds it."""
    append_json_line(journal, entry)
    if store := ViewStore.configured():
        store.send(str(journal))


def _work(job: BuildMembers, journal: Path, failed: Sequence[str], last: str | None) -> int:
    """Let a worker build the members but for ``failed``, and the ``last`` one at the end.

    Returns the signal that ended the worker, or 0.
    """
    members = [member for member in job.settings.members if member.name not in failed]
    members.sort(key=lambda member: member.name == last)
    arguments = (job, members, journal)
    worker = get_context("spawn").Process(target=build_members, args=arguments)
    worker.start()
    worker.join()
    assert worker.exitcode is not None
    if worker.exitcode > 0:
        # It has said why.
        sys.exit(worker.exitcode)
    return -worker.exitcode


def build_members(job: BuildMembers, members: Sequence[Member], journal: Path) -> None:
    """Build the members that are not finished, and journal each. This is the worker's process."""
    cli.guarded(lambda: _build_members(job, members, journal))


def _build_members(job: BuildMembers, members: Sequence[Member], journal: Path) -> None:
    builds = [MemberBuild(job.settings, member) for member in members]
    missing = [build for build in builds if not build.is_finished()]
    progress = Progress(
        len(missing), f"build {job.settings.family}", "members", already=len(builds) - len(missing)
    )
    parent = os.getppid()
    for build in missing:
        if os.getppid() != parent:
            raise UserError("the run has ended")
        _note(journal, {"member": build.member.name, "began": round(time.time(), 3)})
        began = time.process_time()
        record = build.build(job.device, job.threads)
        _note(
            journal,
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


def _content(builds: Mapping[str, MemberBuild]) -> dict[str, Any]:
    """Return the content of a batch's record: each member's record, and the models' files.

    The plan of a run compares the models' files, to know which batches are outdated.
    """
    members = {}
    sources: dict[str, tuple[int, int] | None] = {}
    for name, build in builds.items():
        members[name] = read_json(build.record)
        for path, stamp in build.source_stamps().items():
            # Of several members with a file, one may have read another content of it.
            if path not in sources or stamp != size_and_time(path):
                sources[path] = stamp
    return {"members": members, "sources": sources}


def member_at_hand(lines: Sequence[Mapping[str, Any]]) -> str | None:
    """Return the member that the last process of a journal was building when it ended, if any."""
    name = None
    for line in lines:
        if "began" in line:
            name = line.get("member")
        elif line.keys() & {"finished", "failed", "started", "ended"}:
            name = None
    return name


def deadly_member(lines: Sequence[Mapping[str, Any]]) -> str | None:
    """Return the member at which the last `_MOST_DEATHS` runs of a journal died, if any."""
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
