"""What the workflow notes about finished work. No other helper of the tests knows these files.

The tests in tests/promises say what a user was promised, and not how it is kept. They ask this
module which files are noted, what was rendered, and what is damaged. They also have it change the
notes, as a kill or a second build may.
"""

import contextlib
import json
import os
import re
import tarfile
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from lightfield.core.files import Stamp, read_json
from lightfield.engine import bundles, receipts
from lightfield.engine.receipts import Output, Receipt
from lightfield.stages.registry import BY_NAME, VERSIONS
from lightfield.validation.verification import faults
from lightfield.workflow import run_lock
from lightfield.workflow.check import JobCheck

# The folder of the notes of all jobs of a build.
NOTES = f"work/{receipts.FOLDER}"

# The files of a build that note finished work: for each kind two files, as in `faults.KINDS`.
CUBOID, PLANE, LATTICE = (
    f"smoke/{rig}" for rig in ("LFCuboid_1x1x1", "LFPlane_3x2_equisolid", "LFLattice_2panos")
)
KINDS = {
    "receipt of views": (
        f"{NOTES}/{CUBOID}/render/0-6.jsonl",
        f"{NOTES}/{LATTICE}/render/0-2.jsonl",
    ),
    "receipt of a reprojection": (
        f"{NOTES}/{PLANE}/perspective/0-6.jsonl",
        f"{NOTES}/{LATTICE}/perspective/0-2.jsonl",
    ),
    "receipt of a file": (f"{NOTES}/{PLANE}/validate.jsonl", f"{NOTES}/{LATTICE}/validate.jsonl"),
    "benchmark": (
        f"work/benchmarks/{PLANE}/render/0-6.tsv",
        f"work/benchmarks/{LATTICE}/render/0-2.tsv",
    ),
    "log": (f"work/logs/{PLANE}/render/0-6.log", f"work/logs/{LATTICE}/render/0-2.log"),
}
# Nothing depends on these, and they have no checksum.
WITHOUT_CHECKSUM = {"benchmark", "log"}
# A plan itself writes these files.
OF_PLANS = ("work/check.txt", "work/sums.json")
# A run writes settings when it starts.
REWRITTEN = {"settings"}


# ---- what is damaged ------------------------------------------------------------------------


def named_in_plan(stderr):
    """Return the files that a plan names as damaged."""
    return set(re.findall(r"^([^:\n]+): .*; it is made anew$", stderr, re.M))


def outdated_in_plan(stderr):
    """Return what a plan names as changed, by the jobs that are outdated."""
    return dict(re.findall(r"^outdated: ([^:\n]+): (.*)$", stderr, re.M))


def problems(folders, work="work"):
    """Return what `snakemake verify` finds in datasets, by path.

    Without ``work`` the datasets are copies, of which nothing else exists.
    """
    found = {}
    for folder in folders:
        found |= faults(Path(folder), Path(work) if work else None)
    return found


# ---- what was made, and from what -----------------------------------------------------------


class Noted(NamedTuple):
    """What is noted about a job: the SHA-256 of each file that it read, and that it made."""

    inputs: dict[str, str]
    files: dict[str, str]


def noted(folder):
    """Return what is noted in a build's folder, by the outputs of its jobs."""
    return {
        output: Noted(dict(receipt.inputs), _digests(receipt))
        for path, receipt in _receipts(folder).items()
        for output in (path, *receipt.outputs)
    }


def is_note(name):
    """Return whether a file notes what a job has made."""
    return receipts.is_receipt(name)


def note_of(job):
    """Return the output of a planned job that notes the others. None for a job without one."""
    return next(filter(is_note, job["output"]), None)


def _receipts(folder):
    """Return the receipts of a build's finished jobs, by their paths from its folder."""
    paths = sorted(Path(folder, NOTES).rglob(f"*{receipts.SUFFIX}"))
    found = {str(path.relative_to(folder)): receipts.read(path) for path in paths}
    return {path: receipt for path, receipt in found.items() if receipt}


def unchanged_notes(folder, other_folder):
    """Return the notes that say the same of inputs and files in two copies of a build."""
    first, second = _receipts(folder), _receipts(other_folder)
    return {
        path for path in first.keys() & second.keys() if _says(first, path) == _says(second, path)
    }


def _says(found, path):
    receipt = found[path]
    return receipt.version, receipt.settings, receipt.inputs, _digests(receipt)


def times_of_making(folder):
    """Return when each file was made that a finished job has made, in nanoseconds.

    Leaves out jobs that add up what all runs cost. These work at each start.
    """
    return {
        name: output.stamp.modified_ns
        for receipt in _receipts(folder).values()
        if not BY_NAME[receipt.stage].reads_history
        for name, output in receipt.outputs.items()
    }


def has_lock(folder, scene):
    """Return whether a run of a build has had the lock of a scene."""
    return Path(folder, NOTES, scene, run_lock.NAME).exists()


def _digests(receipt):
    return {path: output.stamp.sha256 for path, output in receipt.outputs.items()}


