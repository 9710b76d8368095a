"""Builds one member of a family, and writes its record, results/<family>/<member>/member.json."""

import hashlib
import json
import os
import sys
import time
import traceback
from collections.abc import Collection, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

from lightfield.configuration import scene_yaml
from lightfield.configuration.config_file import Configuration
from lightfield.configuration.dataset import Dataset
from lightfield.configuration.family import FORMAT, RECEIPT, RECORD, Member, drawn, member_content
from lightfield.configuration.scene_checks.rigs import MOST_VIEWS
from lightfield.configuration.scene_yaml import Scene
from lightfield.core import leftovers
from lightfield.core.disk_space import check_folder
from lightfield.core.errors import LESS_MEMORY, OutsideError, UserError, is_outside
from lightfield.core.files import DAMAGE, set_aside, sha256, write_json
from lightfield.engine import receipts
from lightfield.engine.receipts import OpenReceipt
from lightfield.family.run import MemberRun
from lightfield.formats.layout import SUMS, read_sums
from lightfield.geometry.rigs import Poses
from lightfield.planning.loading import datasets_of
from lightfield.rendering.models import model_files
from lightfield.stages.family import BatchSettings, BuildMembers
from lightfield.stages.views import Device
from lightfield.workflow.build import Build
from lightfield.workflow.member_record import BUILT, read_member

# What a member is made of does not depend on these keys of a scene YAML.
_DESCRIPTIVE_KEYS = ("description", "licence", "credit", "publish", "report")


class _DamagedFilesError(OutsideError):
    """Files of a member were damaged or removed while it was built."""


class MemberBuild:
    """One member of a batch: where its files lie, what it is made from, its receipt and record.

    A member that was built has a receipt, whether it is valid or failed.
    """

    def __init__(self, settings: BatchSettings, member: Member) -> None:
        self.settings = settings
        self.member = member
        place = settings.folder_of(member)
        self.folder = Path(settings.results, place)
        self.work = Path(settings.work, place)
        self.receipt = Path(settings.work, receipts.FOLDER, place, f"{RECEIPT}{receipts.SUFFIX}")
        self.record = self.folder / RECORD
        self.log = self.work / "member.log"
        self.values = drawn(settings.values, member)
        self.content = member_content(settings.scene, member, self.values)
        # The settings in the receipt: all that the member is made from, but for files.
        self.made_from = {
            "scene": {k: v for k, v in self.content.items() if k not in _DESCRIPTIVE_KEYS},
            "limits": settings.limits.as_json(),
            "fingerprint": settings.fingerprint,
            "bpy": version("bpy"),
        }

    def is_finished(self) -> bool:
        """Return whether the member is valid, intact, and made from the present settings."""
        with self._opened_receipt() as receipt:
            if not receipt.still_holds() or not self._is_valid():
                return False
            receipt.keep()
            return True

    def build(self, device: Device, threads: int) -> dict[str, Any]:
        """Make the member's datasets, and return and write its record.

        A failure of the member is in the record, and the traceback in the log. Raises an error for
        which `is_outside` holds if its cause is no property of the member.
        """
        try:
            return self._build(device, threads)
        except _DamagedFilesError as error:
            print(f"warning: {error}", file=sys.stderr, flush=True)
            # They are made again. Twice in a row is no accident.
            return self._build(device, threads)

    def _build(self, device: Device, threads: int) -> dict[str, Any]:
        run = MemberRun()
        began, cpu_began = time.time(), time.process_time()
        with self._opened_receipt() as receipt, _output_to(self.log):
            # From now on the member is neither valid nor failed.
            self.record.unlink(missing_ok=True)
            # Stages believe the size and the time of a file.
            receipt.set_all_damaged_aside()
            try:
                written = self._written()
                self._check_files(written)
                rigs = written.rigs.values()
                receipts.note_inputs(rig.file for rig in rigs if isinstance(rig, Poses))
                datasets = self._datasets(written)
                run.run(self._build_of(datasets), device, threads)
                entries = {dataset.rig_folder: _listing(dataset) for dataset in datasets}
                receipt.check_inputs()
                record = self._write({"state": "valid", "datasets": entries})
            except (Exception, SystemExit) as error:
                traceback.print_exc()
                self._raise_outside_cause(error, receipt)
                record = self._fail(receipt, run.stage, cause_of(error))
            now = time.time()
            receipt.log(
                {
                    BUILT: round(now, 3),
                    "seconds": round(now - began, 3),
                    "cpu_seconds": round(time.process_time() - cpu_began, 3),
                    "stage_cpu_seconds": run.seconds,
                }
            )
            receipt.seal()
        return record

    def _raise_outside_cause(self, error: BaseException, receipt: OpenReceipt) -> None:
        """Raise an error if something outside the member may be the cause of a stage's ``error``.

        So it is if the machine refused something, or if files are missing, damaged or changed.
        """
        if damaged_files := receipt.set_all_damaged_aside():
            raise _DamagedFilesError(
                f"{damaged_files[0]}: was damaged or removed while {self.member.name} was built; "
                "it is made again"
            ) from error
        if is_outside(error):
            raise error
        for folder in (self.folder, self.work):
            check_folder(folder)
        receipt.check_inputs()

    def note_death(self, cause: str) -> None:
        """Write the record of a member at which a process died. Keep what is whole."""
        with self._opened_receipt() as receipt:
            if self.member.model:
                model = Path(self.member.model)
                receipts.note_inputs([model])
                with suppress(UserError):
                    light_file = self._written().scene.light_file
                    receipts.note_inputs([light_file] if light_file else [])
                with suppress(UserError, OSError, *DAMAGE):
                    references = model_files.survey(model).references
                    receipts.note_inputs(reference.path for reference in references)
            self._fail(receipt, self._last_stage(), cause)
            # What it took died with the process.
            receipt.log({BUILT: round(time.time(), 3)})
            receipt.seal()

    def _opened_receipt(self) -> AbstractContextManager[OpenReceipt]:
        header = {
            "stage": BuildMembers.name,
            "version": BuildMembers.version,
            "settings": self.made_from,
        }
        return receipts.opened(self.receipt, header, [self.folder])

    def _is_valid(self) -> bool:
        try:
            return read_member(self.folder).is_valid
        except UserError:
            return False

    def _written(self) -> Scene:
        """Return the member's scene YAML as settings. Raises `UserError` for a wrong value."""
        file = f"{scene_yaml.OWN_SCENES}/{self.settings.family}.yaml: member {self.member.name}"
        return scene_yaml.check_member(self.content, file)

    def _check_files(self, written: Scene) -> None:
        """Raise `OutsideError` if a file that the scene YAML names has gone since the plan."""
        poses = [rig.file for rig in written.rigs.values() if isinstance(rig, Poses)]
        for name in filter(None, [self.member.model, written.scene.light_file, *poses]):
            if not Path(name).exists():
                raise OutsideError(f"{name}: there is no such file any more; put it back")

    def _datasets(self, written: Scene) -> list[Dataset]:
        fields = {
            "results_root": self.settings.results,
            "work_root": self.settings.work,
            # One shard has all views.
            "views_per_shard": MOST_VIEWS,
            "member": self.member.name,
        }
        settings = self.settings
        return datasets_of(settings.family, written, settings.preset, settings.limits, fields)

    def _build_of(self, datasets: list[Dataset]) -> Build:
        """Return the build of the member's ``datasets``."""
        settings = self.settings
        config = Configuration(
            scenes=[settings.family],
            preset=settings.preset,
            presets={settings.preset: settings.limits},
            results=settings.results,
            work=settings.work,
        )
        return Build(config, datasets, {dataset.name: dataset for dataset in datasets}, {}, {})

    def _fail(self, receipt: OpenReceipt, stage: str, cause: str) -> dict[str, Any]:
        """Write and return the record of a failed member.

        Keeps the files that have the bytes with which they were made, so that a later run need not
        make them again. Moves all others to work/removed, and lists of sums, which say that a
        dataset is finished.
        """
        leftovers.remove_unfinished(self.folder, age=0)
        receipt.keep_intact_files()
        kept = [Path(name) for name in receipt.outputs if Path(name).name != SUMS]
        kept_paths = {path for file in kept for path in (file, *file.parents)}
        _set_others_aside(self.folder, kept_paths, receipt.work / receipts.REMOVED)
        failure = {"stage": stage, "cause": cause, "log": str(self.log)}
        return self._write({"state": "failed", "datasets": {}, "failure": failure})

    def _write(self, outcome: Mapping[str, Any]) -> dict[str, Any]:
        member = self.member
        record: dict[str, Any] = {"format": FORMAT, "name": member.name, "key": self._key()}
        if member.model is None:
            record["seed"] = member.seed
        else:
            record["model"] = member.model
        record |= {"values": self.values, **outcome}
        write_json(self.record, record)
        return record

    def _key(self) -> str:
        """Return the SHA-256 of everything that the member is made from."""
        receipt = receipts.current()
        assert receipt
        files = sorted(receipt.inputs, key=Path) if self.member.model else ()
        folder = Path(self.member.model or "").parent
        model_sums = [
            (Path(os.path.relpath(file, folder)).as_posix(), receipt.inputs[file]) for file in files
        ]
        content = [BuildMembers.version, *self.made_from.values(), model_sums]
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def _last_stage(self) -> str:
        """Return the stage at which a process was that died, by the member's log.

        Without a common folder, the log of a process on another node is lost: "unknown".
        """
        try:
            lines = self.log.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            return "unknown"
        stages = [line.partition(": ")[2] for line in lines if line.startswith("stage: ")]
        return stages[-1] if stages else "settings"


