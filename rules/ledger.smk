# Detects damaged and outdated files, by the ledger of finished jobs.
import logging
import os
import re
import sys
import time
from functools import cache
from pathlib import Path

from snakemake_interface_logger_plugins.common import LogEvent

from lightfield.configuration.family import outdated_members
from lightfield.core.errors import UserError
from lightfield.core.files import (
    read_json,
    set_aside,
    sha256,
    unreadable,
    write_json_if_changed,
)
from lightfield.formats.export_lists import MANIFEST
from lightfield.stages import job_settings
from lightfield.workflow import ledger, presence
from lightfield.workflow.shard_files import JOURNAL_SUFFIX, LOG_SUFFIX
from lightfield.workflow.view_store import ViewStore

# The records of the present shards. Records of shards with other bounds are obsolete.
SHARD_RECORDS = {file for d in DATASETS.values() for file in d.all_records}


def is_current(output):
    """Return whether an output belongs to a job that these settings may still need."""
    is_record = re.fullmatch(r"\d+-\d+\.json", Path(output).name)
    return output in SHARD_RECORDS or not is_record


@cache
def finished_work():
    """Return the ledger of finished jobs."""
    if STORE:
        ViewStore(STORE).bring(LEDGER)
    return ledger.Ledger(Path(LEDGER), is_current)


def settings_file(path, content):
    """Write settings as JSON if the file has another text. Return the file as an input."""
    try:
        if STORE:
            store_settings(path, content)
        else:
            clear_folder(path)
            if write_json_if_changed(Path(path), content):
                restore_time(path)
            tell_of_new_file(path)
    except UserError as error:
        sys.exit(f"error: {error}")
    return path


def store_settings(path, content):
    """Write settings, and send them to the storage if it has others, or none.

    A killed run may have written them here without sending them.
    """
    store = ViewStore(STORE)
    in_storage = store.bring(path)
    changed = write_json_if_changed(Path(path), content)
    if IS_MAIN_PROCESS and (changed or not in_storage):
        store.send(path)


def clear_folder(path):
    """Move a folder aside that is in the place of a file to write."""
    if os.path.isdir(path):
        set_aside(Path(path), Path(REMOVED))


def restore_time(path):
    """Give settings that jobs have read before the time that the file had then.

    So the outputs of these jobs are not older than their settings. The ledger detects outputs that
    were made from other settings since.
    """
    time = finished_work().last_read(path, sha256(path))
    if time:
        os.utime(path, ns=(time, time))


def settings(stage):
    """Return the input function for the settings file of a stage's job."""

    def input_function(wildcards):
        mark_stale_files_of(wildcards)
        path, content = asked(
            lambda names: job_settings.settings_file(stage, BUILD, names), wildcards
        )
        return settings_file(path, content)

    return input_function


def mark_stale_files_of(wildcards):
    """Mark the stale files of a job's dataset, or the stale record of a batch of members."""
    names = dict(wildcards.items())
    if "batch" in names:
        mark_stale_batch(names["family"], names["batch"])
    elif "name" in names:
        mark_stale_files(asked(BUILD.scene, wildcards).name)
    elif "rig" in names:
        mark_stale_files(f"{names['scene']}/{names['rig']}")
    elif "scene" in names:
        mark_stale_files(BUILD.first_of_scene(names["scene"]).name)


def mark_stale_batch(folder, batch):
    """Mark a batch whose members are outdated. With a storage, the members are not here."""
    if IS_MAIN_PROCESS:
        mark_noted_files()
        record = BUILD.batch_record(folder, batch)
        if not STORE and outdated_members(Path(record), Path(RESULTS, folder)):
            rerun([record])


# For each damaged path: what is wrong with it, and the outputs of the jobs that make it again.
DAMAGED = {}
take_as_missing(DAMAGED.__contains__)


