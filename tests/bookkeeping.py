"""What the workflow notes about finished work. No other helper of the tests knows these files.

The tests in tests/promises say what a user was promised, and not how it is kept. They ask this
module which files are noted, what was rendered, and what is damaged. They also have it change the
notes, as a kill or a second build may.
"""

import contextlib
import hashlib
import json
import os
import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from lightfield.core.files import read_json_lines, sha256, write_json
from lightfield.validation.integrity import Integrity
from lightfield.workflow import ledger, shard_files
from lightfield.workflow.records import ShardRecord
from lightfield.workflow.view_store import ViewStore

# The notes of all jobs of a build.
NOTES = f"work/{ledger.NAME}"

# The files of a build that note finished work: for each kind two files, as in `faults.KINDS`.
CUBOID, PLANE, LATTICE = (
    f"smoke/{rig}" for rig in ("LFCuboid_1x1x1", "LFPlane_3x2_equisolid", "LFLattice_2panos")
)
KINDS = {
    "record of views": (f"work/{CUBOID}/render/0-6.json", f"work/{LATTICE}/render/0-2.json"),
    "record of a reprojection": (
        f"work/{PLANE}/perspective/0-6.json",
        f"work/{LATTICE}/perspective/0-2.json",
    ),
    "log of checksums": (
        f"work/{PLANE}/render/0-6.sums.jsonl",
        f"work/{LATTICE}/render/0-2.sums.jsonl",
    ),
    "journal": (
        f"work/{PLANE}/render/0-6.journal.jsonl",
        f"work/{LATTICE}/render/0-2.journal.jsonl",
    ),
    "sums of work": (f"work/{PLANE}/checksums.txt", f"work/{LATTICE}/checksums.txt"),
    "note of shards": ("work/shards.json", f"results/{LATTICE}/report/rig.svg"),
    "benchmark": (
        f"work/benchmarks/{PLANE}/render/0-6.tsv",
        f"work/benchmarks/{LATTICE}/render/0-2.tsv",
    ),
    "log": (f"work/logs/{PLANE}/render/0-6.log", f"work/logs/{LATTICE}/render/0-2.log"),
}
# These kinds record finished work, and no job can make them again. A run finds only those that it
# cannot read. `snakemake verify` finds the rest.
HISTORY = {"log of checksums", "journal", "benchmark"}
# A job's log has no checksum.
WITHOUT_CHECKSUM = {"log"}
# Each plan writes settings, and each run notes its shards.
REWRITTEN = {"settings", "note of shards"}


# ---- what is damaged ------------------------------------------------------------------------


def named_in_plan(stderr):
    """Return the files that a plan names as damaged."""
    return set(re.findall(r"^([^:\n]+): .*; it is made anew$", stderr, re.M))


def problems(folders, work="work"):
    """Return what `snakemake verify` finds in datasets, by path.

    Without ``work`` the datasets are copies, of which nothing else exists.
    """
    return {
        str(fault.path): fault.problem
        for folder in folders
        for fault in Integrity(Path(folder), Path(work) if work else None).faults()
    }


# ---- what was made, and from what -----------------------------------------------------------


class Noted(NamedTuple):
    """What is noted about a job: the SHA-256 of each file that it read, and that it made."""

    inputs: dict[str, str]
    files: dict[str, str]


def noted(folder):
    """Return what is noted in a build's folder, by the outputs of its jobs."""
    return {
        output: Noted(_digests(job.inputs), _digests(job.files))
        for job in _latest_jobs(folder)
        for output in job.outputs
    }


def _latest_jobs(folder):
    """Return the last note of each job, in the order of the jobs."""
    jobs = {}
    for job in reversed([*ledger.jobs(Path(folder, NOTES))]):
        jobs[tuple(job.outputs)] = job
    return list(jobs.values())


def _digests(stamps):
    return {name: stamp.sha256 for name, stamp in stamps.items()}


def each_changed_input(folder, scratch):
    """Yield an output, and one of its inputs, for each input that a job has read.

    Also yield what is outdated if only this input is noted with other content. ``scratch`` is a
    file for such notes.
    """
    with contextlib.chdir(folder):
        for job in _latest_jobs("."):
            for name in job.inputs:
                scratch.write_text(_line(_with_other_inputs(job, [name])))
                yield job.outputs, name, [*ledger.Ledger(scratch).outdated_outputs()]


