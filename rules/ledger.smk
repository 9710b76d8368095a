# Which files are damaged or were made from something else, by the ledger of finished jobs.
import logging

from snakemake_interface_logger_plugins.common import LogEvent

from lightfield.core.files import (
    read_json,
    set_aside,
    sha256,
    unreadable,
    write_json_if_changed,
)
from lightfield.dataset.shard_files import JOURNAL_SUFFIX, LOG_SUFFIX

# What shards of other bounds have made is nobody's any more.
SHARD_RECORDS = {file for d in DATASETS.values() for file in d.all_records}


def is_current(output):
    """Return whether an output is of a job that these settings may still ask for."""
    is_record = re.fullmatch(r"\d+-\d+\.json", Path(output).name)
    return output in SHARD_RECORDS or not is_record


@cache
def finished_work():
    """Return the ledger of what finished jobs made."""
    if STORE:
        ViewStore(STORE).bring(LEDGER)
    return ledger.Ledger(Path(LEDGER), is_current)


def settings_file(path, content):
    """Write settings as JSON where the file has another text; return it as an input."""
    try:
        if STORE:
            store_settings(path, content)
        else:
            clear_folder(path)
            if write_json_if_changed(Path(path), content):
                restore_time(path)
    except UserError as error:
        sys.exit(f"error: {error}")
    return path


def store_settings(path, content):
    """Write settings, and send them where the storage has others, or none.

    A run that was killed may have written them here, and not sent them.
    """
    store = ViewStore(STORE)
    in_storage = store.bring(path)
    changed = write_json_if_changed(Path(path), content)
    if IS_MAIN_PROCESS and (changed or not in_storage):
        store.send(path)


def clear_folder(path):
    """Move a folder aside that lies where a file is to be written."""
    if os.path.isdir(path):
        set_aside(Path(path), Path(REMOVED))


def restore_time(path):
    """Give settings with which jobs have run before the time that they had then.

    They are no newer than what these jobs made. What was made from others since, the ledger knows.
    """
    time = finished_work().last_read(path, sha256(path))
    if time:
        os.utime(path, ns=(time, time))


def dataset_settings(dataset, stage, content):
    """Write a dataset's settings of a stage; return their file as an input."""
    mark_stale_files(dataset.name)
    return settings_file(f"{dataset.work}/settings/{stage}.json", content)


def settings_of(stage, content):
    """Return the input function for a dataset's settings of a stage: ``content`` of the dataset."""

    def input_function(wildcards):
        dataset = dataset_of(wildcards)
        return dataset_settings(dataset, stage, content(dataset))

    return input_function


def scene_settings_of(stage, content):
    """Return the input function for a scene's settings: ``content`` of any of its datasets."""

    def input_function(wildcards):
        dataset = scene_of(wildcards)
        mark_stale_files(dataset.name)
        folder = f"{dataset.scene_work}/settings"
        return settings_file(f"{folder}/{stage}.json", content(dataset))

    return input_function


# By the path of each damaged file: what is wrong with it, and the outputs of the jobs that mend it.
DAMAGED = {}
take_as_missing(DAMAGED.__contains__)


@cache
def mark_noted_files():
    """Mark the files of the ledger that are damaged, or were made from something else."""
    DAMAGED.update(finished_work().damage)
    for _, outputs in DAMAGED.values():
        rerun(outputs)
    before_jobs_are_chosen(mark_outdated_files)


def mark_outdated_files():
    """Mark the files that were made from other files, or from other bytes of them, than now."""
    known = finished_work()
    rerun(known.outdated_outputs())
    for job in all_jobs():
        for output in map(unstored, job.output):
            # From a storage a job's inputs need not lie here when they are noted.
            if known.has_other_inputs(output, {*read_files(job)}, may_lack=bool(STORE)):
                rerun([output])


@cache
def mark_stale_files(name):
    """Mark damaged and outdated files, so that Snakemake rebuilds them.

    Of the dataset those are among them of which nobody knows from what they were made.
    """
    if not IS_MAIN_PROCESS:
        return
    mark_noted_files()
    dataset = DATASETS[name]
    files = [*dataset.files, *dataset.intermediates]
    jobs = finished_work()
    rerun(file for file in files if file not in jobs and os.path.lexists(file))
    rerun(presence.outgrown_records(dataset))
    if presence.external_changed(dataset, ViewStore(STORE) if STORE else None):
        rerun([dataset.inventory])
    for path, problem in presence.broken_files(dataset):
        DAMAGED.setdefault(path, (problem, files))


