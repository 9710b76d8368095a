"""Is a finished dataset whole and right? Every file is read, and every claim about it is tried.

A dataset is a folder with lightfield.json, exr/<view>.exr, and reprojections, each a folder with
its own lightfield.json and images. `validate` reads every image once, in as many processes as it
is given, for what one file can tell; the views with depth are read once more for what only several
views together can tell (`lightfield.validation.consistency`). Memory holds a few hundred points a
view.

The result is a list of checks, each passed, failed, or not applicable and why: what could not be
checked is said, never counted as right.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, sha256
from lightfield.core.progress import Progress
from lightfield.geometry import lenses, rotations
from lightfield.geometry.lenses import Array, Lens
from lightfield.validation import consistency
from lightfield.validation.consistency import Answer, Patches
from lightfield.validation.examination import Examiner, Facts, File, ImageSet

IMAGES = "exr"
"""The folder of a dataset's own views."""

SUMS = "sha256sums.txt"
"""The checksums in a dataset: only a valid one has them."""

OUTPUTS = ("validation.json", SUMS)
"""The files in a dataset that say what came out of its validation."""

REPORT = "report"
"""The folder in a dataset that is not published with it."""

# A view fails when over half of its pairs exceed one of these: the part of contradictions among
# the points that are not occluded, and the displacement in pixels that a pair's residuals ask for.
# A set fails when its pairs together ask for such a change of all angles or of all depths. A
# reprojection takes each depth from a pixel of its source, which may lie half a pixel away.
CONTRADICTIONS_LIMIT = 0.05
DISPLACEMENT_LIMIT, REPROJECTED_DISPLACEMENT_LIMIT = 0.2, 0.4
SCALE_LIMIT, REPROJECTED_SCALE_LIMIT = 0.007, 0.015
# Residuals that determine a scale no better than this do not count as a check of it.
SCALE_DEVIATION_LIMIT = 0.0015


@dataclass(frozen=True)
class Check:
    """One check's outcome: ``passed`` is None where it does not apply, which ``detail`` explains.

    ``views`` are those that failed; ``problems`` are whole lines, each naming a file;
    ``warnings`` what is allowed but worth a look; ``figures`` what was measured.
    """

    name: str
    passed: bool | None
    detail: str
    views: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    figures: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Result:
    """A dataset's checks, and the SHA-256 of every file that it publishes by relative path."""

    dataset: str
    views: int
    checks: list[Check]
    checksums: dict[str, str]

    @property
    def valid(self) -> bool:
        return all(check.passed is not False for check in self.checks)

    def to_json(self) -> dict[str, Any]:
        """Return the content of validation.json."""
        return {
            "dataset": self.dataset,
            "valid": self.valid,
            "summary": self.summary(),
            "checks": [asdict(check) for check in self.checks],
        }

    def summary(self) -> str:
        """Return one line for a person."""
        parts = [f"{self.views} views"]
        parts += [
            check.name.removesuffix("geometry").replace("/", " ") + check.detail
            for check in self.checks
            if check.name.endswith("geometry") and check.figures
        ]
        for title, passed in (("failed", False), ("not applicable", None)):
            names = [check.name for check in self.checks if check.passed is passed]
            parts += [f"{title}: {', '.join(names)}"] if names else []
        warnings = [warning for check in self.checks for warning in check.warnings]
        parts += [f"warning: {'; '.join(warnings)}"] if warnings else []
        return f"{self.dataset}: {'valid' if self.valid else 'INVALID'}: {'; '.join(parts)}"


