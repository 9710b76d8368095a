# Decides which jobs run: those whose receipts do not say that their files are fine.
import atexit
import contextlib
import functools
import itertools
import json
import os
import re
import sys
import uuid
from pathlib import Path

from lightfield.core import bundles
from lightfield.core.errors import UserError
from lightfield.core.files import set_aside, special_kind, unreadable, write_text
from lightfield.core.receipts import (
    FOLDER as FOLDER_OF_RECEIPTS,
    SUFFIX,
    make_way,
)
from lightfield.workflow import job_settings
from lightfield.stages.registry import VERSIONS
from lightfield.workflow import run_lock
from lightfield.workflow.build import has_bundle
from lightfield.workflow.check import JobCheck

RECEIPTS = f"{WORK}/{FOLDER_OF_RECEIPTS}"
# An input of each job. It has new content if a job must run, and no other job looks at it.
MARK = f"{WORK}/check.txt"
# A plan names at most this many outdated jobs.
MOST_REASONS = 10
# The names of jobs, with wildcards, and the functions that return their inputs and settings.
JOBS = []
# The jobs that Snakemake asked about: their names with wildcards, and the wildcards, by receipt.
ASKED = {}
# The settings that differ from their files. They are written when a run starts.
NEW_SETTINGS = {}


def receipt_of(job):
    """Return the output that is the receipt of a job. ``job`` is its name, with wildcards."""
    return update(f"{RECEIPTS}/{job}{SUFFIX}")


def bundle_of(job):
    """Return the output that is the bundle of a job. Empty if jobs share a folder."""
    return f"{RECEIPTS}/{job}{bundles.SUFFIX}" if STORE else []


def reads(job, stage=None, are_noted=False, **inputs):
    """Return the inputs of a rule: its files, its settings, and the mark that makes it run.

    ``job`` is the name of the job, with wildcards, as `receipt_of` has it. ``stage`` is the name of
    its settings. ``inputs`` are paths with wildcards, lists of them, or input functions.
    ``are_noted`` says that the job must run if its receipt lacks one of them. A receipt may have
    more of them, which other runs chose.
    """

    def wanted(wildcards):
        """Return the job's inputs by name, and the path and content of its settings."""
        files = {name: paths_of(each, wildcards) for name, each in inputs.items()}
        if not stage:
            return files, None, {}
        path, content = asked(
            lambda names: job_settings.settings_file(stage, BUILD, names), wildcards
        )
        if "inputs" in content:
            content["inputs"] = [*flat(files.values())]
        return files, path, content

    def input_function(wildcards):
        files, path, content = wanted(wildcards)
        settings = {"settings": settings_file(path, content)} if path else {}
        receipt = f"{RECEIPTS}/{job.format(**dict(wildcards.items()))}{SUFFIX}"
        ASKED[receipt] = job, Names(wildcards.items())
        if STORE:
            # Snakemake compares times. The check cannot see the files in the storage.
            return files | settings | carried(files)
        if not IS_MAIN_PROCESS:
            return files | settings | {"mark": ancient(MARK)}
        noted = [*flat(files.values())] if are_noted else ()
        is_fine = CHECK.verdict(receipt, content, noted).is_fine
        if not is_fine:
            # Snakemake would name read-only files in many lines, or end with a traceback.
            for folder in folders_of(job, wildcards):
                end_unless_writable(folder)
            name = job_of(receipt)
            wait_until_past([receipt, log_of(name), times_of(name)])
        if not os.path.exists(MARK):
            new_mark()
        files = {name: unless_newer(receipt, each) for name, each in files.items()}
        # The mark comes first: for the first file below a folder, Snakemake lists all folders down to
        # that file, and never sees what is written into them later, such as settings.
        mark = {"mark": ancient(MARK) if is_fine else new_mark()}
        return mark | files | settings

    JOBS.append((job, wanted))
    return unpack(input_function)


def folders_of(job, wildcards):
    """Return folders in which a job writes. ``job`` is its name, with wildcards."""
    paths = [f"{RESULTS}/{job}", f"{WORK}/{job}", f"{RECEIPTS}/{job}"]
    paths += [log_of(job), times_of(job)]
    if KINDS[job].stage == "render":
        paths.append(f"{PATHS.views}/{{first}}")
    elif job in ("{scene}/{rig}/figures", "{scene}/{rig}/page"):
        paths.append(PATHS.page)
    return [os.path.dirname(path.format(**dict(wildcards.items()))) for path in paths]


def carried(files):
    """Return the inputs with which the files of a job's inputs reach another machine.

    These are the receipts of the jobs that made the inputs, and their bundles. A job that reads
    only the receipts names its inputs ``receipts`` or ``lists``.
    """
    receipts, packed = [], []
    for name, each in files.items():
        found = [BUILD.receipt_of_file(path) for path in flat([each])]
        receipts += filter(None, found)
        if name not in ("receipts", "lists"):
            packed += [path for path in found if path and has_bundle(path)]
    bundled = [path.removesuffix(SUFFIX) + bundles.SUFFIX for path in packed]
    return {"makers": [*dict.fromkeys(receipts)], "bundles": [*dict.fromkeys(bundled)]}


def paths_of(each, wildcards):
    """Return an input of a job: a path, or a list of paths."""
    if callable(each):
        return each(wildcards)
    if isinstance(each, str):
        return each.format(**dict(wildcards.items()))
    return [paths_of(one, wildcards) for one in each]


def flat(inputs):
    """Yield the paths of inputs, which are paths or lists of paths."""
    for each in inputs:
        yield from [each] if isinstance(each, str) else each


def unless_newer(receipt, each):
    """Return an input, so that Snakemake does not see its time if it is only newer."""
    if not isinstance(each, str):
        return [unless_newer(receipt, one) for one in each]
    return ancient(each) if CHECK.is_only_newer(receipt, each) else each


