"""Writes a family as one corpus: corpus.json, its page, its shards, lists, and sums."""

import statistics
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from lightfield.configuration.corpus import PAGE, THUMBNAILS
from lightfield.configuration.family import RECORD
from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import DAMAGE, sha256, write_json, write_text
from lightfield.core.names import CORPUS, PARTS
from lightfield.family import corpus_looks, corpus_page, corpus_shards, members_list
from lightfield.family.corpus_looks import Look
from lightfield.formats.layout import SUMS, read_sums
from lightfield.stages.family import Corpus, CorpusSettings
from lightfield.workflow.member_record import MemberRecord, read_members

FORMAT = "plenoforge corpus"
# Bins of a histogram.
_BINS = 20


def write(job: Corpus) -> dict[str, Any]:
    """Write the corpus of a family. Return the content of its corpus.json.

    Equal members and settings give equal bytes, but for shards, which keep the order in which the
    members came, and for `MEMBERS`, which has times. The sums come last: they exist only when
    everything else does. Raises `UserError` for a member whose files are missing or damaged.
    """
    folder = job.folder
    settings = job.settings
    earlier_sums = _earlier_sums(folder / SUMS)
    (folder / SUMS).unlink(missing_ok=True)
    members = read_members(folder, settings.members)
    looks = corpus_looks.looks(folder, members, job.cache, settings.look)
    content = describe(settings, members, looks)
    write_json(folder / CORPUS, content)
    corpus_page.write(folder, content)
    corpus_shards.write(folder, settings, members, earlier_sums)
    members_list.write(folder, settings, members, job.receipt.parent if job.receipt else None)
    write_sums(folder, members, looks)
    print(summary(content, folder))
    return content


def _earlier_sums(path: Path) -> dict[str, str]:
    """Return the sums of an earlier list. Empty if it is missing or damaged."""
    with suppress(OSError, UserError, *DAMAGE):
        return read_sums(path)
    return {}


def describe(
    settings: CorpusSettings, members: Sequence[MemberRecord], looks: Mapping[str, Look]
) -> dict[str, Any]:
    """Return the content of corpus.json."""
    entries = [_entry(settings, member, looks.get(member.name, {})) for member in members]
    valid = [entry for entry in entries if entry["state"] == "valid"]
    splits = Counter(entry["split"] for entry in valid)
    return {
        "format": FORMAT,
        "name": settings.family,
        **settings.model_dump(include={"description", "licence", "credit"}, exclude_none=True),
        "splits": {
            "shares": settings.splits.as_json(),
            "valid_members": {part: splits[part] for part in PARTS},
        },
        "statistics": _statistics(members, valid),
        "failures": [
            {"name": member.name, **member.failure.model_dump()}
            for member in members
            if member.failure
        ],
        "members": entries,
    }


def _entry(settings: CorpusSettings, member: MemberRecord, look: Look) -> dict[str, Any]:
    """Return a member's entry in corpus.json."""
    entry: dict[str, Any] = {"name": member.name}
    entry |= member.model_dump(include={"seed", "model"}, exclude_none=True)
    entry |= {
        "values": member.values,
        "state": member.state,
        "split": settings.splits.part_of(member.name),
    }
    if member.is_valid:
        entry["datasets"] = {
            rig: dataset.model_dump() for rig, dataset in sorted(member.datasets.items())
        }
        entry |= {key: value for key, value in look.items() if key != "thumbnail"}
        if look:
            entry["thumbnail"] = f"{THUMBNAILS}/{member.name}.webp"
    return entry


def _statistics(
    members: Sequence[MemberRecord], valid: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Return the statistics of the members. Only ``valid`` ones count for pictures and values."""
    keys = sorted({key for entry in valid for key in entry["values"]})
    depths = [entry["depth"] for entry in valid if entry.get("depth")]
    distributions = {
        "nearest_metres": [nearest for nearest, _ in depths],
        "farthest_metres": [farthest for _, farthest in depths],
    }
    for name in ("brightness", "over_exposed", "covered"):
        distributions[name] = [entry[name] for entry in valid if entry.get(name) is not None]
    return {
        "members": len(members),
        "valid": len(valid),
        "failed": len(members) - len(valid),
        "views": sum(member.views for member in members),
        "bytes": sum(member.bytes for member in members),
        "values": {
            key: distribution([entry["values"][key] for entry in valid if key in entry["values"]])
            for key in keys
        },
        "pictures": {name: distribution(values) for name, values in distributions.items()},
    }


def distribution(values: Sequence[Any]) -> dict[str, Any]:
    """Return how values are distributed: a histogram of numbers, or each other value's count."""
    if not all(_is_number(value) for value in values):
        counts = Counter(corpus_page.value_text(value) for value in values)
        return {"counts": dict(sorted(counts.items()))}
    if not values:
        return {"counts": {}}
    low = min(values)
    high = max(values)
    bins = [0] * (_BINS if high > low else 1)
    for value in values:
        place = int((value - low) / (high - low) * len(bins)) if high > low else 0
        bins[min(place, len(bins) - 1)] += 1
    return {
        "least": low,
        "median": statistics.median(values),
        "mean": statistics.fmean(values),
        "largest": high,
        "histogram": bins,
    }


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def write_sums(folder: Path, members: Iterable[MemberRecord], looks: Mapping[str, Look]) -> None:
    """Write the sums over a corpus. The members' own lists give the sums of their datasets.

    Raises `UserError` for a dataset whose list is not as the member's record says.
    """
    sums = {name: sha256(folder / name) for name in (CORPUS, PAGE, *corpus_shards.files(folder))}
    for member in members:
        sums[f"{member.name}/{RECORD}"] = sha256(folder / member.name / RECORD)
        if member.name in looks:
            sums[f"{THUMBNAILS}/{member.name}.webp"] = looks[member.name]["thumbnail"]
        for rig, dataset in member.datasets.items():
            name = f"{member.name}/{rig}/{SUMS}"
            sums[name] = sha256(folder / name)
            if sums[name] != dataset.sha256sums:
                raise UserError(
                    f"{folder / name}: is not as {member.name}/{RECORD} says; build it again"
                )
    lines = [f"{digest}  {name}\n" for name, digest in sorted(sums.items())]
    write_text(folder / SUMS, "".join(lines))


def summary(content: Mapping[str, Any], folder: Path) -> str:
    """Return in one line what a corpus has."""
    numbers = content["statistics"]
    text = (
        f"{folder / PAGE}: {numbers['valid']:,} of {numbers['members']:,} members, "
        f"{numbers['views']:,} views, {units.size(numbers['bytes'])}"
    )
    return f"{text}; {numbers['failed']:,} failed" if numbers["failed"] else text
