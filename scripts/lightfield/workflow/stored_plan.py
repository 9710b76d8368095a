"""The plan of jobs that share no folder, but a storage.

Snakemake moves the files that rules declare. The other files of a job travel in its bundle
(`lightfield.engine.bundles`). All that differs with a storage is in this module: `plan_of` chooses.
"""

import re
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lightfield.configuration import scene_yaml
from lightfield.configuration.dataset import Dataset
from lightfield.core.errors import UserError
from lightfield.engine import bundles
from lightfield.engine.receipts import SUFFIX, is_receipt
from lightfield.workflow.build import Wildcards
from lightfield.workflow.job_plan import (
    Content,
    Files,
    JobPlan,
    PlannedJob,
    Wanted,
    flat,
    is_in_storage,
    text_of,
)
from lightfield.workflow.jobs import JOBS, Job
from lightfield.workflow.run import HasWildcards, Run
from lightfield.workflow.run_config import ending_run
from lightfield.workflow.storage import Storage


def plan_of(run: Run) -> JobPlan:
    """Return the plan of a run, by whether its jobs share a folder or a storage."""
    return StoredPlan(run) if run.settings.storage else JobPlan(run)


class StoredPlan(JobPlan):
    """The jobs of a run that share only a storage.

    Snakemake compares the times of stored files. The check cannot see these files.
    """

    is_stored = True

    def __init__(self, run: Run) -> None:
        self.url = run.settings.storage
        self.storage = Storage(self.url)
        provider, _, place = self.url.rpartition("://")
        self.copies = f".snakemake/storage/{provider or 'fs'}/{place.strip('/')}/"
        self._makers: dict[str, tuple[str, Job] | None] = {}
        self.settings_paths = rf"{re.escape(run.work)}/(.+/)?settings/.+\.json"
        with ending_run():
            self._check_paths(run)
            self._use_copies(run.results)
            self._use_copies(run.work)
            if not run.is_main:
                self._use_copies_of_blends(run)
        super().__init__(run)

    # The folders of the run are links to Snakemake's copies.

    def _check_paths(self, run: Run) -> None:
        """Raise `UserError` for a path that jobs could not find in a storage."""
        for key, path in {"results": run.results, "work": run.work}.items():
            if _lies_elsewhere(path):
                raise run.config.mistake(
                    f"{key}: is {path}; must lie here, for the storage has its copy"
                )
        for dataset in run.chosen:
            blend = dataset.source.blend
            if blend and _lies_elsewhere(blend):
                raise scene_yaml.mistake(
                    dataset.scene_name,
                    f"scene.blend: is {blend}; must lie here, for the storage has its copy",
                )

    def _use_copies(self, folder: str) -> None:
        """Make ``folder`` a link to Snakemake's copies. Raise `UserError` if it is something else.

        So programs see all files under the paths that rules and settings have. The function
        `python` of the shell's prefix gives them these paths, too.
        """
        copies = Path(self.copies, folder).absolute()
        copies.mkdir(parents=True, exist_ok=True)
        link = Path(folder)
        if not (link.is_symlink() or link.exists()):
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(copies)
        if link.resolve() != copies.resolve():
            raise UserError(
                f"{folder}: is not a link to {copies}; each run and job with a storage needs a "
                "folder of its own: move the present content away"
            )

    def _use_copies_of_blends(self, run: Run) -> None:
        """Make links to the copies of the users' .blend files, on machines that lack the files.

        The files that a .blend reads then lie where its paths lead to.
        """
        for blend in {d.source.blend for d in run.chosen if d.source.blend}:
            link = Path(blend)
            if not (link.is_symlink() or link.exists()):
                link.parent.mkdir(parents=True, exist_ok=True)
                link.symlink_to(Path(self.copies, blend).absolute())

    # What a rule asks for.

    def bundle_of(self, job: Job) -> str | list[str]:
        return f"{self.receipts}/{job.name}{bundles.SUFFIX}"

    def only_stored(self, files: Any) -> Any:
        return files

    def only_shared(self, files: Any) -> Any:
        return []

    def mark_of_settings(self, wildcards: Any) -> Any:
        ancient, local, *_ = self.run.marks
        text = self.settings_texts[wildcards.path]
        is_same = self.storage.read(wildcards.path) == text.encode()
        return ancient(local(self.mark)) if is_same else local(self.new_mark())

    def _settings_file(self, path: str, content: Content) -> str:
        self.settings_texts[path] = text_of(content)
        return path

    def _inputs(
        self, receipt: str, planned: PlannedJob, wanted: Wanted, settings: Files, are_noted: bool
    ) -> Files:
        return wanted.files | settings | self._carried(wanted.files)

    def _carried(self, files: Files) -> Files:
        """Return the inputs with which the files of a job's inputs reach another machine.

        These are the receipts of the jobs that made the inputs, and their bundles. A job that reads
        only the receipts names its inputs ``receipts`` or ``lists``.
        """
        makers: list[str] = []
        packed: list[str] = []
        for name, each in files.items():
            found = [*filter(None, map(self._maker_of, flat([each])))]
            makers += [receipt for receipt, _ in found]
            if name not in ("receipts", "lists"):
                packed += [receipt for receipt, job in found if job.has_bundle]
        bundled = [path.removesuffix(SUFFIX) + bundles.SUFFIX for path in packed]
        return {"makers": [*dict.fromkeys(makers)], "bundles": [*dict.fromkeys(bundled)]}

    def _maker_of(self, path: str) -> tuple[str, Job] | None:
        """Return the receipt and the record of the job that made a file.

        A receipt stands for itself. None for a file by which no reader knows a job.
        """
        if path not in self._makers:
            self._makers[path] = self._find_maker(path)
        return self._makers[path]

    def _find_maker(self, path: str) -> tuple[str, Job] | None:
        if is_receipt(path):
            return next(
                (path, job) for job in JOBS if self._names(self.receipt_path(job.name), path)
            )
        for job in JOBS:
            names = job.file and self._names(job.file(self.run.paths), path)
            if names and job.is_of_sequence == self._is_of_sequence(names):
                return self.receipt_path(job.name.format(**names)), job
        return None

    def _names(self, pattern: str, path: str) -> Wildcards | None:
        """Return the wildcards of a path. None if it does not match the pattern."""
        found = re.fullmatch(self._expression_of(pattern), path)
        return found.groupdict() if found else None

    def _is_of_sequence(self, names: Wildcards) -> bool:
        """Return whether a file belongs to all frames of a sequence."""
        return "rig" in names and f"{names['scene']}/{names['rig']}" not in self.run.build.datasets

    # What the end of a run says. The storage has all receipts, which nobody looks at again.

    def left_out(self) -> Callable[[str], bool]:
        return lambda receipt: False

    def is_outdated(self, dataset: Dataset) -> bool:
        return False

    def is_valid(self, dataset: Dataset) -> bool:
        """Return True: the checksums that this run made say so."""
        return True

    def shown(self, path: str) -> str:
        return f"{self.url}/{path}"

    def find_log(self, shown: str) -> Path:
        """Return the file of a log that Snakemake names. The storage has logs of other machines."""
        name = shown.removeprefix(f"{self.url}/")
        self.storage.bring(name)
        return Path(name)

    def verify_command(self, wildcards: HasWildcards) -> str:
        """Return the command that takes the finished datasets: no list has the sums of others."""
        run = self.run
        homes = [dataset.paths for dataset in run.chosen]
        homes += [d.sequence_paths for d in run.chosen if d.sequence_exports]
        folders = shlex.join(
            paths.folder
            for paths in dict.fromkeys(homes)
            if Path(paths.sums).name in self.storage.names(paths.folder)
        )
        take = f"python {run.scripts}/take_dataset.py --store {shlex.quote(self.url)}"
        return f"{take} --work {run.work} {folders}" if folders else ":"

    def former_places(self, family: str) -> list[str]:
        """Return nothing: the bundle of a batch has its present members alone."""
        return []

    def prune_command(self, wildcards: HasWildcards) -> str:
        return "echo 'nothing to remove: a storage has only present members'"

    def check_provider(self, path: str) -> None:
        """End the run if Snakemake has no storage, as its ``path`` of an output tells."""
        if self.run.is_main and not is_in_storage(path):
            sys.exit(
                "error: storage: Snakemake has no storage: add --default-storage-provider "
                f"and --default-storage-prefix {self.url}"
            )


def _lies_elsewhere(path: str) -> bool:
    """Return whether a path leads out of this folder."""
    return Path(path).is_absolute() or ".." in Path(path).parts
