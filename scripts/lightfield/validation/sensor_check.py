"""Checks the files of sensors' parameters: each view has those that the sensor's settings give."""

from collections.abc import Sequence
from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.formats.layout import ImageSet, rendered, source_view
from lightfield.formats.sensors import parameter_file
from lightfield.imaging.sensor import SensorParameters
from lightfield.reprojection.sensor import parameters_of
from lightfield.validation.result import Check


def checks(dataset: Path, sets: Sequence[ImageSet]) -> list[Check]:
    """Return a check of the parameters of each set that a sensor developed."""
    return [_check(dataset, sets, image_set) for image_set in sets if image_set.sensor]


def _check(dataset: Path, sets: Sequence[ImageSet], image_set: ImageSet) -> Check:
    faults = {}
    for view in image_set.views:
        path = f"{image_set.folder}/{parameter_file(view)}"
        if fault := _fault(dataset / path, rendered(sets), image_set, view):
            faults[path] = fault
    detail = f"{len(image_set.views) - len(faults)} views have the sensor's parameters"
    return Check.of_files(f"{image_set.prefix}sensor", faults, detail)


def _fault(path: Path, source: ImageSet | None, image_set: ImageSet, view: str) -> str | None:
    """Return what is wrong with the file of a view's parameters. None if nothing is."""
    if not path.is_file():
        return "is missing"
    try:
        parameters = SensorParameters.from_json(read_json(path))
    except UserError as error:
        return str(error).removeprefix(f"{path}: ")
    number = source_view(source, view)
    if source is None or number is None or image_set.sensor is None:
        return None
    name = source.views[number]
    frame = source.lightfield.content.get("frame", 0)
    expected = parameters_of(image_set.sensor, number, name, view.removeprefix(name), frame)
    return None if parameters == expected else "differs from what the sensor's settings give"