def validate(
    dataset: Path,
    reprojections: Sequence[str] = (),
    records: Sequence[Path] = (),
    clearance: Path | None = None,
    processes: int = 1,
) -> Result:
    """Check a dataset's files, and what its pixels must satisfy.

    ``reprojections`` are folders in the dataset; ``records`` JSON files of what was rendered
    (``files``: relative path: ``bytes``, ``sha256``); ``clearance`` a JSON file of what surrounds
    each camera (``views``: name: ``distance`` in metres, ``inside``). Raises `UserError` where
    one of these cannot be read; whatever is wrong with the dataset is in the result.
    """
    dataset = dataset.resolve()
    checks: list[Check] = []
    sets: list[ImageSet] = []
    for name in ("", *reprojections):
        image_set, check = _read_set(dataset, name)
        checks.append(check)
        if image_set and name and sets and not sets[0].name:
            image_set = replace(image_set, grain=_central_angle(sets[0].lens))
        sets += [image_set] if image_set else []
    files, missing = _view_files(dataset, sets)
    extras, lists, exports = _exports(dataset, sets, {file.path for file in files})
    facts: dict[File, Facts] = {}
    with _workers(Examiner(dataset, sets), processes) as mapped:
        progress = Progress(len(files + extras), f"validate {dataset.name}", "files")
        for file, fact in mapped(_examine, files + extras):
            facts[file] = fact
            progress.done()
        for number, image_set in enumerate(sets):
            own = {file: facts[file] for file in files if file.set == number}
            checks.append(_presence(image_set, own, missing[number]))
            checks += _file_checks(image_set, own)
            checks.append(_geometry(image_set, own, mapped))
    checks.append(_with_extras(exports, {file: facts[file] for file in extras}))
    published, listing = _listing(dataset, sets, {*lists, *(file.path for file in facts)})
    if len(sets) <= len(reprojections):
        listing = Check("files", None, "a lightfield.json that cannot be understood lists no files")
    checks.append(listing)
    checks.append(_checksums(records, {file.path: fact for file, fact in facts.items()}, sets))
    checks.append(_clearance(clearance, sets))
    known = {file.path: fact.checksum for file, fact in facts.items()}
    return Result(
        f"{dataset.parent.name}/{dataset.name}",
        len(sets[0].views) if sets and not sets[0].name else 0,
        checks,
        {path: known.get(path) or sha256(dataset / path) for path in published},
    )


Mapped = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]


@contextmanager
def _workers(examiner: Examiner, processes: int) -> Iterator[Mapped]:
    """Yield a `map` over worker processes that hold the examiner; one process is this one."""
    if processes == 1:
        _start_worker(examiner)
        yield map
        return
    # Spawned, because OpenImageIO has threads, which do not survive a fork.
    with ProcessPoolExecutor(
        processes, get_context("spawn"), initializer=_start_worker, initargs=(examiner,)
    ) as pool:
        yield pool.map


_examiner: Examiner


def _start_worker(examiner: Examiner) -> None:
    global _examiner
    _examiner = examiner
    oiio.attribute("threads", 1)
    oiio.attribute("exr_threads", 1)


def _examine(file: File) -> tuple[File, Facts]:
    return file, _examiner.examine(file)


def _answer(question: tuple[File, list[tuple[int, Patches]]]) -> list[Answer]:
    return _examiner.answer(*question)


# ---- what is there --------------------------------------------------------------------------


def _read_set(dataset: Path, name: str) -> tuple[ImageSet | None, Check]:
    """Read and check the lightfield.json of the dataset (name "") or of a reprojection."""
    prefix = f"{name}/" if name else ""
    path = f"{prefix}lightfield.json"
    try:
        content = read_json(dataset / path)
        lens = lenses.from_lightfield(content)
        frames = content["frames"]
        views = [str(frame["name"]) for frame in frames]
        matrices, eulers, positions = (
            np.array([frame[key] for frame in frames], np.float64).reshape(len(frames), *shape)
            for key, shape in (("world_matrix", (4, 4)), ("rotation", (3,)), ("position", (3,)))
        )
        depth = content.get("depth", "z" if lens.has_z_depth else "distance")
        if not views:
            raise ValueError("frames: is empty")
        if depth not in (None, "distance", "z") or (depth == "z" and not lens.has_z_depth):
            raise ValueError(f"depth: is {depth!r}, which this lens cannot have")
    except KeyError as error:
        problem = f"{path}: {error.args[0]}: is missing"
    except (UserError, TypeError, ValueError) as error:
        text = str(error).replace(f"{dataset}/", "")
        problem = text if text.startswith(path) else f"{path}: {text}"
    else:
        return (
            ImageSet(name, name or IMAGES, lens, depth, views, matrices),
            _poses_check(path, views, matrices, eulers, positions),
        )
    return None, Check(f"{prefix}lightfield", False, "cannot be understood", problems=[problem])


