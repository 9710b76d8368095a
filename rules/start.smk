# Checks, notes and removals before the first job.
import functools
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from lightfield.configuration.blend_lock import expected_blend
from lightfield.core import disk_space, leftovers, units
from lightfield.core.disk_space import check_folder
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.planning.cost import light_group_count, temporary_bytes, view_cost
from lightfield.planning.phases import KINDS
from lightfield.stages.measurement import RENDERS_ON
from lightfield.workflow import presence, run_lock

# With less address space, in bytes, the import of bpy crashes, or no thread starts.
LEAST_ADDRESS_SPACE = 1.5e9


# The jobs that render on the device.
RENDERING = (
    "{scene}/{rig}/render/{first}-{end}",
    "{scene}/{rig}/panorama/render",
    "{scene}/{rig}/probe",
    "{scene}/calibrate",
    "{scene}/error_vs_time",
    "{scene}/gpu_check",
    "{family}/batches/{batch}",
)


def is_import(job, names):
    """Return whether a job imports views instead of rendering them."""
    return KINDS[job].stage == "render" and asked(BUILD.dataset, names).imported


def check_device():
    """Print on which GPU this machine renders. Raise `UserError` if the device is missing."""
    jobs = [job for job, names in planned_jobs() if not is_import(job, names)]
    device = SETTINGS.device
    if device == "auto" and "{scene}/gpu_check" in jobs:
        device = "gpu"
    renders = any(job in RENDERING for job in jobs)
    if renders and RUNS_HERE and (GPUS or device == "gpu"):
        command = [sys.executable, FOLDER / "scripts/check_device.py", device]
        checked = subprocess.run(
            command, capture_output=True, encoding="utf-8", errors="replace"
        )
        if checked.returncode:
            lines = checked.stderr.strip().splitlines() or ["it said nothing"]
            raise UserError(lines[-1].removeprefix("error: "))
        if device == SETTINGS.device:
            for line in checked.stdout.splitlines():
                if line.startswith(RENDERS_ON):
                    print(line, file=sys.stderr)


def check_slurm():
    """Raise `UserError` if jobs go to Slurm, and no Slurm answers here."""
    if not DISPLAY.uses_slurm:
        return
    try:
        asked_slurm = subprocess.run(
            ["sinfo"], capture_output=True, encoding="utf-8", errors="replace"
        )
    except OSError:
        problem = "there is no command sinfo"
    else:
        lines = asked_slurm.stderr.strip().splitlines()
        problem = lines[-1] if asked_slurm.returncode and lines else ""
    if problem:
        raise UserError(
            f"--executor slurm: no Slurm answers: {problem}: run this on a login node"
        )


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
    jobs = planned_jobs()
    renders = [names for job, names in jobs if KINDS[job].stage == "render"]
    batches = [names for job, names in jobs if KINDS[job].stage == "build_members"]
    datasets = {
        d.paths.folder: d for d in (asked(BUILD.dataset, names) for names in renders)
    }
    needs = []
    for dataset in datasets.values():
        views = presence.missing_views(dataset)
        size = views * view_cost(dataset).disk_bytes
        needs.append(disk_space.Need(Path(RESULTS), size, views))
    for names in batches:
        size = asked(BUILD.batch_cost, names).disk_bytes
        views = asked(BUILD.batch_views, names)
        needs.append(disk_space.Need(Path(RESULTS), size, views))
    # A built scene takes at most 100 MB.
    for _ in {dataset.scene_name for dataset in datasets.values()}:
        needs.append(disk_space.Need(Path(WORK), 1e8))
    if jobs:
        # Most jobs write one file beside the views. Each has a log and a receipt.
        needs.append(disk_space.Need(Path(RESULTS), 0, len(jobs)))
        needs.append(disk_space.Need(Path(WORK), 0, 2 * len(jobs)))
    if renders and RUNS_HERE:
        # Each render job writes a view's passes to memory, or to TMPDIR if memory is too small.
        view_size = max(
            temporary_bytes(d.pixels, light_group_count(d)) for d in datasets.values()
        )
        at_once = min(len(renders), max(1, ALL_CORES // threads_of_shard(renders[0])))
        size = at_once * view_size
        if not disk_space.fast_folder(size):
            needs.append(disk_space.Need(Path(tempfile.gettempdir()), size))
    for warning in disk_space.check(needs):
        print(f"warning: {warning}", file=sys.stderr)


def explain_full_disk():
    """Explain that Snakemake cannot write its notes, if it ended because of that."""
    try:
        check_folder(Path(".snakemake"))
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)


@functools.cache
def end_unless_writable(folder):
    """End the run with one line if nothing can be written in the folder of a job."""
    try:
        check_folder(Path(folder))
    except UserError as error:
        sys.exit(f"error: {error}")


def wait_until_past(paths):
    """Wait until files are older than the mark, or end the run with one line if it takes long.

    The clock of the machine that wrote them may be ahead. Snakemake starts a job only if an input is
    newer than what the job made before.
    """
    try:
        presence.check_times(paths, [RESULTS, WORK])
    except UserError as error:
        sys.exit(f"error: {error}")
    ahead = max(map(presence.time_of, paths)) - time.time()
    if ahead >= 0:
        time.sleep(ahead + 0.01)
        new_mark.cache_clear()


def check_start():
    """Raise `UserError` for a run that cannot work, before the first job."""
    DISPLAY.at_close(explain_full_disk)
    check_folders()
    check_slurm()
    check_device()
    check_memory()
    check_disk_space()
    check_times()


def check_times():
    """Raise `UserError` for a file that jobs of this run read, and whose time is in the future.

    Snakemake would refuse what the job makes, because it is older.
    """
    inputs = dict(JOBS)
    paths = {}
    for job, names in planned_jobs():
        paths |= dict.fromkeys(flat(inputs[job](names)[0].values()))
    paths = [path for path in paths if not CHECK.is_made(path)]
    presence.check_times(paths, [RESULTS, WORK])


def check_input(job, names):
    """Raise `UserError` for a user's file that a job would refuse."""
    stage = KINDS[job].stage
    if stage == "check_blend":
        blend = Path(asked(BUILD.scene, names).source.blend)
        if blend.is_file():
            expected_blend(names.name, blend, sha256(blend))
    elif stage == "inventory":
        presence.check_external_files(asked(BUILD.scene, names))
    elif is_import(job, names):
        presence.check_imported(asked(BUILD.dataset, names))


def announce_refusals():
    """Print in a dry run what the real run would refuse."""
    checks = [check_folders, check_device, check_memory, check_disk_space, check_times]
    checks += [functools.partial(check_input, *planned) for planned in planned_jobs()]
    problems = {}
    for check in checks:
        try:
            check()
        except UserError as error:
            problems[str(error)] = None
    for problem in problems:
        print(f"would be refused: {problem}", file=sys.stderr)


def remove_leftovers():
    """Remove what killed runs have left behind, and print how much."""
    removed = leftovers.remove(map(Path, (RESULTS, WORK)))
    if removed:
        print(
            f"removed {len(removed)} files and folders that killed runs have left",
            file=sys.stderr,
        )
