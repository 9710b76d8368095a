"""Builds one member of a family, and writes its record, results/<family>/<member>/member.json."""

import hashlib
import json
import os
import shutil
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

from lightfield.configuration import scene_yaml
from lightfield.configuration.dataset import Dataset
from lightfield.configuration.family import FORMAT, RECORD, SOURCES, Member, drawn, member_content
from lightfield.configuration.scene_yaml import Scene
from lightfield.core.disk_space import obstacle
from lightfield.core.errors import LESS_MEMORY, UserError
from lightfield.core.files import DAMAGE, listed, read_json, sha256, size_and_time, write_json
from lightfield.core.names import SPLITS
from lightfield.family.stages import Run, jobs_of
from lightfield.formats.layout import SUMS, read_sums
from lightfield.formats.lightfield import LightField
from lightfield.formats.splits_file import splits_content
from lightfield.rendering import model_files
from lightfield.stages.family import BatchSettings, BuildMembers
from lightfield.stages.views import Device
from lightfield.workflow.loading import datasets_of
from lightfield.workflow.view_store import ViewStore

# What a member is made of does not depend on these keys of a scene YAML.
_DESCRIPTIVE_KEYS = ("description", "licence", "credit", "publish", "report")


class MemberBuild:
    """One member of a batch: where its files lie, what it is made from, and its record."""

    def __init__(self, settings: BatchSettings, member: Member) -> None:
        self.settings = settings
        self.member = member
        is_full = settings.preset == "full"
        family = settings.family if is_full else f"{settings.family}_{settings.preset}"
        self.folder = Path(settings.results, family, member.name)
        self.work = Path(settings.work, family, member.name)
        self.record = self.folder / RECORD
        self.log = self.work / "member.log"
        self.values = drawn(settings.values, member)
        self.store = ViewStore.configured()
        self.content = member_content(settings.scene, member, self.values)

    def _written(self) -> Scene:
        """Return the member's scene YAML as settings. Raises `UserError` for a wrong value."""
        file = f"{scene_yaml.OWN_SCENES}/{self.settings.family}.yaml: member {self.member.name}"
        return scene_yaml.check_member(self.content, file)

    def _datasets(self, written: Scene) -> list[Dataset]:
        places = {
            "results_root": self.settings.results,
            "work_root": self.settings.work,
            # One shard has all views.
            "views_per_shard": scene_yaml.MOST_VIEWS,
            "member": self.member.name,
        }
        settings = self.settings
        return datasets_of(settings.family, written, settings.preset, settings.limits, places)

    def key(self, model_sums: Sequence[tuple[str, str | None]]) -> str:
        """Return the SHA-256 of everything that the member is made from.

        ``model_sums`` are the path and SHA-256 of each file that its model was read from.
        """
        content = [
            BuildMembers.version,
            {k: v for k, v in self.content.items() if k not in _DESCRIPTIVE_KEYS},
            self.settings.limits.as_json(),
            self.settings.fingerprint,
            version("bpy"),
            list(model_sums),
        ]
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def _present_model_sums(self) -> list[tuple[str, str | None]]:
        """Return the sums of `key` as the model's files are now."""
        return [(str(entry["path"]), _sum(self._file(entry))) for entry in self._sources()]

    def _file(self, entry: Mapping[str, Any]) -> Path:
        """Return the path of an entry of `_sources`."""
        return Path(os.path.normpath(Path(str(self.member.model)).parent / entry["path"]))

    def _sources(self) -> list[dict[str, Any]]:
        """Return the files that the member's model was last read from, as `listed` lists them.

        Before the first import, these are the files that it is known to refer to.
        """
        with suppress(UserError, *DAMAGE):
            return list(read_json(self.work / SOURCES)["files"])
        return self._known_sources()

    def _known_sources(self) -> list[dict[str, Any]]:
        """List the files that the model is known to refer to, as they are now.

        The import may find more.
        """
        if self.member.model is None:
            return []
        path = Path(self.member.model)
        files = {path}
        with suppress(UserError, OSError, *DAMAGE):
            files.update(named.path for named in model_files.survey(path).references)
        names = sorted(Path(os.path.relpath(file)) for file in files)
        return [listed(file, path.parent) for file in names]

    def source_stamps(self) -> dict[str, tuple[int, int] | None]:
        """Return the size and time of each file that the model was read from, by its path.

        If the file has another content now, these are those of the content that was read.
        """
        stamps = {}
        for entry in self._sources():
            path = self._file(entry)
            stamp = size_and_time(path)
            as_read = (entry["bytes"], entry["mtime_ns"]) if entry["sha256"] else None
            if stamp != as_read and _sum(path) != entry["sha256"]:
                stamp = as_read
            stamps[path.as_posix()] = stamp
        return stamps

    def is_finished(self) -> bool:
        """Return whether the member is valid, of the present settings, and has its bytes.

        Of files in a storage, only the checksums and the names are compared.
        """
        if self.store:
            self.store.bring(str(self.record))
        try:
            record = read_json(self.record)
            if record["state"] != "valid" or record["key"] != self.key(self._present_model_sums()):
                return False
            if not self._has_splits(record["datasets"]):
                return False
            has_bytes = self._has_stored_files if self.store else _has_its_bytes
            return all(
                has_bytes(self.folder / rig, entry["sha256sums"])
                for rig, entry in record["datasets"].items()
            )
        except (UserError, OSError, *DAMAGE):
            return False

    def _has_splits(self, datasets: Mapping[str, Any]) -> bool:
        """Return whether the member's splits.json is that of its rigs. Some have no split."""
        rigs = [rig for rig, entry in datasets.items() if entry["split"] is not None]
        if not rigs:
            return True
        if self.store:
            return SPLITS in self.store.names(str(self.folder))
        lightfields = {rig: LightField.read(self.folder / rig / "lightfield.json") for rig in rigs}
        return bool(read_json(self.folder / SPLITS) == splits_content(lightfields))

    def _has_stored_files(self, folder: Path, digest: str) -> bool:
        """Return whether the storage has a dataset's checksums, and all files that they name."""
        assert self.store
        sums = folder / SUMS
        if not self.store.bring(str(sums)) or sha256(sums) != digest:
            return False
        names: dict[str, set[str]] = {}
        for name in read_sums(sums):
            path = folder / name
            names.setdefault(str(path.parent), set()).add(path.name)
        return all(expected <= {*self.store.names(path)} for path, expected in names.items())

    def build(self, device: Device, threads: int) -> dict[str, Any]:
        """Make the member's datasets, and return and write its record.

        A failure is in the record, and the traceback in the log. Raises `UserError` only if
        nothing can be written.
        """
        # From now on the member is neither valid nor failed.
        self.record.unlink(missing_ok=True)
        (self.work / "model.json").unlink(missing_ok=True)
        if self.store:
            self.store.remove(str(self.record))
        run = Run()
        with _output_to(self.log):
            try:
                written = self._written()
                datasets = self._datasets(written)
                self._remove_sums(datasets)
                if self.member.model:
                    # List the files before they are read, because they may change meanwhile.
                    write_json(self.work / SOURCES, {"files": self._known_sources()})
                scene = f"{self.settings.family}/{self.member.name}"
                work = self.settings.work
                run.run(jobs_of(datasets, written, scene, work, device, threads))
            except (Exception, SystemExit) as error:
                traceback.print_exc()
                if problem := obstacle(self.folder) or obstacle(self.work):
                    raise UserError(f"{self.folder}: cannot be written: {problem}") from None
                return self.fail(run.stage, _cause(error))
        write_json(self.work / "cpu_seconds.json", run.seconds)
        entries = {dataset.rig_folder: _listing(dataset) for dataset in datasets}
        return self._write({"state": "valid", "datasets": entries})

    def _remove_sums(self, datasets: list[Dataset]) -> None:
        """Remove the checksums of earlier datasets. A dataset without them is not valid."""
        for dataset in datasets:
            Path(dataset.paths.sums).unlink(missing_ok=True)

    def fail(self, stage: str, cause: str) -> dict[str, Any]:
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
        model_sums = [(str(entry["path"]), entry["sha256"]) for entry in self._sources()]
        key = self.key(model_sums)
        record: dict[str, Any] = {"format": FORMAT, "name": member.name, "key": key}
        if member.model is None:
            record["seed"] = member.seed
        else:
            record["model"] = member.model
        record |= {"values": self.values, **outcome}
        write_json(self.record, record)
        if self.store:
            self._send(record)
        return record

    def _send(self, record: Mapping[str, Any]) -> None:
        """Put the member's files into the storage, each under its path, and the record last.

        Of a failed member, this is its log, which the record names.
        """
        assert self.store
        if record["state"] == "failed" and self.log.is_file():
            # This process may still write to it.
            sys.stdout.flush()
            self.store.send(str(self.log))
        for rig in record["datasets"]:
            sums = self.folder / rig / SUMS
            for name in read_sums(sums):
                self.store.send(str(self.folder / rig / name))
            self.store.send(str(sums))
        if record["datasets"] and (self.folder / SPLITS).is_file():
            self.store.send(str(self.folder / SPLITS))
        self.store.send(str(self.record))

    def last_stage(self) -> str:
        """Return the stage at which a process was that died, by the member's log.

        Without a common folder, the log of a process on another node is lost: "unknown".
        """
        try:
            lines = self.log.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            return "unknown"
        stages = [line.partition(": ")[2] for line in lines if line.startswith("stage: ")]
        return stages[-1] if stages else "settings"


def _sum(path: Path) -> str | None:
    """Return the SHA-256 of a file. None if there is no file."""
    return sha256(path) if path.is_file() else None


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


def _has_its_bytes(folder: Path, digest: str) -> bool:
    """Return whether a dataset's checksums have this SHA-256, and its files these checksums."""
    sums = folder / SUMS
    if sha256(sums) != digest:
        return False
    return all(sha256(folder / name) == expected for name, expected in read_sums(sums).items())


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
