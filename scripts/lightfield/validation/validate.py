"""Checks a finished dataset: that it is complete, and that every claim about it is true.

`validate` reads every image once, in as many processes as it is given, for what a single file can
tell (`pixels`). It reads the views with depth once more, for what only several views together can
tell (`geometry`). Before that it reads the exports back (`exported_cameras`). The depth in exports
is compared while the views are read (`exported_depth`). Memory holds a few hundred points of each
view, and the exported points.

The result is a list of checks. Each has passed, failed, or does not apply. What could not be
checked does not apply, and the check says why.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import OpenImageIO as oiio

from lightfield.core.errors import UserError
from lightfield.core.failures import LESS_MEMORY
from lightfield.core.files import sha256
from lightfield.core.progress import Progress
from lightfield.dataset.inventory import read_inventory
from lightfield.dataset.shard_files import read_record
from lightfield.validation import (
    depth_questions,
    exported_cameras,
    files,
    geometry,
    machines,
    pixels,
    splits_check,
)
from lightfield.validation.consistency import Answer
from lightfield.validation.depth_questions import Question
from lightfield.validation.exported_depth import ExportedDepth
from lightfield.validation.files import File, ImageSet, Manifest
from lightfield.validation.pixels import Examiner, Facts
from lightfield.validation.result import Check, Result


def validate(
    dataset: Path,
    reprojections: Sequence[str] = (),
    records: Sequence[Path] = (),
    clearance: Path | None = None,
    inventory: Path | None = None,
    processes: int = 1,
    manifests: Sequence[Manifest] = (),
    splits: Path | None = None,
    wanted: Collection[Path] | None = None,
    noted: Mapping[str, str] | None = None,
) -> Result:
    """Check a dataset's files, and what its pixels must satisfy.

    - ``reprojections``: folders in the dataset.
    - ``records``: JSON files of what was rendered (``files``: path: ``bytes``, ``sha256``).
    - ``clearance``: a JSON file of what surrounds each camera (``views``: name: ``distance`` in
      metres, ``inside``).
    - ``inventory``: a JSON file of what the scene contains.
    - ``manifests``: the kinds of exports that the dataset may hold.
    - ``splits``: the scene's splits.json, if it has one.
    - ``wanted``: the lists of the exports that the dataset must have; None takes those that exist.
    - ``noted``: the SHA-256 of files when they were made, by their paths in the dataset.

    Raises `UserError` if one of these cannot be read. All faults of the dataset are in the result.
    """
    dataset = dataset.resolve()
    volumes = read_inventory(inventory, "volumes")["volumes"] if inventory else []
    sets, checks = files.read_sets(dataset, reprojections)
    views, presence_checks = files.of_views(dataset, sets)
    passes, missing_passes = files.of_passes(dataset, sets)
    extras, export_files, exports_check = files.of_exports(dataset, sets, views, manifests, wanted)
    # What needs no images comes first: a wrong file stops the run before hours of reading.
    recorded_sums = _recorded_sums(records)
    cameras_check = files.clearance(clearance, sets)
    splits_checks = [splits_check.check(splits, dataset, sets)] if splits else []
    export_checks, exported = exported_cameras.check(dataset, sets, manifests, wanted)
    checks += export_checks
    exported_depth = ExportedDepth(dataset, sets, exported)
    with _workers(Examiner(dataset, sets), processes) as mapped:
        facts = _read_images(dataset, views + passes + extras, exported_depth, mapped)
        for number, image_set in enumerate(sets):
            set_facts = {file: facts[file] for file in views if file.set == number}
            checks.append(presence_checks[number])
            checks += _check_set(image_set, set_facts, volumes, mapped)
        answers = {(f.set, f.view): fact.of_depth for f, fact in facts.items() if fact.of_depth}
        checks += exported_depth.checks(answers, lambda asked: mapped(_answer_depth, asked))
    if passes or missing_passes:
        checks.append(pixels.of_passes({file: facts[file] for file in passes}, missing_passes))
    checks.append(pixels.with_extras(exports_check, {file: facts[file] for file in extras}))
    digests, files_checks = _check_files(
        dataset, sets, facts, export_files, recorded_sums, noted or {}
    )
    if len(sets) <= len(reprojections):
        files_checks[0] = UNLISTED
    checks += [*files_checks, cameras_check, *splits_checks]
    rendered = files.rendered(sets)
    return Result(
        f"{dataset.parent.name}/{dataset.name}",
        len(rendered.views) if rendered else 0,
        checks,
        digests,
    )


Mapped = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]
Sums = dict[str, tuple[int, str]]
"""The size in bytes and the SHA-256 of files, by their paths in the dataset."""


# Of a dataset whose sets could not all be read.
UNLISTED = Check("files", None, "a lightfield.json that cannot be understood lists no files")


def _recorded_sums(records: Sequence[Path]) -> Sums | None:
    """Return what the records say of the images, or None without records."""
    if not records:
        return None
    return dict(sums for record in records for sums in read_record(record).items())


def _read_images(
    dataset: Path, images: Sequence[File], exported_depth: ExportedDepth, mapped: Mapped
) -> dict[File, Facts]:
    """Read each image once, and return what it tells by itself."""
    facts: dict[File, Facts] = {}
    progress = Progress(len(images), f"validate {dataset.name}", "files")
    with_questions = [(file, exported_depth.question(file)) for file in images]
    for file, fact in mapped(_examine, with_questions):
        facts[file] = fact
        progress.done()
    return facts


def _check_set(
    image_set: ImageSet, facts: Mapping[File, Facts], volumes: Sequence[Any], mapped: Mapped
) -> list[Check]:
    """Return the checks of one set's pixels, of its geometry, and of the machines that made it."""
    patches = {file: fact.patches for file, fact in facts.items() if fact.patches is not None}
    return [
        *pixels.checks(image_set, facts, volumes),
        geometry.check(image_set, patches, lambda asked: mapped(_answer, asked)),
        *machines.check(image_set.lightfield, [fact.machine for fact in facts.values()]),
    ]