def write_or_end(path, text):
    """Write a text. End the run with one line if the disk takes none."""
    try:
        write_text(path, text)
    except UserError as error:
        sys.exit(f"error: {error}")


@functools.cache
def new_mark():
    """Give the mark new content, and return it. Snakemake ignores a mere new time."""
    write_or_end(MARK, f"{uuid.uuid4()}\n")
    return MARK


def settings_file(path, content):
    """Return the settings file of a job as an input. Its time does not count: the check reads it.

    The file is written now only if it is missing, because a live run may read it. A run writes the
    others when it starts.
    """
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"
    if STORE:
        STORED_SETTINGS[path] = text
        return path
    if IS_MAIN_PROCESS:
        if unreadable(path):
            set_aside(Path(path), Path(REMOVED))
        if not os.path.exists(path):
            write_or_end(path, text)
        elif Path(path).read_bytes() != text.encode():
            NEW_SETTINGS[path] = text
    return ancient(path)


def make_ways():
    """Move away links in place of files that a run changes, and what is no file.

    A run changes the files of locks and times. Snakemake copies an output before its job.
    """
    locks = [folder / run_lock.NAME for folder in scene_folders()]
    listing = os.walk(f"{WORK}/benchmarks")
    times = [Path(folder, name) for folder, _, names in listing for name in names]
    made = [
        *ASKED,
        *itertools.chain(*(each.damaged for each in CHECK.verdicts.values())),
    ]
    special = [Path(path) for path in made if special_kind(path)]
    for path in locks + times + special:
        make_way(path, Path(WORK))


def write_new_settings():
    """Write the settings that differ from their files."""
    for path, text in NEW_SETTINGS.items():
        write_text(path, text)


class Names(dict):
    """The wildcards of a job, by their names, as input functions get them."""

    __getattr__ = dict.__getitem__


def wanted_settings(receipt):
    """Return the wanted settings of a receipt's job. None if no job of this plan makes it."""
    for job, wanted in JOBS:
        if found := re.fullmatch(expression_of(job), job_of(receipt)):
            # A job that the configuration no longer has would end the run.
            with contextlib.suppress(SystemExit):
                _, _, content = wanted(Names(found.groupdict()))
                return content


@functools.cache
def expression_of(job):
    """Return the regular expression that the names of jobs match."""
    parts = re.split(r"\{(\w+)\}", job)
    texts = map(re.escape, parts[::2])
    wildcards = [f"(?P<{name}>{CONSTRAINTS[name]})" for name in parts[1::2]]
    return "".join(
        itertools.chain(*itertools.zip_longest(texts, wildcards, fillvalue=""))
    )


CHECK = JobCheck(Path(WORK), Path(RESULTS), wanted_settings, VERSIONS)
if IS_MAIN_PROCESS:
    # The next plan need not read the same files again.
    atexit.register(CHECK.sums.save)


def scene_folders():
    """Return the folders of the receipts of the scenes that this run makes."""
    scenes = {
        scene
        for scene, separator, _ in (job_of(each).partition("/") for each in ASKED)
        if separator
    }
    return [Path(RECEIPTS, scene) for scene in sorted(scenes)]


def check_folders():
    """Raise `UserError` if the receipts are of files in other folders than the chosen ones."""
    for receipt, verdict in CHECK.verdicts.items():
        if verdict.elsewhere:
            raise config_mistake(
                f"results: is {RESULTS}, and work is {WORK}, but {receipt} is the receipt of "
                f"{verdict.elsewhere}: after a move, leave a link in the old place, and keep the key; "
                "a second build needs a folder work of its own"
            )


def announce_changes():
    """Say which files this run makes again, and why. Another run may be replacing them now."""
    if any(map(run_lock.is_held, scene_folders())):
        return
    with contextlib.suppress(UserError):
        check_folders()
        announce_outdated()


def announce_outdated():
    """Say which files are made again because they are damaged or outdated."""
    for receipt, verdict in CHECK.verdicts.items():
        for path in verdict.damaged:
            print(f"{path}: {damage_of(path)}; it is made anew", file=sys.stderr)
            if is_of_another_build(path, receipt):
                print(
                    f"note: {path} is newer than its receipt: if runs with another folder work "
                    "make this dataset, too, each run makes the other's files again: give each "
                    "folder work a folder results",
                    file=sys.stderr,
                )
    outdated = {
        receipt: verdict.outdated
        for receipt, verdict in CHECK.verdicts.items()
        if verdict.outdated
    }
    for receipt in [*outdated][:MOST_REASONS]:
        changes = ", ".join(outdated[receipt][:3])
        print(f"outdated: {job_of(receipt)}: {changes}", file=sys.stderr)
    if len(outdated) > MOST_REASONS:
        print(f"outdated: and {len(outdated) - MOST_REASONS} more", file=sys.stderr)


def is_of_another_build(path, receipt):
    """Return whether another build seems to have written a file with what a dataset has cost.

    These files are never equal in two builds.
    """
    is_of_costs = Path(path).name == Path(PATHS.costs).name and os.path.isfile(path)
    return is_of_costs and os.path.getmtime(path) > os.path.getmtime(receipt)


def damage_of(path):
    """Return what is wrong with a file that is not as its receipt says."""
    if not os.path.lexists(path):
        return "is missing"
    return unreadable(path) or "its sha256 is not the one in its receipt"


def planned_jobs():
    """Return the jobs that run: their names with wildcards, and the wildcards."""
    return [job for receipt, job in ASKED.items() if CHECK.will_run(receipt)]


def job_of(receipt):
    """Return the name of the job of a receipt."""
    return receipt.removeprefix(f"{RECEIPTS}/").removesuffix(SUFFIX)
