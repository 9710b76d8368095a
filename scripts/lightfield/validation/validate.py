"""Is a finished dataset whole and right? Every file is read, and every claim about it is tried.

`validate` reads every image once, in as many processes as it is given, for what one file can tell
(`pixels`); the views with depth are read once more for what only several views together can tell
(`geometry`). Exports are read back before (`exported_cameras`); what they say of depth is compared
while the views are read (`exported_depth`). Memory holds a few hundred points a view, and the
exported ones.

The result is a list of checks, each passed, failed, or not applicable and why: what could not be
checked is said, never counted as right.
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
from lightfield.dataset.records import read as read_record
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
from lightfield.validation.files import File, Manifest
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

    ``reprojections`` are folders in the dataset; ``records`` JSON files of what was rendered
    (``files``: relative path: ``bytes``, ``sha256``); ``clearance`` a JSON file of what surrounds
    each camera (``views``: name: ``distance`` in metres, ``inside``); ``inventory`` one of what the
    scene contains; ``manifests`` those of the exports that it may hold; ``splits`` the scene's
    splits.json, if it has one; ``wanted`` those of the exports' lists that it is to have, if it is
    not every one that is there; ``noted`` the SHA-256 of files by their path in the dataset, as
    they were when they were made. Raises `UserError` where one of these cannot be read; whatever is
    wrong with the dataset is in the result.
    """
    dataset = dataset.resolve()
    volumes = read_inventory(inventory, "volumes")["volumes"] if inventory else []
    sets, checks = files.read_sets(dataset, reprojections)
    views, presence = files.of_views(dataset, sets)
    passes, missing = files.of_passes(dataset, sets)
    extras, lists, exports = files.of_exports(dataset, sets, views, manifests, wanted)
    # What does not follow from the images comes first: a wrong file of it costs no hours.
    written = [sums for record in records for sums in read_record(record).items()]
    cameras = files.clearance(clearance, sets)
    split = [splits_check.check(splits, dataset, sets)] if splits else []
    of_cameras, exported = exported_cameras.check(dataset, sets, manifests, wanted)
    checks += of_cameras
    exported_depth = ExportedDepth(dataset, sets, exported)
    facts: dict[File, Facts] = {}
    with _workers(Examiner(dataset, sets), processes) as mapped:
        images = views + passes + extras
        progress = Progress(len(images), f"validate {dataset.name}", "files")
        with_questions = [(file, exported_depth.question(file)) for file in images]
        for file, fact in mapped(_examine, with_questions):
            facts[file] = fact
            progress.done()
        for number, image_set in enumerate(sets):
            own = {file: facts[file] for file in views if file.set == number}
            seen = {file: fact.patches for file, fact in own.items() if fact.patches is not None}
            checks += [presence[number], *pixels.checks(image_set, own, volumes)]
            checks.append(geometry.check(image_set, seen, lambda asked: mapped(_answer, asked)))
            checks += machines.check(image_set.lightfield, [fact.machine for fact in own.values()])
        answers = {(f.set, f.view): fact.of_depth for f, fact in facts.items() if fact.of_depth}
        checks += exported_depth.checks(answers, lambda asked: mapped(_answer_depth, asked))
    if passes or missing:
        checks.append(pixels.of_passes({file: facts[file] for file in passes}, missing))
    checks.append(pixels.with_extras(exports, {file: facts[file] for file in extras}))
    found = {file.path: (fact.bytes, fact.checksum) for file, fact in facts.items()}
    for name in files.names(sets):
        if (dataset / name).is_file():
            found[name] = (dataset / name).stat().st_size, sha256(dataset / name)
    published, listing = files.listing(dataset, sets, {*lists, *found})
    if len(sets) <= len(reprojections):
        listing = Check("files", None, "a lightfield.json that cannot be understood lists no files")
    digests = {
        path: found[path][1] if path in found else sha256(dataset / path) for path in published
    }
    altered = files.altered(digests, noted or {})
    sums = files.checksums(dict(written) if records else None, found, sets, altered)
    checks += [listing, sums, cameras, *split]
    rendered = files.rendered(sets)
    return Result(
        f"{dataset.parent.name}/{dataset.name}",
        len(rendered.views) if rendered else 0,
        checks,
        digests,
    )


Mapped = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]


@contextmanager
def _workers(examiner: Examiner, processes: int) -> Iterator[Mapped]:
    """Yield a `map` over worker processes that hold the examiner; one process is this one."""
    if processes == 1:
        _start_worker(examiner)
        yield map
        return
    try:
        # Spawned, because OpenImageIO has threads, which do not survive a fork.
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