def _poses_check(path: str, views: list[str], matrices: Array, eulers: Array, at: Array) -> Check:
    """Check that names differ, and that each pose is a rigid one and the same in both forms."""
    turns = matrices[:, :3, :3]
    faults = {view: "is the name of two frames" for view in views if views.count(view) > 1}
    for view, difference in zip(
        views,
        np.abs(rotations.euler_to_matrix(eulers) - turns).max(axis=(1, 2))
        + np.abs(at - matrices[:, :3, 3]).max(axis=1)
        + np.abs(matrices[:, 3] - (0, 0, 0, 1)).max(axis=1),
        strict=True,
    ):
        # Blender keeps poses in float32.
        if not difference < 1e-5 * (1 + np.abs(at).max()):
            faults[view] = "world_matrix: is not that of its position and rotation"
    return Check(
        path.removesuffix(".json"),
        not faults,
        f"{len(views)} views",
        list(faults),
        [f"{path}: frames: {view}: {fault}" for view, fault in faults.items()],
    )


def _central_angle(lens: Lens) -> float:
    """Return the angle in radians between two pixels in the middle of the image."""
    x = np.array([lens.width - 1, lens.width + 1]) / 2
    one, other = lens.rays(x, np.full(2, lens.height / 2))
    return float(np.arccos(np.clip(one @ other, -1.0, 1.0)))


def _view_files(dataset: Path, sets: Sequence[ImageSet]) -> tuple[list[File], list[list[str]]]:
    """Return the views' files that are there, and for each set the paths of those that are not.

    A reprojection is EXR, PNG or both: a format of which it has one view, it must have whole.
    """
    files: list[File] = []
    missing: list[list[str]] = []
    for number, image_set in enumerate(sets):
        present = {path.name for path in (dataset / image_set.folder).glob("*")}
        formats = [
            suffix
            for suffix in ((".exr", ".png") if image_set.name else (".exr",))
            if any(view + suffix in present for view in image_set.views)
        ]
        missing.append([])
        for suffix in formats or [".exr"]:
            for view, name in enumerate(image_set.views):
                path = f"{image_set.folder}/{name}{suffix}"
                if name + suffix in present:
                    files.append(File(path, number, view))
                else:
                    missing[-1].append(path)
    return files, missing


def _exports(
    dataset: Path, sets: Sequence[ImageSet], views: set[str]
) -> tuple[list[File], list[str], Check]:
    """Return the pictures made for trainers, the lists (transforms*.json) of them, and a check.

    Beside what a list names (file_path, depth_path), each view may have a dynamic_mask_<view>.png
    and a <view>_depth.png.
    """
    found: dict[str, File] = {}
    lists: list[str] = []
    problems: list[str] = []
    for number, image_set in enumerate(sets):
        folders = {image_set.folder}
        for path in sorted((dataset / image_set.name).glob("transforms*.json")):
            lists.append(path.relative_to(dataset).as_posix())
            try:
                frames = read_json(path)["frames"]
                named = [frame["file_path"] for frame in frames]
                named += [frame["depth_path"] for frame in frames if "depth_path" in frame]
                targets = [(path.parent / name).resolve() for name in named]
            except (UserError, LookupError, TypeError):
                problems.append(f"{lists[-1]}: is no JSON with frames, each with a file_path")
                continue
            for name, target in zip(named, targets, strict=True):
                if target.is_file() and target.is_relative_to(dataset):
                    relative = target.relative_to(dataset)
                    found[relative.as_posix()] = File(relative.as_posix(), number)
                    folders.add(relative.parent.as_posix())
                else:
                    problems.append(f"{lists[-1]}: frames: {name} is no file of the dataset")
        for folder in sorted(folders):
            present = {path.name for path in (dataset / folder).glob("*.png")}
            for view in image_set.views:
                for name in (f"dynamic_mask_{view}.png", f"{view}_depth.png"):
                    if name in present:
                        found[f"{folder}/{name}"] = File(f"{folder}/{name}", number)
    files = [file for path, file in sorted(found.items()) if path not in views]
    passed = not problems if lists or files else None
    detail = f"{len(lists)} lists of frames, {len(files)} pictures beside the views"
    return files, lists, Check("exports", passed, detail, problems=problems)