@cache
def mark_noted_files():
    """Mark the damaged and outdated files of the ledger."""
    DAMAGED.update(finished_work().damage)
    for _, outputs in DAMAGED.values():
        rerun(outputs)
    for outputs in finished_work().replaced.values():
        rerun(outputs)
    before_jobs_are_chosen(mark_outdated_files)


def mark_outdated_files():
    """Mark the files that were made from other inputs, or from other content of their inputs."""
    finished = finished_work()
    rerun(finished.outdated_outputs())
    for job in all_jobs():
        inputs = set(read_files(job))
        for output in map(unstored, job.output):
            # With a storage, inputs may not be here when they are noted.
            if finished.has_other_inputs(output, inputs, may_lack=bool(STORE)):
                rerun([output])


@cache
def mark_stale_files(name):
    """Mark damaged and outdated files, so that Snakemake rebuilds them.

    A dataset's files that the ledger does not have are among them.
    """
    if not IS_MAIN_PROCESS or name not in DATASETS:
        return
    mark_noted_files()
    dataset = DATASETS[name]
    files = [*dataset.files, *dataset.intermediates]
    jobs = finished_work()
    rerun(file for file in files if file not in jobs and os.path.lexists(file))
    rerun(presence.outgrown_records(dataset))
    if presence.external_changed(dataset, ViewStore(STORE) if STORE else None):
        rerun([dataset.inventory])
    if presence.model_changed(dataset):
        rerun([dataset.blend])
    if dataset.source.blend and dataset.source.sha256 is None:
        # Its lock file is missing.
        rerun([dataset.blend_check])
    for path, problem in presence.broken_files(dataset):
        DAMAGED.setdefault(path, (problem, files))


def damage_to_mend():
    """Return what is wrong with each damaged file that this run makes again, by path.

    An unreadable ledger is among them, and unreadable logs and benchmarks of this run's jobs.
    """
    jobs = needed_jobs()
    outputs_of_run = {unstored(file) for job in jobs for file in job.output}
    damage = {}
    for path, (problem, outputs) in DAMAGED.items():
        if not outputs_of_run.isdisjoint(outputs):
            damage[path] = problem
    notes = [LEDGER]
    for job in jobs:
        notes += [file for file in (*job.log, job.benchmark) if file]
    for path in notes:
        if problem := unreadable(path):
            damage[str(path)] = problem
    return dict(sorted(damage.items()))


def announce_damage():
    """Say which damaged files this run makes again."""
    for path, problem in damage_to_mend().items():
        print(f"{path}: {problem}; it is made anew", file=sys.stderr)


def set_damage_aside():
    """Move the damaged files that this run makes again to the folder of removed files."""
    for path in damage_to_mend():
        if os.path.lexists(path):
            set_aside(Path(path), Path(REMOVED))
        DAMAGED.pop(path, None)


def listed_files(job):
    """Return the files that a job wrote beside its outputs, with their SHA-256 if it is noted.

    A shard's record, or the list of an export, names them.
    """
    files = {}
    for output in map(Path, job.output):
        if output.suffix != ".json":
            continue
        content = read_json(output)
        listed = content.get("files") if isinstance(content, dict) else None
        if isinstance(listed, dict):
            is_record = output.name != MANIFEST
            folder = (
                asked(BUILD.dataset, job.wildcards).paths.folder
                if is_record
                else output.parent
            )
            for name, entry in listed.items():
                digest = entry["sha256"] if is_record else entry
                files[os.path.normpath(f"{folder}/{name}")] = digest
        elif output.name == "transforms.json":
            files |= dict.fromkeys(map(str, beside_transforms(output, content)))
    return files


def beside_transforms(output, content):
    """Return the files that the export for instant-ngp may have written beside transforms.json."""
    folder = output.parent
    yield from folder.glob("transforms_*.json")
    for frame in content["frames"]:
        image = folder / frame["file_path"]
        yield image.with_name(f"dynamic_mask_{image.stem}.png")
        if image.parent.name == "instant_ngp":
            yield image
        if "depth_path" in frame:
            yield folder / frame["depth_path"]