def damage_to_mend():
    """Return what is wrong with the damaged files that this run makes again, by path.

    Among them are the ledger, and each job's log and benchmark, where they cannot be written.
    """
    jobs = needed_jobs()
    made = {unstored(file) for job in jobs for file in job.output}
    damage = {
        path: problem
        for path, (problem, outputs) in DAMAGED.items()
        if not made.isdisjoint(outputs)
    }
    written = [file for job in jobs for file in (*job.log, job.benchmark) if file]
    for path in (LEDGER, *written):
        if problem := unreadable(path):
            damage[str(path)] = problem
    return dict(sorted(damage.items()))


def announce_damage():
    """Say which damaged files this run makes again."""
    for path, problem in damage_to_mend().items():
        print(f"{path}: {problem}; it is made anew", file=sys.stderr)


def set_damage_aside():
    """Move the damaged files that this run makes again to where nobody loses them."""
    for path in damage_to_mend():
        if os.path.lexists(path):
            set_aside(Path(path), Path(REMOVED))
        DAMAGED.pop(path, None)


def listed_files(job):
    """Return the files that a job wrote beside its outputs, with their SHA-256 where it is noted.

    A shard's record and the list of an export name them.
    """
    files = {}
    for output in map(Path, job.output):
        if output.suffix != ".json":
            continue
        content = read_json(output)
        listed = content.get("files") if isinstance(content, dict) else None
        if isinstance(listed, dict):
            is_record = output.name != MANIFEST
            folder = dataset_of(job.wildcards).folder if is_record else output.parent
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
    """Return the files of a job that only grow: a shard's logs, and what the job took."""
    files = [str(job.benchmark)] if job.benchmark else []
    for output in map(Path, job.output):
        # By name: a folder of thousands of shards takes long to list.
        files += [str(output.with_suffix(s)) for s in (JOURNAL_SUFFIX, LOG_SUFFIX)]
    return files


class JobNotes(logging.Handler):
    """Notes each job in the ledger: what it read when it starts, what it made when it is finished.

    Snakemake says when it starts jobs, whatever it prints. What has finished since is noted then.
    """

    def __init__(self, jobs):
        super().__init__()
        self.unfinished = {job.jobid: job for job in jobs if job.output}
        # The jobs of a group are not announced one by one.
        self.grouped = {n for n, job in self.unfinished.items() if job.group}
        # Of those that were announced.
        self.inputs = {}
        self.next_sending = 0.0

    def emit(self, record):
        if getattr(record, "event", None) is not LogEvent.JOB_STARTED:
            return
        try:
            self.note_finished({*self.inputs, *self.grouped})
        except UserError as error:
            # What is not noted is made again.
            print(f"warning: {error}", file=sys.stderr)
        for number in record.jobs:
            if number in self.unfinished:
                self.inputs[number] = read_stamps(self.unfinished[number])

    def note_finished(self, numbers):
        """Note those of these unfinished jobs that have finished since."""
        finished = [n for n in numbers if is_finished(self.unfinished[n])]
        for number in finished:
            job = self.unfinished.pop(number)
            self.grouped.discard(number)
            stamps = self.inputs.pop(number, None) or read_stamps(job)
            finished_work().note(line_of(job, stamps))
        if finished and STORE and time.monotonic() > self.next_sending:
            self.send()

    def send(self):
        """Send the ledger to the storage, and not again before 20 times as long has passed.

        It grows with the number of jobs.
        """
        began = time.monotonic()
        ViewStore(STORE).send(LEDGER)
        self.next_sending = began + 20 * (time.monotonic() - began)


def read_files(job):
    """Return the paths of the files that a job reads."""
    return [unstored(file) for file in job.input if not is_ancient(file)]


def read_stamps(job):
    """Return the stamps of the files that a job reads."""
    return finished_work().input_stamps(read_files(job))


def stamps(digests):
    """Return the stamps of those files that are there, whose SHA-256 may be known."""
    return {
        name: ledger.Stamp.of(name, digest)
        for name, digest in digests.items()
        if os.path.isfile(name)
    }


def line_of(job, inputs):
    """Return the line of the ledger for a finished job."""
    outputs = [unstored(file) for file in job.output]
    if STORE:
        # What the job made lies in the storage.
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