def digest_of_input(folder, name):
    """Return what is noted about a file when a job reads it now."""
    return receipts.input_sum(Path(folder, name))


def is_content(name):
    """Return whether the content of a job's input decides what the job makes.

    The mark only starts a job, and receipts hold the settings themselves. Others are checks that
    must succeed before a job may begin.
    """
    path = Path(name)
    is_check = path.name in ("blend.json", "cameras.json")
    return name not in OF_PLANS and "settings" not in path.parts and not is_check


def each_changed_input(folder):
    """Yield an output, and one of its inputs, for each input that a job has read.

    Also yield what is outdated if only this input is noted with other content.
    """
    with contextlib.chdir(folder):
        for path, receipt in _receipts(".").items():
            for name in receipt.inputs:
                _write(path, _with_other_inputs(receipt, [name]))
                check = JobCheck(Path("work"), Path("results"), lambda _: None, VERSIONS)
                yield path, name, check.verdict(path, receipt.settings).outdated
            _write(path, receipt)


# ---- notes as a kill or a second build leaves them ------------------------------------------


def forget(folder, output):
    """Remove what is noted about the job of an output, as if it had been killed at its end."""
    (path,) = (
        path
        for path, receipt in _receipts(folder).items()
        if output == path or output in receipt.outputs
    )
    Path(folder, path).unlink()


def forget_all(folder):
    """Remove what is noted about all jobs."""
    for path in _receipts(folder):
        Path(folder, path).unlink()


def claim(folder, names):
    """Add to each receipt that its job has made these files, with bytes that they do not have."""
    lines = [{"file": name, "sha256": "0" * 64, "bytes": 1, "modified_ns": 1} for name in names]
    for path in _receipts(folder):
        with Path(folder, path).open("a") as receipt:
            receipt.write("".join(json.dumps(line) + "\n" for line in lines))


@contextlib.contextmanager
def made_from_other_inputs(folder, inputs):
    """Note that jobs have read other content than is there, as if two builds had been mixed up.

    ``inputs`` are the names of such files, by an output of each job.
    """
    changed = {}
    for path, receipt in _receipts(folder).items():
        names = {name for output in (path, *receipt.outputs) for name in inputs.get(output, ())}
        if names & receipt.inputs.keys():
            changed[path] = receipt
            other = _with_other_inputs(receipt, names & receipt.inputs.keys())
            _write(Path(folder, path), other)
    yield
    for path, receipt in changed.items():
        _write(Path(folder, path), receipt)


def _with_other_inputs(receipt, names):
    return replace(receipt, inputs={**receipt.inputs, **dict.fromkeys(names, "0" * 64)})


def _write(path, receipt):
    """Write a receipt."""
    header = {"job": receipts.job_of(path)}
    header |= {name: getattr(receipt, name) for name in ("stage", "version", "settings", "inputs")}
    outputs = [
        {"file": name, **output.stamp._asdict()} | ({"key": output.key} if output.key else {})
        for name, output in receipt.outputs.items()
    ]
    lines = [json.dumps(line) + "\n" for line in (header, *outputs, *receipt.history)]
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text("".join(lines))


# ---- notes of a simulated build -------------------------------------------------------------


def note(names):
    """Note that a separate job made each of these files. Paths are from the current folder."""
    for name in names:
        folder = Path(*Path(name).parts[1:]).parent
        path = Path(NOTES, folder, f"{Path(name).name.replace('.', '_')}{receipts.SUFFIX}")
        _write(path, Receipt("", None, {}, {}, {str(name): Output(Stamp.of(name))}))


def note_shard(record, keys: dict, history=()):
    """Note that a shard is finished. ``keys`` has the key of each of its files."""
    outputs = {str(file): Output(Stamp.of(file), key) for file, key in keys.items()}
    _write(record, Receipt("", None, {}, {}, outputs, [*history]))


def note_build(folder, jobs: Iterable[dict]):
    """Note that jobs have made their outputs from their inputs.

    Shards have noted their files already.
    """
    with contextlib.chdir(folder):
        paths = {path: job for job in jobs for path in job["output"] if receipts.is_receipt(path)}
        for path, job in paths.items():
            made = receipts.read(path)
            keys = {name: output.key for name, output in made.outputs.items()} if made else {}
            keys |= {name: None for name in job["output"] if name != path}
            outputs = {name: Output(Stamp.of(name), key) for name, key in keys.items()}
            _write(path, Receipt("", None, {}, {}, outputs))
        sums = {}
        for path, job in paths.items():
            settings = {}
            for name in job["input"]:
                if "settings" in Path(name).parts:
                    settings = read_json(name)
                elif name not in sums:
                    sums[name] = receipts.input_sum(name)
            inputs = {name: sums[name] for name in job["input"] if is_content(name)}
            _write(path, replace(receipts.read(path), settings=settings, inputs=inputs))


def accept(folder, dataset, stage, views, file):
    """Note that the job of a shard has made a file of it as the file is now."""
    record = folder / shard(dataset, stage, views)
    name = f"results/{dataset}/{file}"
    receipt = receipts.read(record)
    output = receipt.outputs[name]._replace(stamp=Stamp.of(folder / name))
    _write(record, replace(receipt, outputs={**receipt.outputs, name: output}))