def history_of(job):
    """Return the files of a job that only grow: a shard's journal and log, and its benchmark."""
    files = [str(job.benchmark)] if job.benchmark else []
    for output in map(Path, job.output):
        # These may not exist. Listing a folder of thousands of shards would take long.
        for suffix in (JOURNAL_SUFFIX, LOG_SUFFIX):
            files.append(str(output.with_suffix(suffix)))
    return files


class JobNotes(logging.Handler):
    """Notes each job in the ledger: its inputs when it starts, and its outputs when it has finished.

    Snakemake logs the start of jobs, even with --quiet. At each start, this notes the jobs that
    have finished since.
    """

    def __init__(self, jobs):
        super().__init__()
        self.unfinished = {job.jobid: job for job in jobs if job.output}
        # Snakemake does not log the start of the jobs in a group.
        self.grouped = {number for number, job in self.unfinished.items() if job.group}
        # The stamps of the inputs of started jobs.
        self.inputs = {}
        self.next_sending = 0.0

    def emit(self, record):
        if getattr(record, "event", None) is not LogEvent.JOB_STARTED:
            return
        try:
            self.note_finished({*self.inputs, *self.grouped})
        except UserError as error:
            # The next run makes files again that are not noted.
            print(f"warning: {error}", file=sys.stderr)
        for number in record.jobs:
            if number in self.unfinished:
                self.inputs[number] = read_stamps(self.unfinished[number])

    def note_finished(self, numbers):
        """Note the unfinished jobs with these numbers that have finished since."""
        finished_numbers = [n for n in numbers if is_finished(self.unfinished[n])]
        for number in finished_numbers:
            job = self.unfinished.pop(number)
            self.grouped.discard(number)
            stamps = self.inputs.pop(number, None) or read_stamps(job)
            finished_work().note(line_of(job, stamps))
        if finished_numbers and STORE and time.monotonic() > self.next_sending:
            self.send()

    def send(self):
        """Send the ledger to the storage, and not again before 20 times as long has passed.

        The ledger grows with the number of jobs.
        """
        began = time.monotonic()
        ViewStore(STORE).send(LEDGER)
        self.next_sending = began + 20 * (time.monotonic() - began)


def read_files(job):
    """Return the paths of the files that a job reads."""
    return [unstored(file) for file in job.input]


def read_stamps(job):
    """Return the stamps of the files that a job reads."""
    return finished_work().input_stamps(read_files(job))


def stamps(digests):
    """Return the stamps of files that exist. ``digests`` has their SHA-256, or None."""
    return {
        name: ledger.Stamp.of(name, digest)
        for name, digest in digests.items()
        if os.path.isfile(name)
    }


def line_of(job, inputs):
    """Return the line of the ledger for a finished job."""
    outputs = [unstored(file) for file in job.output]
    if STORE:
        # The storage has the job's files.
        return ledger.Job(outputs, {}, {}, inputs)
    files = stamps(dict.fromkeys(outputs) | listed_files(job))
    return ledger.Job(outputs, files, stamps(dict.fromkeys(history_of(job))), inputs)


# The notes of this run, while there is one.
NOTES = []


def begin_notes():
    """Note the jobs of this run in the ledger, from now on."""
    jobs = finished_work()
    jobs.refresh()
    if jobs.is_cluttered:
        jobs.compact()
    NOTES.append(JobNotes(needed_jobs()))
    logging.getLogger("snakemake.logging").addHandler(NOTES[0])


def end_notes():
    """Note the jobs that have finished last."""
    for notes in NOTES:
        try:
            notes.note_finished([*notes.unfinished])
            if STORE and Path(LEDGER).exists():
                notes.send()
        except UserError as error:
            print(f"warning: {error}", file=sys.stderr)
