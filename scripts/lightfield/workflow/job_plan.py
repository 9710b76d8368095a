"""Decides which jobs run: those whose receipts do not say that their files are fine.

A rule's inputs are an input function that `JobPlan.reads` makes. When Snakemake calls it, the check
judges the job's receipt. A job that must run gets the mark as an input with new content.
"""

import atexit
import contextlib
import functools
import itertools
import json
import os
import re
import shlex
import sys
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from lightfield.configuration.dataset import Dataset
from lightfield.configuration.scene_yaml import load_scene
from lightfield.core.disk_space import check_folder
from lightfield.core.errors import UserError
from lightfield.core.files import read_json, set_aside, special_kind, unreadable, write_text
from lightfield.engine import receipts
from lightfield.engine.receipts import SUFFIX, make_way
from lightfield.stages.registry import VERSIONS
from lightfield.workflow import presence, run_lock
from lightfield.workflow.build import Wildcards
from lightfield.workflow.check import JobCheck
from lightfield.workflow.jobs import (
    BUILD_MEMBERS,
    FIGURES,
    LIGHTFIELD,
    PAGE,
    RENDER,
    SEQUENCE_PAGE,
    Job,
)
from lightfield.workflow.member_record import former_places
from lightfield.workflow.run import HasWildcards, Run, one_of
from lightfield.workflow.run_config import ending_run

# A plan names at most this many outdated jobs.
MOST_REASONS = 10

Content = Mapping[str, Any]
Files = dict[str, Any]
"""The inputs of a job by name: a path each, or a list of paths."""


class Wanted(NamedTuple):
    """What a job reads: its inputs by name, and the path and content of its settings, if any."""

    files: Files
    settings_path: str | None
    settings: dict[str, Any]


class PlannedJob(NamedTuple):
    """A job: its record, and its wildcards."""

    job: Job
    names: Wildcards

    @property
    def name(self) -> str:
        """Its name, as its receipt and its log have it."""
        return self.job.name.format(**self.names)


