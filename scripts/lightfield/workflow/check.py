"""The check before the plan: compares the receipts of jobs with the disk and the wanted settings.

A job is fine if its receipt has the wanted settings, and the sums that its inputs and outputs have
now. Otherwise its files are *missing*, *damaged* (their bytes are not what the receipt says) or
*outdated* (settings or inputs are not what the receipt says). The check changes no result.

A file that a job made is read only if its size or time differs from its receipt. A file that a job
read, such as a user's texture, is read once: its sum is kept in work/sums.json with all that
differs after it was written, even if its size and time are the old ones.
"""

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from lightfield.core.errors import UserError
from lightfield.core.files import (
    DAMAGE,
    Identity,
    identity_and_sha256,
    read_bytes,
    size_and_time,
    write_json,
)
from lightfield.core.paths import lies_below
from lightfield.engine import receipts
from lightfield.engine.receipts import Receipt

NAME = "sums.json"


@dataclass(frozen=True)
class Verdict:
    """What the check found out about a job. A job without a reason to run is fine.

    ``outdated`` has the settings and inputs that changed, and ``damaged`` the files. ``unread`` has
    the inputs that are new, which the job has not read yet. ``elsewhere`` is one of the files that
    the job made, if all of them lie in other folders than this build's.
    """

    has_receipt: bool = True
    outdated: list[str] = field(default_factory=list)
    damaged: list[str] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)
    elsewhere: str | None = None

    @property
    def is_fine(self) -> bool:
        return self.has_receipt and not (self.outdated or self.damaged or self.unread)


class Sums:
    """The sums of files that were read, each with the file's identity then, by their paths."""

    def __init__(self, path: Path) -> None:
        # Snakemake leaves the folder of the run before its process ends.
        self._path = path.absolute()
        self._known: dict[str, list[Any]] = {}
        self._has_new = False
        try:
            known = json.loads(read_bytes(path))
            self._known = {name: each for name, each in known.items() if isinstance(each, list)}
        except (OSError, *DAMAGE):
            pass

    def of(self, path: str) -> str | None:
        """Return the SHA-256 of a file. None if there is no file, or if it cannot be read."""
        found = Identity.of(path)
        if found is None:
            return None
        if self._known.get(path, [])[1:] != [*found]:
            try:
                identity, digest = identity_and_sha256(path)
            except OSError:
                return None
            self._known[path] = [digest, *identity]
            self._has_new = True
        return str(self._known[path][0])

    def save(self) -> None:
        """Write the sums, if there are new ones. On a full disk, the next plan reads again."""
        if self._has_new:
            with suppress(UserError):
                write_json(self._path, self._known)
            self._has_new = False


class _Summary(NamedTuple):
    """The sum of a receipt, and the paths of its inputs."""

    sum: str
    inputs: tuple[str, ...]


