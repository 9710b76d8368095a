"""Writes what each member of a corpus has cost, and why it failed: one JSON object a line.

Times differ between builds of equal bytes. So the file is in the folder of reports, and
sha256sums.txt does not have it.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lightfield.configuration.corpus import MEMBERS
from lightfield.configuration.family import RECEIPT
from lightfield.core.files import write_text
from lightfield.engine import receipts
from lightfield.stages.family import CorpusSettings
from lightfield.workflow.member_record import BUILT, MemberRecord


def write(
    folder: Path, settings: CorpusSettings, members: Sequence[MemberRecord], of_family: Path | None
) -> None:
    """Write the list of a family's members into its ``folder``.

    ``of_family`` is the folder of the family's receipts, which say what members have cost. Without
    it, as by hand, times are null.
    """
    lines = [
        json.dumps(_entry(settings, member, _last_build(of_family, member.name))) + "\n"
        for member in members
    ]
    write_text(folder / MEMBERS, "".join(lines))


def _entry(
    settings: CorpusSettings, member: MemberRecord, build: Mapping[str, Any]
) -> dict[str, Any]:
    """Return a member's line. Each line has all keys, so that tables have all columns."""
    failure = member.failure
    return {
        "name": member.name,
        "state": member.state,
        "split": settings.splits.part_of(member.name),
        "seed": member.seed,
        "model": member.model,
        "views": member.views,
        "bytes": member.bytes,
        "built": build.get(BUILT),
        "seconds": build.get("seconds"),
        "cpu_seconds": build.get("cpu_seconds"),
        "stage_cpu_seconds": build.get("stage_cpu_seconds"),
        "failed_stage": failure.stage if failure else None,
        "error": failure.cause if failure else None,
        "log": failure.log if failure else None,
    }


def _last_build(of_family: Path | None, name: str) -> Mapping[str, Any]:
    """Return the line of a member's history that says what its last build took."""
    if of_family is None:
        return {}
    history = receipts.history(of_family / name / f"{RECEIPT}{receipts.SUFFIX}")
    return next((line for line in reversed(history) if BUILT in line), {})
