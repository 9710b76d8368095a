"""Checks a finished dataset: that it is complete, and that every claim about it is true.

`validate` reads every image once, and checks each by itself (`pixels`). Then it reads the views
with depth again, and compares them with each other (`geometry`). Memory holds a few hundred points
of each view. It checks that the files of exports are as they were written. That exporters write the
right numbers is up to the tests.

The result is a list of checks. Each has passed, failed, or does not apply. A check that does not
apply says why.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import OpenImageIO as oiio

from lightfield.core.errors import LESS_MEMORY, OutsideError
from lightfield.core.files import absolute_path, read_watchers, sha256
from lightfield.core.progress import Progress
from lightfield.engine.read_files import ReadFiles
from lightfield.engine.receipts import Output
from lightfield.formats import layout
from lightfield.formats.inventory import read_inventory
from lightfield.formats.layout import File, ImageSet
from lightfield.formats.lightfield import MACHINE, LightField
from lightfield.validation import clipping, emptiness, files, geometry, pixels, splits_check
from lightfield.validation.consistency import Answer
from lightfield.validation.pixels import Examiner, ImageFacts
from lightfield.validation.result import Check, Result


def validate(
    dataset: Path,
    reprojections: Sequence[str] = (),
    clearance: Path | None = None,
    inventory: Path | None = None,
    processes: int = 1,
    splits: Path | None = None,
    export_lists: Collection[Path] | None = None,
    made: Mapping[str, Output] | None = None,
) -> Result:
    """Check a dataset's files and pixels.

    - ``reprojections``: folders in the dataset.
    - ``clearance``: a JSON file with each camera's distance to the nearest surface (``views``:
      name: ``distance`` in metres, ``inside``).
    - ``inventory``: a JSON file of what the scene contains.
    - ``splits``: the scene's splits.json, if it has one.
    - ``export_lists``: the lists of the exports that the dataset must have. None takes all that
      exist.
    - ``made``: the outputs of jobs in their receipts, by their paths in the dataset.
    - ``processes``: the most processes that read images. Small datasets take fewer.

    Raises `UserError` if one of these cannot be read. The result holds all faults of the dataset.
    """
    dataset = absolute_path(dataset)
    volumes = read_inventory(inventory, "volumes")["volumes"] if inventory else []
    sets, checks = files.read_sets(dataset, reprojections)
    views, presence_checks = files.of_views(dataset, sets)
    passes, missing_passes = layout.pass_files(dataset, sets)
    extras, export_files, exports_check = files.of_exports(dataset, sets, views, export_lists)
    # Check first everything that needs no images: a wrong file then stops the run before hours of
    # reading.
    cameras_check = files.clearance(clearance, sets)
    splits_checks = [splits_check.check(splits, dataset, sets)] if splits else []
    images = views + passes + extras
    workers = _workers(
        Examiner(dataset, sets), min(processes, _worthwhile_processes(dataset, images)), made or {}
    )
    with workers as parallel_map:
        facts, image_checks = _check_images(
            dataset, sets, images, presence_checks, volumes, parallel_map
        )
    checks += image_checks
    if passes or missing_passes:
        checks.append(pixels.of_passes({file: facts[file] for file in passes}, missing_passes))
    checks.append(pixels.with_extras(exports_check, {file: facts[file] for file in extras}))
    emptiness_checks = _emptiness_checks(sets, facts, clearance, volumes)
    checks += emptiness_checks or _clipping_checks(dataset, sets, facts, export_lists)
    digests, files_checks = _check_files(dataset, sets, facts, export_files, made or {})
    if len(sets) <= len(reprojections):
        files_checks[0] = _UNLISTED
    checks += [*_sensor_checks(dataset, sets), *files_checks, cameras_check, *splits_checks]
    rendered = layout.rendered(sets)
    view_count = len(rendered.views) if rendered else 0
    return Result(f"{dataset.parent.name}/{dataset.name}", view_count, checks, digests)


_ParallelMap = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]
"""Applies a function to each item of a sequence, in worker processes."""

_Sums = dict[str, tuple[int, str]]
"""The size in bytes and the SHA-256 of files, by their paths in the dataset."""


# Stands for the check of the files while a lightfield.json cannot be read.
_UNLISTED = Check("files", None, "a lightfield.json that cannot be understood lists no files")


def _emptiness_checks(
    sets: Sequence[ImageSet],
    facts: Mapping[File, ImageFacts],
    clearance: Path | None,
    volumes: Sequence[str],
) -> list[Check]:
    """Return a check if no rendered view shows a surface."""
    rendered_set = layout.rendered(sets)
    if rendered_set is None:
        return []
    views = {file: fact for file, fact in facts.items() if file.is_view and file.set == 0}
    return emptiness.checks(rendered_set, views, clearance, volumes)


def _clipping_checks(
    dataset: Path,
    sets: Sequence[ImageSet],
    facts: Mapping[File, ImageFacts],
    export_lists: Collection[Path] | None,
) -> list[Check]:
    """Return a check of the pictures in which light is lost, if there are any."""
    lights: dict[int, clipping.Counts] = {}
    for file, fact in facts.items():
        if fact.light is not None:
            lights[file.set] = lights.get(file.set, 0) + fact.light
    sets_of_png = {file.set for file in facts if file.is_view and file.path.endswith(".png")}
    return clipping.checks(dataset, sets, lights, sets_of_png, export_lists)


def _sensor_checks(dataset: Path, sets: Sequence[ImageSet]) -> list[Check]:
    """Return a check of each set that a sensor developed."""
    if not any(image_set.sensor for image_set in sets):
        return []
    # Import it only here, because it imports numba.
    from lightfield.validation import sensor_check

    return sensor_check.checks(dataset, sets)


# A process starts in the time in which it reads about this many bytes of images.
BYTES_PER_PROCESS = 16_000_000


def _worthwhile_processes(dataset: Path, images: Sequence[File]) -> int:
    """Return how many processes read the images sooner than fewer would."""
    paths = [dataset / image.path for image in images]
    image_bytes = sum(path.stat().st_size for path in paths if path.is_file())
    return 1 + image_bytes // BYTES_PER_PROCESS


def _check_images(
    dataset: Path,
    sets: Sequence[ImageSet],
    images: Sequence[File],
    presence_checks: Sequence[Check],
    volumes: Sequence[str],
    parallel_map: _ParallelMap,
) -> tuple[dict[File, ImageFacts], list[Check]]:
    """Read all images. Return their facts, and the checks of each set.

    A set's check in ``presence_checks`` comes before the set's other checks.
    """
    checks = []
    facts = _read_images(dataset, images, parallel_map)
    for number, image_set in enumerate(sets):
        views = {file: fact for file, fact in facts.items() if file.is_view and file.set == number}
        checks.append(presence_checks[number])
        checks += _check_set(image_set, views, volumes, parallel_map)
    return facts, checks


def _read_images(
    dataset: Path, images: Sequence[File], parallel_map: _ParallelMap
) -> dict[File, ImageFacts]:
    """Read each image once, and return the findings about it."""
    facts: dict[File, ImageFacts] = {}
    progress = Progress(len(images), f"validate {dataset.name}", "files")
    for file, fact in parallel_map(_examine, images):
        facts[file] = fact
        progress.done()
    return facts


def _check_set(
    image_set: ImageSet,
    facts: Mapping[File, ImageFacts],
    volumes: Sequence[str],
    parallel_map: _ParallelMap,
) -> list[Check]:
    """Return the checks of one set's pixels, its geometry, and the machines that rendered it."""
    patches = {file: fact.patches for file, fact in facts.items() if fact.patches is not None}
    return [
        *pixels.checks(image_set, facts, volumes),
        geometry.check(image_set, patches, lambda questions: parallel_map(_answer, questions)),
        *_machines_checks(image_set.lightfield, [fact.machine for fact in facts.values()]),
    ]


