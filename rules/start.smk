# Checks, notes and removals before the first job.
import functools
import os
import resource
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from lightfield.configuration.blend_lock import expected_blend
from lightfield.core import disk_space, leftovers, units
from lightfield.core.disk_space import obstacle
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.planning.cost import light_group_count, temporary_bytes, view_cost
from lightfield.workflow import live_runs, presence, shard_counts
from lightfield.workflow.view_store import ViewStore

# With less address space, in bytes, the import of bpy crashes, or no thread starts.
LEAST_ADDRESS_SPACE = 1.5e9


def check_device():
    """Raise `UserError` for a missing device, if this machine renders."""
    jobs = needed_jobs()
    device = SETTINGS.device
    if device == "auto" and any(is_of(job, "check_gpu") for job in jobs):
        device = "gpu"
    renders = device == "gpu" or any(job.resources.get("gpu") for job in jobs)
    if renders and RUNS_HERE:
        command = [sys.executable, FOLDER / "scripts/check_device.py", device]
        checked = subprocess.run(command, capture_output=True, text=True)
        if checked.returncode:
            lines = checked.stderr.strip().splitlines() or ["it said nothing"]
            raise UserError(lines[-1].removeprefix("error: "))


def check_memory():
    """Raise `UserError` for a limit of memory with which Blender cannot start."""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if RUNS_HERE and 0 <= limit < LEAST_ADDRESS_SPACE:
        raise UserError(
            f"memory: a process may have {units.size(limit)} here, and Blender "
            f"needs at least {units.size(LEAST_ADDRESS_SPACE)}: raise the limit "
            "(ulimit -v unlimited)"
        )


def check_disk_space():
    """Warn of disks that this run nearly fills. Raise `UserError` for a disk that is too small."""
    jobs = [job for job in needed_jobs() if job.output]
    renders = [job for job in jobs if is_of(job, "render")]
    datasets = {
        d.paths.folder: d
        for d in (asked(BUILD.dataset, job.wildcards) for job in renders)
    }
    needs = []
    for dataset in datasets.values():
        views = presence.missing_views(dataset)
        size = views * view_cost(dataset).disk_bytes
        needs.append(disk_space.Need(Path(RESULTS), size, views))
    batches = [job.wildcards for job in jobs if is_of(job, "build_members")]
    for wildcards in batches:
        size = asked(BUILD.batch_cost, wildcards).disk_bytes
        needs.append(
            disk_space.Need(Path(RESULTS), size, asked(BUILD.batch_views, wildcards))
        )
    # A built scene takes at most 100 MB.
    for _ in {dataset.scene_name for dataset in datasets.values()}:
        needs.append(disk_space.Need(Path(WORK), 1e8))
    for folder in (RESULTS, WORK):
        outputs = [unstored(file) for job in jobs for file in job.output]
        files = sum(Path(output).is_relative_to(folder) for output in outputs)
        if files:
            needs.append(disk_space.Need(Path(folder), 0, files))
    if jobs:
        # Each job has a log.
        needs.append(disk_space.Need(Path(WORK), 0, len(jobs)))
    if renders and RUNS_HERE:
        # Each render job writes a view's passes to memory, or to TMPDIR if memory is too small.
        view_size = max(
            temporary_bytes(d.pixels, light_group_count(d)) for d in datasets.values()
        )
        at_once = min(len(renders), max(1, ALL_CORES // renders[0].threads))
        size = at_once * view_size
        if not disk_space.fast_folder(size):
            needs.append(disk_space.Need(Path(tempfile.gettempdir()), size))
    for warning in disk_space.check(needs):
        print(f"warning: {warning}", file=sys.stderr)


def take_folder():
    """Remove the locks of killed runs. End this run if another one makes the same files."""
    other_runs = live_runs.enter(Path(".snakemake/locks"), not RUNS_HERE, remove_locks)
    if files_are_locked():
        sys.exit(f"error: {live_runs.refusal(other_runs)}")
    keep_locks_of_others()


if IS_MAIN_PROCESS:
    before_lock(take_folder, lambda: quiet_snakemake())


def explain_full_disk():
    """Explain that Snakemake cannot write its notes, if it ended because of that."""
    if problem := obstacle(Path(".snakemake")):
        print(f"error: .snakemake: cannot be written: {problem}", file=sys.stderr)


def check_start():
    """Raise `UserError` for a run that cannot work, before the first job."""
    at_exit(explain_full_disk)
    check_device()
    check_memory()
    check_disk_space()
    check_consumers()


def check_input(job):
    """Raise `UserError` for a user's file that a job would refuse."""
    if is_of(job, "check_blend"):
        blend = Path(asked(BUILD.scene, job.wildcards).source.blend)
        if blend.is_file():
            expected_blend(job.wildcards.name, blend, sha256(blend))
    elif is_of(job, "inventory"):
        presence.check_external_files(asked(BUILD.scene, job.wildcards))
    elif is_of(job, "import_views"):
        presence.check_imported(asked(BUILD.dataset, job.wildcards))


def announce_refusals():
    """Print in a dry run what the real run would refuse."""
    checks = [check_device, check_memory, check_disk_space, check_consumers]
    checks += [functools.partial(check_input, job) for job in needed_jobs()]
    problems = {}
    for check in checks:
        try:
            check()
        except UserError as error:
            problems[str(error)] = None
    for problem in problems:
        print(f"would be refused: {problem}", file=sys.stderr)


def keep_shards():
    """Note the number of shards of each planned dataset, which keeps them."""
    jobs = [job for job in all_jobs() if is_of(job, "render")]
    datasets = {
        d.name: d for d in (asked(BUILD.dataset, job.wildcards) for job in jobs)
    }
    counts = {name: (d.view_count, len(d.shards)) for name, d in datasets.items()}
    if counts:
        clear_folder(SHARDS)
        shard_counts.note(WORK, counts)
        if STORE:
            ViewStore(STORE).send(SHARDS)


def remove_leftovers():
    """Remove what killed runs have left behind, and print how much."""
    removed = leftovers.remove(map(Path, (RESULTS, WORK)))
    if removed:
        print(
            f"removed {len(removed)} files and folders that killed runs have left",
            file=sys.stderr,
        )


def check_consumers():
    """Raise `UserError` for a job that learns without the consumers' environment."""
    learns = any(is_of(job, "measure_learning") for job in needed_jobs())
    if learns and not (CONSUMERS / "complete").exists():
        raise UserError(
            f"learn: torch is missing: set up {os.path.relpath(CONSUMERS)} "
            f"with `make -C {shlex.quote(os.path.relpath(FOLDER))} .venv-consumers/complete`"
        )