class JobCheck:
    """Judges jobs by their receipts.

    ``work`` is the folder of intermediate files, and ``results`` the folder of the datasets. All
    files that jobs make lie in these two. ``wanted`` returns the wanted settings of a job, by the
    path of its receipt. None if no job of this run makes the receipt. ``versions`` has the version
    of each stage.
    """

    def __init__(
        self,
        work: Path,
        results: Path,
        wanted: Callable[[str], Mapping[str, Any] | None],
        versions: Mapping[str, int | None],
    ) -> None:
        self.work = work
        self.verdicts: dict[str, Verdict] = {}
        self.sums = Sums(work / NAME)
        self._folders = [receipts.name_of(folder) for folder in (results, work)]
        self._wanted = wanted
        self._versions = versions
        self._summaries: dict[str, _Summary | None] = {}
        self._oldest: dict[str, int] = {}
        self._input_sums: dict[str, str | None] = {}
        self._runs: dict[str, bool] = {}
        self._makers: dict[str, str | None] = {}

    def _summary(self, path: str) -> "_Summary | None":
        """Return what readers need of a receipt. None if it is missing or damaged."""
        if path not in self._summaries:
            self._read(path)
        return self._summaries[path]

    def _read(self, path: str) -> Receipt | None:
        """Return a receipt, and keep its summary. The outputs of all shards would take memory."""
        receipt = receipts.read(path)
        self._summaries[path] = _Summary(receipt.sum, tuple(receipt.inputs)) if receipt else None
        return receipt

    def verdict(
        self, path: str, settings: Mapping[str, Any], inputs: Iterable[str] = ()
    ) -> Verdict:
        """Return the verdict on the job with a receipt and these wanted settings.

        The receipt must have these ``inputs``.
        """
        if path not in self.verdicts:
            self.verdicts[path] = self._judge(path, settings, inputs)
        return self.verdicts[path]

    def _judge(self, path: str, settings: Mapping[str, Any], inputs: Iterable[str]) -> Verdict:
        receipt = self._read(path)
        if receipt is None:
            return Verdict(has_receipt=False)
        strays = [name for name in receipt.outputs if not lies_below(name, self._folders)]
        if strays:
            # So it is after a move of all results, or if another program wrote into the receipt.
            is_moved = len(strays) == len(receipt.outputs)
            return Verdict(has_receipt=False, elsewhere=strays[0] if is_moved else None)
        outdated = [*self._changed_settings(receipt, settings)]
        outdated += [name for name, digest in receipt.inputs.items() if self._sum(name) != digest]
        unread = [name for name in inputs if receipts.name_of(name) not in receipt.inputs]
        oldest = os.stat(path).st_mtime_ns  # noqa: PTH116, a `Path` is slow for many files
        damaged = []
        for name, output in receipt.outputs.items():
            # Snakemake also takes the time of the job's benchmark, which is written after these.
            oldest = min(oldest, output.stamp.modified_ns)
            stamp = size_and_time(name)
            if stamp != output.stamp[1:]:
                # Snakemake touches the declared outputs of a job after the job.
                oldest = min(oldest, stamp[1] if stamp else oldest)
                if self.sums.of(name) != output.stamp.sha256:
                    damaged.append(name)
        self._oldest[path] = oldest
        return Verdict(True, outdated, damaged, unread)

    def _changed_settings(self, receipt: Receipt, settings: Mapping[str, Any]) -> Iterator[str]:
        """Yield the settings that are not as the receipt says, and the version of the stage."""
        for key in {**settings, **receipt.settings}:
            if receipt.settings.get(key) != settings.get(key):
                yield f"setting {key}"
        if receipt.version != self._versions.get(receipt.stage):
            yield f"version of {receipt.stage}"

    def _sum(self, name: str) -> str | None:
        """Return the present sum of an input."""
        if name not in self._input_sums:
            if receipts.is_receipt(name):
                summary = self._summary(name)
                self._input_sums[name] = summary and summary.sum
            else:
                self._input_sums[name] = self.sums.of(name)
        return self._input_sums[name]

    def is_only_newer(self, path: str, name: str) -> bool:
        """Return whether a fine job reads a file that has a newer time, but the same bytes.

        So it is after a touch or a copy. Such a file is no reason to run, unless the job that made
        it runs.
        """
        if not self.verdicts[path].is_fine or path not in self._oldest:
            return False
        stamp = size_and_time(name)
        if stamp is None or stamp[1] < self._oldest[path]:
            return False
        maker = self._maker(name)
        return maker is None or not self.will_run(maker)

    def is_made(self, name: str) -> bool:
        """Return whether a job of this run makes a file."""
        maker = self._maker(name)
        return maker is not None and self.will_run(maker)

    def _maker(self, name: str) -> str | None:
        """Return the receipt of the job that made an input."""
        if receipts.is_receipt(name):
            return name
        if name not in self._makers:
            found = receipts.find_output(name, self.work)
            self._makers[name] = str(found[0]) if found else None
        return self._makers[name]

    def will_run(self, path: str) -> bool:
        """Return whether the job of a receipt runs.

        It runs if it is not fine, or if a job runs that makes one of its inputs.
        """
        if path not in self._runs:
            # A job that is its own ancestor, as no plan has one, would not end.
            self._runs[path] = False
            self._runs[path] = self._has_reason(path)
        return self._runs[path]

    def _has_reason(self, path: str) -> bool:
        """Return whether a job has a reason to run. Without a receipt, it always has."""
        summary = self._summary(path)
        if summary is None:
            return True
        if path not in self.verdicts:
            settings = self._wanted(path)
            if settings is None:
                return False
            self.verdict(path, settings)
        makers = map(self._maker, summary.inputs)
        return not self.verdicts[path].is_fine or any(
            self.will_run(maker) for maker in makers if maker
        )