def _machines_checks(lightfield: LightField, machines: Iterable[str | None]) -> list[Check]:
    """Count the views by the machine in their headers. Return no check if no header names one.

    Warns about several machines, and about a machine that lightfield.json does not name. Such views
    are right, but another build would not have the same bytes.
    """
    counts = Counter(sorted(machine for machine in machines if machine))
    if not counts:
        return []
    detail = ", ".join(f"{count} on {machine}" for machine, count in counts.items())
    first_machine = str(lightfield.content.get(MACHINE, ""))
    # A GPU's name precedes the name of its machine.
    unnamed_machines = [machine for machine in counts if not machine.endswith(first_machine)]
    warnings = []
    if len(counts) > 1 or unnamed_machines:
        addition = f"; lightfield.json names {first_machine}" if unnamed_machines else ""
        warnings = [f"views of unlike machines may differ in last digits: {detail}{addition}"]
    return [Check("machines", True, detail, warnings=warnings, figures=dict(counts))]


def _check_files(
    dataset: Path,
    sets: Sequence[ImageSet],
    facts: Mapping[File, ImageFacts],
    export_files: Sequence[str],
    made: Mapping[str, Output],
) -> tuple[dict[str, str], list[Check]]:
    """Return the SHA-256 of each published file, and the checks of the files and of their sums."""
    sums = {file.path: (fact.bytes, fact.checksum) for file, fact in facts.items()}
    sums |= _sums_of_side_files(dataset, sets)
    published, files_check = files.listing(dataset, sets, {*export_files, *sums})
    digests = {
        path: sums[path][1] if path in sums else sha256(dataset / path) for path in published
    }
    return digests, [files_check, files.checksums(made, sums, digests, sets)]


