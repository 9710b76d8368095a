"""Counts the members of a family that are built, and lists those that failed."""

from collections.abc import Sequence
from typing import Any

from lightfield.configuration.family import summary
from lightfield.core.errors import UserError
from lightfield.core.files import read_keys, write_json, write_text
from lightfield.stages.family import CountMembers


def count(job: CountMembers) -> None:
    """Write and print how many members are built.

    Raises `UserError` if any has failed, and lists those in a file.
    """
    settings = job.settings
    members = _members(settings.records)
    failures = [
        (name, member["failure"]["stage"], member["failure"]["cause"])
        for name, member in sorted(members.items())
        if member["state"] == "failed"
    ]
    text = summary(
        settings.family,
        len(members) - len(failures),
        [(name, cause) for name, _, cause in failures],
        str(job.failed),
    )
    if failures:
        write_text(job.failed, "".join(f"{': '.join(row)}\n" for row in failures))
        raise UserError(text)
    job.failed.unlink(missing_ok=True)
    write_json(job.output, {"members": len(members)})
    print(text)


def _members(records: Sequence[str]) -> dict[str, Any]:
    """Return the members of some batches' records, by their names."""
    members: dict[str, Any] = {}
    for path in records:
        members |= read_keys(path, "build_members.py", "members")["members"]
    return members
