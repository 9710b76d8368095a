"""The arguments of commands that take more than a look at a dataset, and the prefix of commands."""

import shlex
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from lightfield.configuration.dataset import Dataset
from lightfield.engine.bundles import VARIABLE
from lightfield.planning.loading import scene_datasets
from lightfield.workflow.job_plan import JobPlan
from lightfield.workflow.known_times import time_files
from lightfield.workflow.run import HasWildcards, Run


def optional(*names: str, **flags: str) -> Callable[[HasWildcards, Any], str]:
    """Return a params function: it returns the flags of the optional inputs that exist.

    An input's flag has the input's name, unless ``flags`` gives another.
    """
    flags |= dict(zip(names, names, strict=True))

    def arguments(wildcards: HasWildcards, input: Any) -> str:
        given = [(flag, input.get(name)) for flag, name in flags.items() if input.get(name)]
        return shlex.join(word for flag, path in given for word in (f"--{flag}", str(path)))

    return arguments


def status_arguments(plan: JobPlan) -> Callable[[HasWildcards], str]:
    """Return a params function: what names each chosen dataset and family to scripts/status.py."""

    def arguments(wildcards: HasWildcards) -> str:
        words = []
        for dataset in plan.run.chosen:
            reprojections = ",".join(dataset.reprojections)
            words += ["--dataset", dataset.name, str(dataset.view_count), reprojections]
            if plan.is_outdated(dataset):
                words += ["--outdated", dataset.name]
        for folder, scene in plan.run.build.family_names.items():
            words += ["--family", folder, scene]
        return shlex.join(words)

    return arguments


def equal_error_arguments(run: Run) -> str:
    """Return the arguments that tell scripts/plan.py what was measured of each chosen scene.

    A calibration tells more than `error_vs_time`.
    """
    arguments: list[str] = []
    for name, dataset in {d.sequence_name: d for d in run.chosen}.items():
        advice = f"{run.results}/benchmarks/error_vs_time/{dataset.scene_name}.json"
        if dataset.calibration:
            seconds = dataset.paths.calibration_seconds
            arguments += ["--calibration", name, dataset.calibration, seconds]
        elif Path(advice).exists():
            arguments += ["--advice", name, advice]
    return shlex.join(arguments)


def time_arguments(run: Run) -> str:
    """Return the arguments that tell scripts/plan.py about finished views of each chosen rig."""
    first_frames = {d.sequence_name: d for d in reversed(run.chosen) if not d.imported}
    return shlex.join(
        word for name, dataset in first_frames.items() for word in _finished(dataset, run, name)
    )


def time_arguments_of_rig(run: Run) -> Callable[[HasWildcards], str]:
    """Return a params function: what tells scripts/costs.py the time of a rig's full views."""

    def arguments(wildcards: HasWildcards) -> str:
        dataset = run.asked(run.build.dataset, wildcards)
        if dataset.imported:
            return ""
        full = dataset if dataset.member else replace(dataset, preset="full")
        files = time_files(full, run.settings)
        words = ["--probe", files.probe, "--gpu-check", files.gpu_check]
        return shlex.join([*map(str, words), *_finished(full, run)])

    return arguments


def time_arguments_of_scene(run: Run) -> Callable[[HasWildcards], str]:
    """Return a params function: what tells scripts/gpu_check.py the time of a scene's views."""

    def arguments(wildcards: HasWildcards) -> str:
        first = run.asked(lambda names: run.build.first_of_scene(names["scene"]), wildcards)
        words: list[str] = []
        for dataset in scene_datasets(first.scene_name, settings=run.settings):
            words += ["--probe", dataset.rig_folder, str(time_files(dataset, run.settings).probe)]
            words += _finished(dataset, run, dataset.rig_folder)
        return shlex.join(words)

    return arguments


def _finished(dataset: Dataset, run: Run, *name: str) -> list[str]:
    """Return the flags for views of a dataset that exist, also under other presets."""
    return [
        str(word)
        for lightfield, receipts in time_files(dataset, run.settings).finished
        if lightfield.exists()
        for word in ("--finished", *name, lightfield, receipts)
    ]


def shell_prefix(plan: JobPlan) -> str:
    """Return what the shell of each job does before its program.

    It replaces Snakemake's own prefix, including its strict mode. It also writes the signal that
    ended a program into the job's log. Programs get the paths of the rules, not of Snakemake's
    copies.
    """
    # The rules call `python`: the one that runs Snakemake, or a container's own.
    python = shlex.quote(str(Path(sys.executable).parent))
    return (
        f"set -euo pipefail; export {VARIABLE}={shlex.quote(plan.url)}; copies={plan.copies};"
        f" [[ -v APPTAINER_CONTAINER ]] || export PATH={python}:$PATH;"
        # Their messages are read as UTF-8, wherever the user is.
        " export PYTHONUTF8=1;"
        # numpy would start a thread for each core, also in jobs that have one core.
        " export OPENBLAS_NUM_THREADS=1;"
        # A signal to the whole group must not end the shell first.
        " trap : TERM INT;"
        ' python() {{ command python "${{@#"$copies"}}" || {{ local status=$?; if ((status > 128));'
        ' then echo "error: killed by SIG$(kill -l $status)" >&2; fi; return $status; }}; }}; '
    )