def _sums_of_side_files(dataset: Path, sets: Sequence[ImageSet]) -> _Sums:
    """Return the sums of the files beside images."""
    paths = {name: dataset / name for name in layout.side_files(sets)}
    return {
        name: (path.stat().st_size, sha256(path)) for name, path in paths.items() if path.is_file()
    }


@contextmanager
def _workers(
    examiner: Examiner, processes: int, made: Mapping[str, Output]
) -> Iterator[_ParallelMap]:
    """Yield a `map` over worker processes that hold the examiner.

    With one process, it is this process. Others compare the files that they read with ``made``, as
    the receipt of the job does in this process.
    """
    if processes == 1:
        _start_worker(examiner)
        yield map
        return
    try:
        # Spawn workers: the threads of OpenImageIO do not survive a fork.
        with ProcessPoolExecutor(
            processes,
            get_context("spawn"),
            initializer=_start_worker,
            initargs=(examiner, {path: output.stamp.sha256 for path, output in made.items()}),
        ) as pool:
            yield pool.map
    except BrokenProcessPool:
        raise OutsideError(
            f"{examiner.dataset}: a process that reads it was killed; most likely memory ran out: "
            f"{LESS_MEMORY}"
        ) from None


_examiner: Examiner
# Only a worker process has files here.
_read_files = ReadFiles()


def _start_worker(examiner: Examiner, made: Mapping[str, str] | None = None) -> None:
    global _examiner
    _examiner = examiner
    oiio.attribute("threads", 1)
    oiio.attribute("exr_threads", 1)
    if made:
        sums = {str(examiner.dataset / path): digest for path, digest in made.items()}
        read_watchers.append(lambda path: _read_files.read_made(str(path), sums.get(str(path))))


def _examine(file: File) -> tuple[File, ImageFacts]:
    facts = _examiner.examine(file)
    _read_files.check()
    return file, facts


def _answer(question: geometry.Question) -> list[Answer]:
    answers = _examiner.answer(*question)
    _read_files.check()
    return answers