def _listing(dataset: Path, sets: Sequence[ImageSet], known: set[str]) -> tuple[list[str], Check]:
    """Return every file that the dataset publishes, and fail on those that are not its own."""
    own = known | {f"{image_set.prefix}lightfield.json" for image_set in sets}
    paths = [path.relative_to(dataset) for path in dataset.rglob("*") if path.is_file()]
    present = sorted(path.as_posix() for path in paths if path.parts[0] != REPORT)
    strays = [path for path in present if path not in own and path not in OUTPUTS]
    published = [path for path in present if path in own]
    problems = [f"{path}: is no file of this dataset" for path in strays]
    return published, Check("files", not strays, f"{len(published)} files", problems=problems)


def _presence(image_set: ImageSet, own: Mapping[File, Facts], missing: Sequence[str]) -> Check:
    return Check(
        f"{image_set.prefix}views",
        not missing,
        f"{len(own)} of {len(own) + len(missing)} images are there",
        sorted({Path(path).stem for path in missing}),
        [f"{path}: is missing" for path in missing],
    )


def _file_checks(image_set: ImageSet, own: Mapping[File, Facts]) -> list[Check]:
    """Return the checks that each image of a set passes or fails by itself."""
    readable = {file: fact for file, fact in own.items() if "images" not in fact.problems}
    checks = [
        _outcome(image_set, "images", own, "are whole, of the right size and channels"),
        _outcome(image_set, "colour", readable, "have finite colours, and are not black"),
    ]
    deep = {file: fact for file, fact in readable.items() if fact.patches is not None}
    checks.append(_outcome(image_set, "depth", deep, "have positive depths, misses +inf"))
    constant = sum(fact.constant for fact in readable.values())
    if constant:
        checks[1].warnings.append(f"{constant} images in {image_set.folder} have one colour")
    if image_set.name:
        marked = {file: fact for file, fact in readable.items() if fact.marked}
        text = "mark the pixels that their source cannot see"
        return [*checks, _outcome(image_set, "marks", marked, text)]
    counted = {file: fact for file, fact in readable.items() if fact.nan is not None}
    check = _outcome(image_set, "counts", counted, "have their renderer's counts, without NaN")
    clamped = [fact.clamped for fact in counted.values() if fact.clamped]
    if clamped:
        text = f"{sum(clamped)} values in {len(clamped)} views were clamped to the half range"
        check.warnings.append(text)
    check.figures["clamped"] = sum(clamped)
    return [*checks, check]


def _outcome(image_set: ImageSet, name: str, own: Mapping[File, Facts], claim: str) -> Check:
    """Return a check of what the facts say about ``name``."""
    bad = [file for file, fact in own.items() if name in fact.problems]
    return Check(
        f"{image_set.prefix}{name}",
        not bad if own else None,
        f"{len(own) - len(bad)} of {len(own)} {claim}"
        if own
        else f"no image to see if they {claim}",
        sorted({image_set.views[file.view] for file in bad}),
        [f"{file.path}: {own[file].problems[name]}" for file in bad],
    )


def _with_extras(exports: Check, extras: Mapping[File, Facts]) -> Check:
    """Return the check of what was made for trainers, with the pictures that cannot be read."""
    problems = [
        f"{file.path}: {text}" for file, fact in extras.items() for text in fact.problems.values()
    ]
    passed = False if problems else exports.passed
    return replace(exports, passed=passed, problems=exports.problems + problems)