class JobPlan:
    """The jobs of a run, and which of them must run.

    All jobs share the folder of the run. `StoredPlan` is for jobs that share only a storage.
    """

    # Where the storage of jobs without a common folder is.
    url = ""
    # Where Snakemake puts its copies of stored files.
    copies = ""
    is_stored = False
    # The settings files that jobs write. Without a storage, the plan writes them.
    settings_paths = one_of([])

    def __init__(self, run: Run) -> None:
        self.run = run
        self.receipts = f"{run.work}/{receipts.FOLDER}"
        # An input of each job. It has new content if a job must run, and no other job looks at it.
        self.mark = f"{run.work}/check.txt"
        # The jobs that Snakemake asked about, by receipt.
        self.asked: dict[str, PlannedJob] = {}
        # The jobs of the rules, and the functions that return what they read.
        self._jobs: list[tuple[Job, Callable[[HasWildcards], Wanted]]] = []
        # The settings that differ from their files. They are written when a run starts.
        self._new_settings: dict[str, str] = {}
        # The settings by their files' paths, which a job writes each: see rules/settings.smk. Empty
        # without a storage.
        self.settings_texts: dict[str, str] = {}
        self._is_marked = False
        self._writable: set[str] = set()
        self._expressions: dict[str, str] = {}
        self.check = JobCheck(Path(run.work), Path(run.results), self._wanted_settings, VERSIONS)
        if run.is_main:
            # The next plan need not read the same files again.
            atexit.register(self.check.sums.save)

    # What a rule asks for.

    def receipt_of(self, job: Job) -> Any:
        """Return the output that is the receipt of a job, with wildcards."""
        return self.run.marks.update(self.receipt_path(job.name))

    def bundle_of(self, job: Job) -> str | list[str]:
        """Return the output that is the bundle of a job. Empty if jobs share a folder."""
        return []

    def reads(self, job: Job, are_noted: bool = False, **inputs: Any) -> Any:
        """Return the inputs of a rule: its files, its settings, and the mark that makes it run.

        ``inputs`` are paths with wildcards, lists of them, or input functions. ``are_noted`` says
        that the job must run if its receipt lacks one of them. A receipt may have more of them,
        which other runs chose.
        """

        def wanted(wildcards: HasWildcards) -> Wanted:
            """Return the job's inputs by name, and the path and content of its settings."""
            files = {name: paths_of(each, wildcards) for name, each in inputs.items()}
            if job.settings is None:
                return Wanted(files, None, {})
            settings_of = functools.partial(job.settings, self.run.build)
            path, content = self.run.asked(settings_of, wildcards)
            if "inputs" in content:
                content["inputs"] = [*flat(files.values())]
            return Wanted(files, path, content)

        def input_function(wildcards: HasWildcards) -> Files:
            planned = PlannedJob(job, job.names(dict(wildcards.items())))
            receipt = self.receipt_path(planned.name)
            job_reads = wanted(planned.names)
            path = job_reads.settings_path
            settings = {"settings": self._settings_file(path, job_reads.settings)} if path else {}
            self.asked[receipt] = planned
            return self._inputs(receipt, planned, job_reads, settings, are_noted)

        self._jobs.append((job, wanted))
        return self.run.marks.unpack(input_function)

    def only_stored(self, files: Any) -> Any:
        """Return files that a job declares only with a storage, because they must travel."""
        return []

    def only_shared(self, files: Any) -> Any:
        """Return files that a job declares only if it shares the folder of the run."""
        return files

    def mark_of_settings(self, wildcards: HasWildcards) -> Any:
        """Return the input of the job that writes settings: the mark, new if they have changed."""
        return self.mark

    # The inputs of a job.

    def _inputs(
        self, receipt: str, planned: PlannedJob, wanted: Wanted, settings: Files, are_noted: bool
    ) -> Files:
        """Return the inputs of a job by name, of which one is new if it must run."""
        ancient = self.run.marks.ancient
        if not self.run.is_main:
            return wanted.files | settings | {"mark": ancient(self.mark)}
        noted = [*flat(wanted.files.values())] if are_noted else ()
        is_fine = self.check.verdict(receipt, wanted.settings, noted).is_fine
        if not is_fine:
            # Snakemake would name read-only files in many lines, or end with a traceback.
            for folder in self._folders_of(planned):
                self._end_unless_writable(folder)
            written = (self.run.log_of(planned.job), self.run.times_of(planned.job))
            self._wait_until_past([receipt, *(path.format(**planned.names) for path in written)])
        if not os.path.exists(self.mark):  # noqa: PTH110, a `Path` is slow for many jobs
            self.new_mark()
        files = {name: self._unless_newer(receipt, each) for name, each in wanted.files.items()}
        # The mark comes first: for the first file below a folder, Snakemake lists all folders down
        # to that file, and never sees what is written into them later, such as settings.
        mark = {"mark": ancient(self.mark) if is_fine else self.new_mark()}
        return mark | files | settings

    def _folders_of(self, planned: PlannedJob) -> list[str]:
        """Return folders in which a job writes."""
        job, names = planned
        run, paths = self.run, self.run.paths
        written = [f"{folder}/{job.name}" for folder in (run.results, run.work, self.receipts)]
        written += [run.log_of(job), run.times_of(job)]
        if job is RENDER:
            written.append(f"{paths.views}/{{first}}")
        elif job in (FIGURES, PAGE):
            written.append(paths.page)
        elif job is SEQUENCE_PAGE:
            written.append(paths.sequence_page)
        return [os.path.dirname(path.format(**names)) for path in written]  # noqa: PTH120

    def _end_unless_writable(self, folder: str) -> None:
        """End the run with one line if nothing can be written in the folder of a job."""
        if folder not in self._writable:
            with ending_run():
                check_folder(Path(folder))
            self._writable.add(folder)

    def _wait_until_past(self, paths: list[str]) -> None:
        """Wait until files are older than the mark, or end the run with one line if it takes long.

        The clock of the machine that wrote them may be ahead. Snakemake starts a job only if an
        input is newer than what the job made before.
        """
        with ending_run():
            presence.check_times(paths, [self.run.results, self.run.work])
        ahead = max(map(presence.time_of, paths)) - time.time()
        if ahead >= 0:
            time.sleep(ahead + 0.01)
            self._is_marked = False

    def _unless_newer(self, receipt: str, each: Any) -> Any:
        """Return an input, so that Snakemake does not see its time if it is only newer."""
        if not isinstance(each, str):
            return [self._unless_newer(receipt, one) for one in each]
        is_only_newer = self.check.is_only_newer(receipt, each)
        return self.run.marks.ancient(each) if is_only_newer else each

    def new_mark(self) -> str:
        """Give the mark new content once, and return it. Snakemake ignores a mere new time."""
        if not self._is_marked:
            _write_or_end(self.mark, f"{uuid.uuid4()}\n")
            self._is_marked = True
        return self.mark

    # The settings of a job.

    def _settings_file(self, path: str, content: Content) -> Any:
        """Return the settings file of a job as an input.

        Its time does not count: the check reads it. The file is written now only if it is missing,
        because a live run may read it. A run writes the others when it starts.
        """
        text = text_of(content)
        if self.run.is_main:
            if unreadable(path):
                set_aside(Path(path), Path(self.run.removed))
            if not Path(path).exists():
                _write_or_end(path, text)
            elif Path(path).read_bytes() != text.encode():
                self._new_settings[path] = text
        return self.run.marks.ancient(path)

    def write_new_settings(self) -> None:
        """Write the settings that differ from their files."""
        for path, text in self._new_settings.items():
            write_text(path, text)

    def _wanted_settings(self, receipt: str) -> Content | None:
        """Return the wanted settings of a receipt's job. None if no job of this plan makes it."""
        for job, wanted in self._jobs:
            if found := re.fullmatch(self._expression_of(job.name), self._job_of(receipt)):
                # A job that the configuration no longer has would end the run.
                with contextlib.suppress(SystemExit):
                    return wanted(found.groupdict()).settings
        return None

    def _expression_of(self, pattern: str) -> str:
        """Return the regular expression that a name or path with wildcards stands for."""
        if pattern not in self._expressions:
            self._expressions[pattern] = _expression(pattern, self.run.constraints)
        return self._expressions[pattern]

    # The jobs that run.

    def planned_jobs(self) -> list[PlannedJob]:
        """Return the jobs that run."""
        return [job for receipt, job in self.asked.items() if self.check.will_run(receipt)]

    def files_read(self) -> list[str]:
        """Return the files that jobs of this run read, and that no job of it makes."""
        wanted = dict(self._jobs)
        paths: dict[str, None] = {}
        for planned in self.planned_jobs():
            paths |= dict.fromkeys(flat(wanted[planned.job](planned.names).files.values()))
        return [path for path in paths if not self.check.is_made(path)]

    def batch_receipts(self, wildcards: Wildcards) -> list[str]:
        """Return the receipts of all batches of a family."""
        family = wildcards["family"]
        batches = self.run.build.batches[family]
        return [
            self.receipt_path(BUILD_MEMBERS.name.format(family=family, batch=batch))
            for batch in batches
        ]

    def former_places(self, family: str) -> list[str]:
        """Return the folders of members and datasets that a family no longer has."""
        build = self.run.build
        names = {member.name for batch in build.batches[family].values() for member in batch}
        rigs = load_scene(build.family_names[family]).rigs
        return former_places(
            Path(self.run.results, family), Path(self.receipts, family), names, rigs
        )

    def receipt_path(self, job: str) -> str:
        return f"{self.receipts}/{job}{SUFFIX}"

    def _job_of(self, receipt: str) -> str:
        """Return the name of the job of a receipt."""
        return receipt.removeprefix(f"{self.receipts}/").removesuffix(SUFFIX)

    def scene_folders(self) -> list[Path]:
        """Return the folders of the receipts of the scenes that this run makes."""
        scenes = {
            scene
            for scene, separator, _ in (self._job_of(each).partition("/") for each in self.asked)
            if separator
        }
        return [Path(self.receipts, scene) for scene in sorted(scenes)]

    def make_ways(self) -> None:
        """Move away links in place of files that a run changes, and what is no file.

        A run changes the files of locks and times. Snakemake copies an output before its job.
        """
        locks = [folder / run_lock.NAME for folder in self.scene_folders()]
        listing = os.walk(f"{self.run.work}/benchmarks")
        times = [Path(folder, name) for folder, _, names in listing for name in names]
        damaged = (verdict.damaged for verdict in self.check.verdicts.values())
        made = [*self.asked, *itertools.chain(*damaged)]
        special = [Path(path) for path in made if special_kind(path)]
        for path in locks + times + special:
            make_way(path, Path(self.run.work))

    # What a plan says of files that are made again.

    def check_folders(self) -> None:
        """Raise `UserError` if the receipts are of files in other folders than the chosen ones."""
        for receipt, verdict in self.check.verdicts.items():
            if verdict.elsewhere:
                raise self.run.config.mistake(
                    f"results: is {self.run.results}, and work is {self.run.work}, but {receipt} "
                    f"is the receipt of {verdict.elsewhere}: after a move, leave a link in the old "
                    "place, and keep the key; a second build needs a folder work of its own"
                )

    def announce_changes(self) -> None:
        """Say which files this run makes again, and why. Another run may be replacing them now."""
        if any(map(run_lock.is_held, self.scene_folders())):
            return
        with contextlib.suppress(UserError):
            self.check_folders()
            self._announce_outdated()

    def _announce_outdated(self) -> None:
        """Say which files are made again because they are damaged or outdated."""
        for receipt, verdict in self.check.verdicts.items():
            for path in verdict.damaged:
                print(f"{path}: {_damage_of(path)}; it is made anew", file=sys.stderr)
                if self._is_of_another_build(path, receipt):
                    print(
                        f"note: {path} is newer than its receipt: if runs with another folder work "
                        "make this dataset, too, each run makes the other's files again: give each "
                        "folder work a folder results",
                        file=sys.stderr,
                    )
        outdated = {
            receipt: verdict.outdated
            for receipt, verdict in self.check.verdicts.items()
            if verdict.outdated
        }
        for receipt in [*outdated][:MOST_REASONS]:
            changes = ", ".join(outdated[receipt][:3])
            print(f"outdated: {self._job_of(receipt)}: {changes}", file=sys.stderr)
        if len(outdated) > MOST_REASONS:
            print(f"outdated: and {len(outdated) - MOST_REASONS} more", file=sys.stderr)

    def _is_of_another_build(self, path: str, receipt: str) -> bool:
        """Return whether another build seems to have written a file with what a dataset has cost.

        These files are never equal in two builds.
        """
        file = Path(path)
        is_of_costs = file.name == Path(self.run.paths.costs).name and file.is_file()
        return is_of_costs and file.stat().st_mtime > Path(receipt).stat().st_mtime

    # What the end of a run says.

    def left_out(self) -> Callable[[str], bool]:
        """Return a function that says whether the job of a receipt, or one before it, must run."""
        run = self.run
        check = JobCheck(Path(run.work), Path(run.results), self._wanted_settings, VERSIONS)
        check.sums = self.check.sums
        return check.will_run

    def is_outdated(self, dataset: Dataset) -> bool:
        """Return whether this run makes the light field of a dataset again."""
        receipt = self.receipt_path(LIGHTFIELD.name_of(dataset))
        return self.check.will_run(receipt)

    def is_valid(self, dataset: Dataset) -> bool:
        """Return whether the validation of a finished dataset says that it is valid."""
        return bool(read_json(dataset.paths.validation)["valid"])

    def shown(self, path: str) -> str:
        """Return a path of the results as a message names it."""
        return path

    def find_log(self, shown: str) -> Path:
        """Return the file of a log that Snakemake names."""
        return Path(shown)

    def verify_command(self, wildcards: HasWildcards) -> str:
        """Return the command that verifies all folders. Without any, it does nothing."""
        folders = shlex.join(self.run.build.verified_folders)
        return f"python {self.run.scripts}/verify.py {folders} --work {self.run.work}"

    def prune_command(self, wildcards: HasWildcards) -> str:
        """Return the command that removes what the chosen families no longer have."""
        run = self.run
        families = [w for names in run.build.family_names.items() for w in ("--family", *names)]
        folders = f"--results {run.results} --work {run.work}"
        return f"python {run.scripts}/prune.py {folders} {shlex.join(families)}"

    def check_provider(self, path: str) -> None:
        """End the run if Snakemake has a storage, as its ``path`` of an output tells."""
        if self.run.is_main and is_in_storage(path):
            sys.exit(
                "error: storage: is empty, but Snakemake has a storage: add --config "
                "storage=<its place>"
            )


