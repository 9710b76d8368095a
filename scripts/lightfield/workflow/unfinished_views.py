"""Counts the views that the jobs of a plan will render: those that no earlier run has finished."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lightfield.configuration.dataset import Dataset
from lightfield.engine import receipts
from lightfield.workflow.job_plan import JobPlan, PlannedJob
from lightfield.workflow.jobs import INVENTORY, LIGHTFIELD

# The settings of a light field that change no view's key, as the check names them.
_NOT_OF_VIEWS = {"setting spread_version"}
_RIG = "setting rig"


def unfinished_views(plan: JobPlan, planned: PlannedJob) -> int:
    """Return how many views of a job that renders a shard are not finished.

    All of them, if the job may give them other keys. A new split does not, nor do more views of a
    random rig, so their files stay.
    """
    names = planned.names
    dataset = plan.run.asked(plan.run.build.dataset, names)
    views = int(names["end"]) - int(names["first"])
    if not _keep_their_keys(plan, dataset):
        return views
    receipt = plan.receipt_path(planned.name)
    verdict = plan.check.verdicts.get(receipt)
    if verdict and verdict.outdated:
        return views
    outputs, _ = receipts.noted(Path(receipt))
    finished = {
        path
        for path, output in outputs.items()
        if Path(path).parent == Path(dataset.paths.views) and output.is_intact(path)
    }
    return max(0, views - len(finished))


def _keep_their_keys(plan: JobPlan, dataset: Dataset) -> bool:
    """Return whether the finished views of a dataset keep their keys, as far as the plan knows."""
    scene = plan.receipt_path(INVENTORY.name.format(name=dataset.scene_folder))
    if plan.check.will_run(scene):
        return False
    receipt = plan.receipt_path(LIGHTFIELD.name_of(dataset))
    verdict = plan.check.verdicts.get(receipt)
    if verdict is None or verdict.is_fine:
        return not plan.check.will_run(receipt)
    if verdict.damaged or not {*verdict.outdated} <= _NOT_OF_VIEWS | {_RIG}:
        return False
    earlier = receipts.read(receipt)
    planned = plan.asked.get(receipt)
    if earlier is None or planned is None or planned.job.settings is None:
        return False
    _, wanted = planned.job.settings(plan.run.build, planned.names)
    return _of_views(earlier.settings) == _of_views(wanted)


def _of_views(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a rig that place the views it has: without its split and its imu.

    The number of views moves no camera of a random rig.
    """
    rig = settings["rig"]
    left_out = {"split", "imu"} | ({"count"} if rig["type"] == "random" else set())
    return {key: value for key, value in rig.items() if key not in left_out}