def _checksums(
    records: Sequence[Path], facts: Mapping[str, Facts], sets: Sequence[ImageSet]
) -> Check:
    """Compare the images with the records of those who wrote them."""
    if not records:
        return Check("checksums", None, "no record was given")
    recorded: dict[str, Any] = {}
    for record in records:
        content = read_json(record)
        try:
            recorded |= {
                path: (entry["bytes"], entry["sha256"]) for path, entry in content["files"].items()
            }
        except (LookupError, TypeError, AttributeError):
            raise UserError(f"{record}: files: must map paths to bytes and sha256") from None
    problems = []
    for path, (size, digest) in sorted(recorded.items()):
        fact = facts.get(path)
        if fact is None:
            problems.append(f"{path}: is recorded but is no image of this dataset")
        elif size != fact.bytes:
            problems.append(f"{path}: has {fact.bytes} bytes, but its record says {size}")
        elif digest != fact.checksum:
            problems.append(f"{path}: has the sha256 {fact.checksum}, but its record says {digest}")
    rendered = sorted(path for path in facts if path.startswith(f"{IMAGES}/"))
    # Masks and pictures for trainers are not the renderer's.
    views = {f"{IMAGES}/{view}.exr" for image_set in sets[:1] for view in image_set.views}
    problems += [
        f"{path}: has no record" for path in rendered if path in views and path not in recorded
    ]
    return Check(
        "checksums",
        not problems,
        f"{len(recorded)} of {len(facts)} images have a record",
        sorted({Path(problem.split(":")[0]).stem for problem in problems}),
        problems,
    )


def _clearance(path: Path | None, sets: Sequence[ImageSet]) -> Check:
    """Check that no camera of the dataset is inside geometry."""
    if path is None:
        return Check("cameras", None, "no clearance was given")
    content = read_json(path)
    try:
        around = {
            str(name): (float(entry["distance"] or math.inf), bool(entry["inside"]))
            for name, entry in content["views"].items()
        }
    except (LookupError, TypeError, ValueError, AttributeError):
        raise UserError(f"{path}: views: must map names to distance and inside") from None
    views = sets[0].views if sets and not sets[0].name else []
    problems = {view: "its clearance was not measured" for view in views if view not in around}
    problems |= {
        view: "its camera is inside geometry" for view in views if around.get(view, (0, 0))[1]
    }
    distances = [around[view][0] for view in views if view in around]
    nearest = min(distances, default=math.inf)
    known = math.isfinite(nearest)
    return Check(
        "cameras",
        not problems,
        f"nothing is nearer to a camera than {nearest:.3g} m"
        if known
        else "nothing is near a camera",
        list(problems),
        [f"{IMAGES}/{view}.exr: {text}" for view, text in problems.items()],
        figures={"nearest_metres": round(nearest, 4)} if known else {},
    )


# ---- what the views say of each other -------------------------------------------------------


def _geometry(image_set: ImageSet, own: Mapping[File, Facts], mapped: Mapped) -> Check:
    """Check that the views of a set see the same world."""
    name = f"{image_set.prefix}geometry"
    files = [file for file, fact in own.items() if fact.patches is not None]
    if image_set.depth is None:
        return Check(name, None, "the views have no depth")
    if len(files) < 2:
        return Check(name, None, f"{len(files)} views with depth have no neighbours")
    patches = [fact.patches for fact in own.values() if fact.patches is not None]
    cameras = [image_set.camera(file.view) for file in files]
    pairs = consistency.neighbours(cameras, patches)
    if not pairs:
        return Check(name, None, "no two views see enough of the same smooth surfaces")
    asking: dict[int, list[int]] = {}
    for one, other in pairs:
        asking.setdefault(one, []).append(other)
        asking.setdefault(other, []).append(one)
    questions = [
        (files[view], [(files[other].view, patches[other]) for other in others])
        for view, others in sorted(asking.items())
    ]
    answers: dict[tuple[int, int], Answer] = {}
    progress = Progress(len(questions), f"validate {name}")
    for (view, others), found in zip(
        sorted(asking.items()), mapped(_answer, questions), strict=True
    ):
        answers |= {(other, view): answer for other, answer in zip(others, found, strict=True)}
        progress.done()
    return _judged(name, image_set, files, pairs, answers)