def _check_files(
    dataset: Path,
    sets: Sequence[ImageSet],
    facts: Mapping[File, Facts],
    export_files: Sequence[str],
    recorded_sums: Sums | None,
    noted: Mapping[str, str],
) -> tuple[dict[str, str], list[Check]]:
    """Return the SHA-256 of each published file, and the checks of the files and of their sums."""
    sums = {file.path: (fact.bytes, fact.checksum) for file, fact in facts.items()}
    sums |= _sums_of_names(dataset, sets)
    published, files_check = files.listing(dataset, sets, {*export_files, *sums})
    digests = {
        path: sums[path][1] if path in sums else sha256(dataset / path) for path in published
    }
    altered = files.altered(digests, noted)
    return digests, [files_check, files.checksums(recorded_sums, sums, sets, altered)]


def _sums_of_names(dataset: Path, sets: Sequence[ImageSet]) -> Sums:
    """Return the sums of the files that name the objects, materials and instances of passes."""
    paths = {name: dataset / name for name in files.names(sets)}
    return {
        name: (path.stat().st_size, sha256(path)) for name, path in paths.items() if path.is_file()
    }


@contextmanager
def _workers(examiner: Examiner, processes: int) -> Iterator[Mapped]:
    """Yield a `map` over worker processes that hold the examiner. One process is this one."""
    if processes == 1:
        _start_worker(examiner)
        yield map
        return
    try:
        # Spawn workers: the threads of OpenImageIO do not survive a fork.
        with ProcessPoolExecutor(
            processes, get_context("spawn"), initializer=_start_worker, initargs=(examiner,)
        ) as pool:
            yield pool.map
    except BrokenProcessPool:
        raise UserError(
            f"{examiner.dataset}: a process that reads it was killed; most likely memory ran out: "
            f"{LESS_MEMORY}"
        ) from None


_examiner: Examiner


def _start_worker(examiner: Examiner) -> None:
    global _examiner
    _examiner = examiner
    oiio.attribute("threads", 1)
    oiio.attribute("exr_threads", 1)


def _examine(asked: tuple[File, Question | None]) -> tuple[File, Facts]:
    file, question = asked
    return file, _examiner.examine(file, question)


def _answer_depth(asked: tuple[File, Question]) -> depth_questions.Answer | None:
    return _examiner.answer_depth(*asked)


def _answer(question: geometry.Question) -> list[Answer]:
    return _examiner.answer(*question)