# ---- shards ---------------------------------------------------------------------------------


def shard(dataset, stage, views):
    """Return the target that makes a shard of a dataset. ``views`` are its bounds, such as 0-6."""
    return f"{NOTES}/{dataset}/{stage}/{views}{receipts.SUFFIX}"


def notes_of_killed_shard(dataset, stage, views):
    """Return the file that a killed job of a shard leaves, from a build's folder."""
    return str(Path(shard(dataset, stage, views)).with_suffix(receipts.PART_SUFFIX))


def files_of_shard(folder, dataset, stage, views):
    """Return the bytes and the SHA-256 of each file of a finished shard, by path in the dataset."""
    receipt = receipts.read(Path(folder, shard(dataset, stage, views)))
    return {
        str(Path(name).relative_to(f"results/{dataset}")): (output.stamp.bytes, output.stamp.sha256)
        for name, output in receipt.outputs.items()
    }


def finished_files(folder, dataset):
    """Return the SHA-256 and the bytes of each view that is finished, also of killed shards."""
    files = {}
    for path in _shards(folder, dataset):
        receipt = receipts.read(path)
        outputs = {**(receipt.outputs if receipt else {}), **receipts.read_part(path)[0]}
        for name, output in outputs.items():
            if output.key:
                files[Path(folder, name)] = (output.stamp.sha256, output.stamp.bytes)
    return files


def views_of(path):
    """Return the views that a file is needed for: those of a receipt, or the one with its name."""
    if receipts.is_receipt(path):
        receipt = receipts.read(path)
        return {Path(name).stem for name in receipt.outputs} if receipt else set()
    return {path.name.partition(".")[0]}


def _shards(folder, dataset="**", views="*"):
    """Return the receipts of shards, also of shards that are not finished."""
    pattern = f"{dataset}/*/{views}" if dataset != "**" else f"**/{views}"
    files = [
        path
        for suffix in (receipts.SUFFIX, receipts.PART_SUFFIX)
        for path in Path(folder, NOTES).glob(f"{pattern}{suffix}")
        if receipts.is_shard(path)
    ]
    return sorted({path.with_suffix(receipts.SUFFIX) for path in files})


def rendered(folder, dataset="**"):
    """Return how often each view has been rendered, by its shards' folder and its name."""
    counts = Counter()
    for path in _shards(folder, dataset):
        # Shards of another size have a history of their own for the same views.
        counts.update(
            (path.parent, line["view"]) for line in receipts.history(path) if "view" in line
        )
    return counts


def unfinished_shards(folder, scene):
    """Return the shards of a scene that have rendered views, but not all of them."""
    return [
        path
        for path in _shards(folder, f"{scene}/*")
        if path.parent.name == "render"
        and any("view" in line for line in receipts.read_part(path)[1])
    ]


def workers(folder, dataset, views="*"):
    """Return the numbers of the processes that have rendered a shard of a dataset, or any shard."""
    return {
        line["pid"]
        for path in _shards(folder, dataset, views)
        if path.parent.name == "render"
        for line in receipts.history(path)
        if "pid" in line
    }


def memory_of_views(record):
    """Return the memory in bytes that each view of a shard took, in the order of rendering."""
    return [line["memory_bytes"] for line in receipts.history(record) if line.get("memory_bytes")]


# ---- families -------------------------------------------------------------------------------


def batch(family, name):
    """Return the target that makes a batch of members of a family."""
    return f"{NOTES}/{family}/batches/{name}{receipts.SUFFIX}"


def note_batch(family, name, files):
    """Note that a batch of members is finished. ``files`` stand for its members."""
    note_shard(batch(family, name), dict.fromkeys(files))


def begun_members(folder, family):
    """Return the members of a family that were begun, in their order, once for each time."""
    batches = Path(folder, NOTES, family, "batches")
    paths = {path.with_suffix(receipts.SUFFIX) for path in batches.glob("*.*")}
    return [
        line["member"]
        for path in sorted(paths)
        for line in receipts.history(path)
        if "began" in line
    ]


# ---- a storage ------------------------------------------------------------------------------


def packed_files(store):
    """Return the paths of the files that travel in the bundles of a storage in a folder."""
    names = set()
    for bundle in Path(store).glob(f"{NOTES}/**/*{bundles.SUFFIX}"):
        with tarfile.open(bundle) as archive:
            names.update(archive.getnames())
    return names


def damage_packed(store, shard):
    """Change a byte of the first file in the bundle of a shard's receipt."""
    bundle = bundles.bundle_of(Path(store, shard))
    with tarfile.open(bundle) as archive:
        position = archive.next().offset_data
    content = bytearray(bundle.read_bytes())
    content[position + 20] ^= 1
    status = bundle.stat()
    bundle.write_bytes(content)
    os.utime(bundle, ns=(status.st_atime_ns, status.st_mtime_ns))