def _listing(dataset: Dataset) -> dict[str, Any]:
    """Return what the record of a member says of a valid dataset."""
    folder = Path(dataset.paths.folder)
    sums = folder / SUMS
    split = dataset.rig.split
    size = sum((folder / name).stat().st_size for name in read_sums(sums))
    return {
        "views": dataset.view_count,
        "bytes": size + sums.stat().st_size,
        "split": split if isinstance(split, str | None) else "chosen",
        "sha256sums": sha256(sums),
    }


def _set_others_aside(folder: Path, kept: Collection[Path], removed: Path) -> None:
    """Move what is in a folder into ``removed``, but for the ``kept`` files and their folders.

    Moves a link itself. Leaves what a link leads to, because the folder there may be of other use.
    """
    for entry in sorted(folder.iterdir()) if folder.is_dir() else ():
        path = Path(receipts.name_of(entry))
        if path not in kept:
            print(f"{path}: was moved to {set_aside(entry, removed)}", flush=True)
        elif not entry.is_symlink():
            _set_others_aside(entry, kept, removed)


def cause_of(error: BaseException) -> str:
    """Return why a stage failed, in one line."""
    if isinstance(error, MemoryError):
        return f"out of memory: {LESS_MEMORY}"
    text = " ".join(str(error).split()).removeprefix("error: ")
    if isinstance(error, UserError | SystemExit):
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


@contextmanager
def _output_to(log: Path) -> Iterator[None]:
    """Send what this process and its libraries print to a log."""
    log.parent.mkdir(parents=True, exist_ok=True)
    sys.stdout.flush()
    sys.stderr.flush()
    saved = [os.dup(1), os.dup(2)]
    with log.open("wb") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    try:
        yield
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        for number, descriptor in enumerate(saved, 1):
            os.dup2(descriptor, number)
            os.close(descriptor)
