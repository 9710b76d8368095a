"""Builds one member of a family, and writes its record, results/<family>/<member>/member.json."""

import hashlib
import json
import os
import shutil
import sys
import traceback
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

from lightfield.configuration import scene_yaml
from lightfield.configuration.dataset import Dataset
from lightfield.configuration.family import FORMAT, RECORD, Member, drawn, member_content
from lightfield.configuration.scene_yaml import Scene
from lightfield.core import receipts
from lightfield.core.disk_space import obstacle
from lightfield.core.errors import LESS_MEMORY, UserError
from lightfield.core.files import DAMAGE, sha256, write_json
from lightfield.core.receipts import OpenReceipt
from lightfield.family.stages import StageRun, jobs_of
from lightfield.formats.layout import SUMS, read_sums
from lightfield.geometry.rigs import Poses
from lightfield.rendering import model_files
from lightfield.stages.family import BatchSettings, BuildMembers
from lightfield.stages.views import Device
from lightfield.workflow.loading import datasets_of
from lightfield.workflow.member_record import read_member

# What a member is made of does not depend on these keys of a scene YAML.
_DESCRIPTIVE_KEYS = ("description", "licence", "credit", "publish", "report")


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
        self.receipt = Path(settings.work, receipts.FOLDER, place, f"member{receipts.SUFFIX}")
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

        A failure is in the record, and the traceback in the log. Raises `UserError` only if
        nothing can be written.
        """
        run = StageRun()
        with self._opened_receipt() as receipt, _output_to(self.log):
            # From now on the member is neither valid nor failed.
            self.record.unlink(missing_ok=True)
            try:
                written = self._written()
                rigs = written.rigs.values()
                receipts.note_inputs(rig.file for rig in rigs if isinstance(rig, Poses))
                datasets = self._datasets(written)
                scene = f"{self.settings.family}/{self.member.name}"
                work = self.settings.work
                run.run(jobs_of(datasets, written, scene, work, device, threads))
                write_json(self.work / "cpu_seconds.json", run.seconds)
                entries = {dataset.rig_folder: _listing(dataset) for dataset in datasets}
                record = self._write({"state": "valid", "datasets": entries})
            except (Exception, SystemExit) as error:
                traceback.print_exc()
                if problem := obstacle(self.folder) or obstacle(self.work):
                    raise UserError(f"{self.folder}: cannot be written: {problem}") from None
                record = self._fail(run.stage, _cause(error))
            receipt.seal()
        return record

    def note_death(self, cause: str) -> None:
        """Write the record of a member at which a process died. Remove what is half-written."""
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
            self._fail(self._last_stage(), cause)
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

    def _datasets(self, written: Scene) -> list[Dataset]:
        fields = {
            "results_root": self.settings.results,
            "work_root": self.settings.work,
            # One shard has all views.
            "views_per_shard": scene_yaml.MOST_VIEWS,
            "member": self.member.name,
        }
        settings = self.settings
        return datasets_of(settings.family, written, settings.preset, settings.limits, fields)

    def _fail(self, stage: str, cause: str) -> dict[str, Any]:
        """Write and return the record of a failed member. Removes what is half-written of it."""
        if stage != "validate":
            for entry in self.folder.iterdir() if self.folder.is_dir() else ():
                # What a user's link leads to stays.
                is_folder = entry.is_dir() and not entry.is_symlink()
                shutil.rmtree(entry) if is_folder else entry.unlink()
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


def _cause(error: BaseException) -> str:
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