# ---- notes as a kill or a second build leaves them ------------------------------------------


def forget(folder, output):
    """Remove what is noted about the job of an output, as if it had been killed at its end."""
    jobs = _latest_jobs(folder)
    kept = [job for job in jobs if output not in job.outputs]
    assert len(kept) == len(jobs) - 1
    Path(folder, NOTES).write_text("".join(map(_line, kept)))


@contextlib.contextmanager
def made_from_other_inputs(folder, inputs):
    """Note that jobs have read other content than is there, as if two builds had been mixed up.

    ``inputs`` are the names of such files, by the first output of each job.
    """
    path = Path(folder, NOTES)
    before = path.read_bytes()
    jobs = [_with_other_inputs(job, inputs.get(job.outputs[0], ())) for job in _latest_jobs(folder)]
    path.write_text("".join(map(_line, jobs)))
    yield
    path.write_bytes(before)


def _with_other_inputs(job, names):
    return job._replace(
        inputs=job.inputs | {name: ledger.Stamp("0" * 64, 0, 0, 0) for name in names}
    )


def _line(job):
    text = json.dumps(job._asdict(), separators=(",", ":"))
    return f"{hashlib.sha256(text.encode()).hexdigest()} {text}\n"


def keep_one_line_a_job(folder, *unwanted):
    """Keep the last note of each job, but none with ``unwanted`` in the name of an output."""
    jobs = [
        job
        for job in _latest_jobs(folder)
        if not any(word in output for word in unwanted for output in job.outputs)
    ]
    Path(folder, NOTES).write_text("".join(map(_line, jobs)))


# ---- notes of a simulated build -------------------------------------------------------------


def note(names):
    """Note that a separate job made each of these files. Paths are from the current folder."""
    jobs = ledger.Ledger(Path(NOTES))
    for name in names:
        stamps = {name: ledger.Stamp.of(name)}
        is_history = name.endswith((".jsonl", ".tsv"))
        files, history = ({}, stamps) if is_history else (stamps, {})
        jobs.note(ledger.Job([name], files, history, {}))


def note_shard(record, folder, files, key):
    """Note that a shard is finished. Its ``files`` in ``folder`` were made by the same ``key``."""
    shard = ShardRecord(record, folder)
    for file in files:
        shard.add(file, key)
    shard.write(files)


def write_shard(record, files):
    """Write the notes of a finished shard of views. ``files`` have a path, a key and sums each."""
    record.parent.mkdir(parents=True, exist_ok=True)
    lines = [json.dumps({"file": path, "key": key, **sums}) + "\n" for path, key, sums in files]
    record.with_suffix(shard_files.LOG_SUFFIX).write_text("".join(lines))
    record.write_text(json.dumps({"files": {path: sums for path, _, sums in files}}))


def write_batch(record, members, rigs):
    """Write the notes of a finished batch of a family. Each of its ``members`` has these rigs."""
    datasets = {rig: {"split": None} for rig in rigs}
    finished = {name: {"state": "valid", "datasets": datasets} for name in members}
    write_json(record, {"sources": {}, "members": finished})


def note_build(folder, inputs, shards, time):
    """Note that each output in ``inputs`` has a job of its own, which read these inputs.

    ``shards`` are the records of shards, with the folders of their datasets. ``time`` is when the
    last job finished.
    """
    with contextlib.chdir(folder):
        stamps = {name: ledger.Stamp.of(name) for names in inputs.values() for name in names}
        jobs = []
        for name, read in inputs.items():
            files = {name: ledger.Stamp.of(name)}
            history = {}
            if name in shards:
                for view, (_, digest) in shard_files.read_record(Path(name)).items():
                    path = f"{shards[name]}/{view}"
                    files[path] = ledger.Stamp.of(path, digest)
                log = f"{name.removesuffix('.json')}{shard_files.LOG_SUFFIX}"
                history[log] = ledger.Stamp.of(log)
            job = ledger.Job([name], files, history, {path: stamps[path] for path in read})
            jobs.append(job)
        Path(NOTES).write_text("".join(map(_line, jobs)))
        os.utime(NOTES, (time, time))