def is_in_storage(path: str) -> bool:
    """Return whether Snakemake's path of an output lies in a storage. Only the path says so."""
    return ".snakemake/storage/" in path


def paths_of(each: Any, wildcards: HasWildcards) -> Any:
    """Return an input of a job: a path, or a list of paths."""
    if callable(each):
        return each(wildcards)
    if isinstance(each, str):
        return each.format(**dict(wildcards.items()))
    return [paths_of(one, wildcards) for one in each]


def flat(inputs: Iterable[Any]) -> Iterator[str]:
    """Yield the paths of inputs, which are paths or lists of paths."""
    for each in inputs:
        yield from [each] if isinstance(each, str) else each


def text_of(settings: Content) -> str:
    """Return the text of a settings file."""
    return json.dumps(settings, indent=1, allow_nan=False) + "\n"


def _expression(pattern: str, constraints: Mapping[str, str]) -> str:
    """Return the regular expression that a name or path with wildcards stands for."""
    parts = re.split(r"\{(\w+)\}", pattern)
    texts = map(re.escape, parts[::2])
    wildcards = [f"(?P<{name}>{constraints[name]})" for name in parts[1::2]]
    return "".join(itertools.chain(*itertools.zip_longest(texts, wildcards, fillvalue="")))


def _write_or_end(path: str, text: str) -> None:
    """Write a text. End the run with one line if the disk takes none."""
    with ending_run():
        write_text(path, text)


def _damage_of(path: str) -> str:
    """Return what is wrong with a file that is not as its receipt says."""
    if not os.path.lexists(path):
        return "is missing"
    return unreadable(path) or "its sha256 is not the one in its receipt"