def _judged(
    name: str,
    image_set: ImageSet,
    files: Sequence[File],
    pairs: Sequence[tuple[int, int]],
    answers: Mapping[tuple[int, int], Answer],
) -> Check:
    """Turn what the views say of each other into a check that names the wrong ones."""
    both = {pair: answers[pair] + answers[pair[::-1]] for pair in pairs}
    of_view: list[list[Answer]] = [[] for _ in files]
    for pair, answer in both.items():
        for view in pair:
            of_view[view].append(answer)
    contradictions = [_low_median(a.contradiction for a in of) for of in of_view]
    displacements = [_low_median(a.displacement for a in of) for of in of_view]
    tested = [view for view, value in enumerate(contradictions) if value is not None]
    if not tested:
        return Check(name, None, "no two views see enough of the same smooth surfaces")
    worst = max(contradictions[view] or 0.0 for view in tested)
    farthest = max(displacements[view] or 0.0 for view in tested)
    limit, scale_limit = DISPLACEMENT_LIMIT, SCALE_LIMIT
    if image_set.grain:
        limit, scale_limit = REPROJECTED_DISPLACEMENT_LIMIT, REPROJECTED_SCALE_LIMIT
    bad = {
        view: f"{_percent(contradictions[view] or 0.0)} of its points contradict its neighbours "
        f"(at most {_percent(CONTRADICTIONS_LIMIT)}), and it seems displaced by "
        f"{displacements[view] or 0.0:.2f} pixels (at most {limit})"
        for view in tested
        if (contradictions[view] or 0.0) > CONTRADICTIONS_LIMIT
        or (displacements[view] or 0.0) > limit
    }
    problems = [f"{files[view].path}: {text}" for view, text in bad.items()]
    if 2 * len(bad) > len(tested):
        problems.insert(
            0,
            f"{image_set.prefix}lightfield.json: most views contradict each other: lens, axes or "
            "the meaning of depth are not those of the images",
        )

    total = sum(both.values(), start=consistency.NOTHING)
    good = [answer for pair, answer in both.items() if not bad.keys() & set(pair)]
    scale, deviation = consistency.scales(sum(good, start=consistency.NOTHING).terms)
    for what, value, sure in zip(("angles", "depths"), scale, deviation, strict=True):
        if sure < SCALE_DEVIATION_LIMIT and abs(value) > scale_limit + 3 * sure:
            problems.append(
                f"{image_set.prefix}lightfield.json: the views agree better if all {what} are "
                f"scaled by {1 + value:.3f} (at most {_percent(scale_limit)} is allowed)"
            )
    points = total.agree + total.occluded + total.contradict
    warnings = []
    untested = len(image_set.views) - len(tested)
    if untested:
        warnings.append(
            f"{untested} views in {image_set.folder} see too little that others see too"
        )
    return Check(
        name,
        not problems,
        f"{len(tested)} views × {2 * len(pairs) / len(tested):.1f} neighbours agree "
        f"{_percent(total.agree / points)} ({_percent(total.contradict / points)} contradict, "
        f"{_percent(total.occluded / points)} occluded)",
        [image_set.views[files[view].view] for view in bad],
        problems,
        warnings,
        {
            "pairs": len(pairs),
            "points": points,
            "agree": round(total.agree / points, 4),
            "contradict": round(total.contradict / points, 4),
            "occluded": round(total.occluded / points, 4),
            "worst_contradiction": round(worst, 4),
            "worst_displacement_pixels": round(farthest, 3),
            **{
                f"{what}_scale_{key}": round(float(number), 4)
                for what, *numbers in zip(("angle", "depth"), scale, deviation, strict=True)
                for key, number in zip(("error", "deviation"), numbers, strict=True)
                if math.isfinite(numbers[1])
            },
        },
    )


def _low_median(values: Iterable[float | None]) -> float | None:
    """Return the lower median of what is known: one bad neighbour of two is not one's own fault."""
    known = sorted(value for value in values if value is not None)
    return known[(len(known) - 1) // 2] if known else None


def _percent(part: float) -> str:
    return f"{100 * part:.2g} %" if part < 0.1 else f"{100 * part:.1f} %"
