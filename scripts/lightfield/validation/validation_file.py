"""Checks a dataset, or the exports of a sequence, and writes validation.json.

The checksums of a sequence are written here, too; `publish_checksums` writes those of a dataset.
"""

import sys
from os.path import normpath
from pathlib import Path

from lightfield.core import leftovers
from lightfield.core.errors import UserError
from lightfield.core.files import sha256, write_json
from lightfield.core.paths import place_in
from lightfield.engine.receipts import made_in
from lightfield.formats.layout import REPORT, SUMS, frame_folders, write_sums
from lightfield.formats.lightfield import NAME
from lightfield.stages.checks import Validate, ValidateSequence
from lightfield.validation import clipping, emptiness, pixels, sequence
from lightfield.validation.files import remove_strays
from lightfield.validation.result import Result
from lightfield.validation.validate import validate

# The checks whose warnings the terminal shows.
_SHOWN_WARNINGS = (clipping.NAME, emptiness.NAME, pixels.COUNTS)


def check(job: Validate) -> Result:
    """Check a dataset. Raises `UserError` if it is not valid and no validation.json says so."""
    _check_paths(job, job.dataset)
    reprojections = [normpath(name) for name in job.settings.reprojections]
    if job.output:
        (job.dataset / SUMS).unlink(missing_ok=True)
        # The report is made meanwhile.
        leftovers.remove_unfinished(job.dataset, age=0, excluded=REPORT)
    elif not reprojections:
        lightfields = sorted(job.dataset.glob(f"*/{NAME}"))
        reprojections = [path.parent.name for path in lightfields]
    exports = job.settings.exports
    export_lists = None if exports is None else [Path(path).resolve() for path in exports]
    if job.removed:
        remove_strays(job.dataset, reprojections, job.removed, export_lists)
    result = validate(
        job.dataset,
        reprojections,
        job.clearance,
        job.inventory,
        job.processes,
        job.splits,
        export_lists,
        made_in(job.dataset, job.settings.inputs, job.work_folder),
    )
    _print(result)
    if job.output:
        write_json(job.output, result.to_json())
        return result
    sums = job.dataset / SUMS
    if sums.is_file():
        print(
            f"note: {sums}: is compared only by python scripts/verify.py {job.dataset}",
            file=sys.stderr,
        )
    if not result.valid:
        raise UserError(f"{job.dataset}: is not valid")
    return result


def check_sequence(job: ValidateSequence) -> None:
    """Check the exports of a sequence. Raises `UserError` if they are not valid."""
    _check_paths(job, job.rig)
    frames = job.settings.frames or frame_folders(job.rig)
    lists = sequence.export_lists(job.rig)
    if job.settings.exports is not None:
        lists = [Path(path) for path in job.settings.exports]
    if job.removed:
        sequence.remove_strays(job.rig, frames, lists, job.removed)
    result = sequence.validate_sequence(job.rig, frames, lists)
    _print(result)
    if not result.valid:
        raise UserError(f"{job.rig}: the exports of its sequence are not valid")
    if job.output and job.sums:
        write_json(job.output, result.to_json())
        sums = dict(result.checksums)
        if place := place_in(job.rig, job.output):
            sums[place.as_posix()] = sha256(job.output)
        write_sums(job.sums, sums)


def _check_paths(job: Validate | ValidateSequence, folder: Path) -> None:
    """Raise `UserError` if there is no folder to check, or if one of two outputs is missing."""
    if isinstance(job, ValidateSequence) and (job.output is None) != (job.sums is None):
        raise UserError("--output, --sums: give both, or neither")
    if not folder.is_dir():
        raise UserError(f"{folder}: no such folder")


def _print(result: Result) -> None:
    print(result.summary())
    # The terminal shows lines with this word. No picture of the page shows what these lines say.
    for check in result.checks:
        for warning in check.warnings if check.name in _SHOWN_WARNINGS else ():
            print(f"warning: {warning}", file=sys.stderr)
    for line in result.failures():
        print(line, file=sys.stderr)