def accept(folder, dataset, stage, views, file):
    """Note that the job of a shard has made a file of it as the file is now."""
    record = shard(dataset, stage, views)
    path = folder / "results" / dataset / file
    content = json.loads((folder / record).read_text())
    content["files"][file] = {"bytes": path.stat().st_size, "sha256": sha256(path)}
    write_json(folder / record, content)
    (job,) = (job for job in _latest_jobs(folder) if record in job.outputs)
    with contextlib.chdir(folder):
        files = {name: ledger.Stamp.of(name) for name in job.files}
        ledger.Ledger(Path(NOTES)).note(job._replace(files=files))


# ---- shards ---------------------------------------------------------------------------------


def shard(dataset, stage, views):
    """Return the target that makes a shard of a dataset. ``views`` are its bounds, such as 0-6."""
    return f"work/{dataset}/{stage}/{views}.json"


def files_of_shard(folder, dataset, stage, views):
    """Return the bytes and the SHA-256 of each file of a finished shard, by path in the dataset."""
    return shard_files.read_record(Path(folder, shard(dataset, stage, views)))


def finished_files(folder, dataset):
    """Return the SHA-256 and the bytes of each view that is finished, also of killed shards."""
    files = {}
    for log in Path(folder, "work", dataset).glob(f"*/*{shard_files.LOG_SUFFIX}"):
        for line in read_json_lines(log):
            path = Path(folder, "results", dataset, line["file"])
            files[path] = (line["sha256"], line["bytes"])
    return files


def views_of(path):
    """Return the views that a file is needed for: those of a log, or the one with its name."""
    if path.name.endswith(shard_files.LOG_SUFFIX):
        return {Path(line["file"]).stem for line in read_json_lines(path)}
    return {path.name.partition(".")[0]}


def _journals(folder, dataset="**", views="*"):
    return Path(folder).glob(f"work/{dataset}/{views}{shard_files.JOURNAL_SUFFIX}")


def rendered(folder):
    """Return how often each view has been rendered, by its shards' folder and its name."""
    counts = Counter()
    for journal in _journals(folder):
        # Shards of another size have journals of their own for the same views.
        counts.update(
            (journal.parent, line["view"]) for line in read_json_lines(journal) if "view" in line
        )
    return counts


def unfinished_shards(folder, scene):
    """Return the shards of a scene that have rendered views, but not all of them."""
    return [
        journal
        for journal in _journals(folder, f"{scene}/*/render")
        if any("view" in line for line in read_json_lines(journal))
        and not journal.with_name(
            f"{journal.name.removesuffix(shard_files.JOURNAL_SUFFIX)}.json"
        ).exists()
    ]


def workers(folder, dataset, views="*"):
    """Return the numbers of the processes that have rendered a shard of a dataset, or any shard."""
    return {
        line["pid"]
        for journal in _journals(folder, f"{dataset}/render", views)
        for line in read_json_lines(journal)
        if "pid" in line
    }


def memory_of_views(record):
    """Return the memory in bytes that each view of a shard took, in the order of rendering."""
    journal = record.with_suffix(shard_files.JOURNAL_SUFFIX)
    lines = read_json_lines(journal)
    return [line["memory_bytes"] for line in lines if line.get("memory_bytes")]


# ---- families -------------------------------------------------------------------------------


def batch(family, name):
    """Return the target that makes a batch of members of a family."""
    return f"work/{family}/batches/{name}.json"


def begun_members(folder, family):
    """Return the members of a family that were begun, in their order, once for each time."""
    return [
        line["member"]
        for journal in sorted(_journals(folder, f"{family}/batches"))
        for line in read_json_lines(journal)
        if "began" in line
    ]


# ---- a storage ------------------------------------------------------------------------------


def stored_views(store):
    """Return the names of the finished views in a storage in a folder."""
    notes = Path(store).glob("views/keys/*/*.exr@*")
    return {note.name.split("@")[1].removesuffix(".exr") for note in notes}


def take_stored(store, digest, path):
    """Copy the file with a SHA-256 from a storage to a path. Return whether the storage has it."""
    return ViewStore(str(store)).take(digest, path)


def bring_stored(store, path):
    """Copy a declared file from a storage to the same path in the current folder."""
    ViewStore(store).bring(str(path))


def lose_stored(store, digest):
    """Remove the file with a SHA-256 from a storage in a folder."""
    Path(store, "views/sums", digest).unlink()
