"""Checks each image of a dataset by itself: its file, format, colours, depth and passes."""

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, sha256
from lightfield.formats.depth import depth_meaning
from lightfield.formats.layout import IMAGES, File, ImageSet, rendered, source_view
from lightfield.formats.passes import MANIFEST, NAMES, Pass
from lightfield.geometry.flow import in_frame, shorter
from lightfield.geometry.lenses import Lens
from lightfield.geometry.visibility import nothing_hides
from lightfield.imaging import images
from lightfield.validation import clipping, consistency, light_sums, reprojected
from lightfield.validation.cameras import camera_of
from lightfield.validation.consistency import Answer, Patches
from lightfield.validation.result import Check

Bools = NDArray[np.bool_]

# The check of what the renderer has counted in the views' own files.
COUNTS = "counts"
# How many surface patches of a view are compared with its neighbours.
_RAYS_A_VIEW = 400

# Pixels this near to the rim of the image circle may hold light from both sides of it.
_RIM_PIXELS = 2
# An image counts as having one colour if at most this part of it has another.
FEW = 0.002
# A unit vector's length differs from 1 by less than this.
_NOT_UNIT = 1e-4
# Outside the image circle, at most this part of the values may exceed FAINT.
_MOST_LIT_OUTSIDE = 0.05
_FAINT = 0.001
# A flow may be this many pixels off the place that follows from depth.
_FLOW_OFF = 0.01
# A point is hidden if the farthest surface around is nearer by more than this part of its distance.
# The flow was made with 0.01. A tenth more allows for the rounding of depths in half floats.
_HIDDEN = 0.011
# Regions of this many differently turned views are kept in memory.
_MOST_REGIONS = 16


@dataclass
class ImageFacts:
    """The findings about one image file, without comparison with other views.

    - ``faults``: texts by the check to which they belong.
    - ``clamped``, ``nan``: how many rendered values were clamped, or were not a number.
    - ``machine``: the machine that rendered the view.
    - ``marked``: whether the pixels without a source could be checked.
    - ``compared``: whether a reprojected view was compared with the rendered one.
    - ``colour_compared``: whether its colours were, too.
    - ``empty``: whether the view is transparent and shows at most a few pixels.
    - ``constant``: whether the view has one colour and one alpha, as sky or a wall may.
    - ``black``: whether this colour is black.
    - ``missed``: the part of the lens's pixels that hit nothing, if the view has depth.
    - ``light``: how many pixels have which light, if the view is an EXR file: see `clipping`.
    - ``patches``: the surface patches that `geometry` compares, if the view has depth.
    - ``sum_error``: by which part of the colour the sum of the light groups differs from it.
    - ``not_summed``: why the light groups need not add up to the colour.
    """

    checksum: str
    bytes: int
    faults: dict[str, list[str]] = field(default_factory=dict)
    clamped: int | None = None
    nan: int | None = None
    machine: str | None = None
    marked: bool = False
    compared: bool = False
    colour_compared: bool = False
    empty: bool = False
    constant: bool = False
    black: bool = False
    missed: float = 0.0
    light: clipping.Counts | None = None
    patches: Patches | None = None
    sum_error: float | None = None
    not_summed: str | None = None

    def fault(self, check: str, text: str, is_fault: bool | int = True) -> None:
        """Note a fault for a check, if ``is_fault``."""
        if is_fault:
            self.faults.setdefault(check, []).append(text)


class Examiner:
    """Reads a dataset's images. Computes only once what all views of a set share."""

    def __init__(self, dataset: Path, sets: Sequence[ImageSet]) -> None:
        self.dataset = dataset
        self.sets = sets
        self.regions: dict[Any, tuple[Bools, Bools]] = {}
        self.numbers: dict[Pass, set[int]] = {}

    def examine(self, file: File) -> ImageFacts:
        """Read an image file, and return the findings about it."""
        path = self.dataset / file.path
        facts = ImageFacts(sha256(path), path.stat().st_size)
        image_set = self.sets[file.set]
        lens = image_set.lightfield.lens
        check = "passes" if file.of_pass else "images"
        try:
            image = images.read_image(path)
        except UserError as error:
            text = " ".join(str(error).split()).replace(f"{path}: ", "")
            facts.fault(check, text.replace(str(path), file.path))
            return facts
        height, width = next(iter(image.channels.values())).shape
        if (width, height) != (lens.width, lens.height):
            text = f"is {width} × {height}; must be {lens.width} × {lens.height}"
            facts.fault(check, text)
        elif file.of_pass:
            self._examine_pass(file, file.of_pass, image, facts)
        elif file.view >= 0:
            problem = _format_problem(file, image_set, image)
            if problem:
                facts.fault("images", problem)
            else:
                self._examine_view(file, image, facts)
        return facts

    def answer(self, file: File, questions: list[tuple[int, Patches]]) -> list[Answer]:
        """Look up patches of other views in a view.

        ``questions`` are the numbers of those views, and their patches.
        """
        image_set = self.sets[file.set]
        path = self.dataset / file.path
        depth = _with_unknown(images.read_image(path, ["Z"]).channels["Z"], path)
        camera = camera_of(image_set, file.view)
        return [
            consistency.ask(patches, camera_of(image_set, asking), camera, depth)
            for asking, patches in questions
        ]

    def _examine_view(self, file: File, image: images.Image, facts: ImageFacts) -> None:
        image_set = self.sets[file.set]
        is_rendered = not image_set.name
        in_circle, outside = self._of_lens(image_set.lightfield.lens)
        self._examine_colour(image_set, file, image, facts)
        if image_set.lightfield.light_groups and file.path.endswith(".exr"):
            self._add_up_light(image_set, file, image, facts)
        depth = image.channels.get("Z")
        if depth is not None:
            meaning = image_set.lightfield.depth
            header = depth_meaning(image.attributes, image_set.lightfield)
            text = f"is {header!r} by its header, {meaning!r} by its list"
            facts.fault("depth", text, header != meaning)
            if is_rendered:
                unknown = int(np.isnan(depth).sum())
                facts.fault("depth", f"{unknown} depths are not a number", unknown)
                is_filled = not np.isposinf(depth[outside]).all()
                facts.fault("depth", "has depth where the lens sees nothing", is_filled)
            wrong = int((depth <= 0).sum())
            facts.fault("depth", f"{wrong} depths are not positive", wrong)
            facts.missed = float(np.isposinf(depth[in_circle]).mean())
            facts.patches = consistency.sample(camera_of(image_set, file.view), depth, _RAYS_A_VIEW)
        if is_rendered and images.MACHINE_ATTRIBUTE in image.attributes:
            facts.machine = str(image.attributes[images.MACHINE_ATTRIBUTE])
        if not is_rendered:
            self._compare_marks(file, image, facts)
            self._compare_with_source(file, image, facts)
        elif images.NAN_ATTRIBUTE in image.attributes:
            facts.nan = int(image.attributes[images.NAN_ATTRIBUTE])
            facts.clamped = int(image.attributes.get(images.CLAMPED_ATTRIBUTE, 0))
            facts.fault("counts", f"{facts.nan} rendered values were not a number", facts.nan)

    def _add_up_light(
        self, image_set: ImageSet, file: File, image: images.Image, facts: ImageFacts
    ) -> None:
        """Compare the sum of a view's light groups with its colour."""
        lightfield = image_set.lightfield
        facts.not_summed = light_sums.reason_against(lightfield)
        if facts.not_summed:
            return
        colour = np.stack([image.channels[name] for name in "RGB"])
        folder = self.dataset / image_set.name
        view = image_set.views[file.view]
        facts.sum_error = light_sums.error(folder, view, lightfield.light_groups, colour)
        if facts.sum_error is not None:
            is_off = not facts.sum_error <= light_sums.MOST_OFF
            text = f"the sum of the light groups is off by {facts.sum_error:.2g} of the colour"
            facts.fault("light_groups", text, is_off)

    def _examine_colour(
        self, image_set: ImageSet, file: File, image: images.Image, facts: ImageFacts
    ) -> None:
        is_rendered = not image_set.name
        in_circle, outside = self._of_lens(image_set.lightfield.lens)
        transparent = image_set.lightfield.transparent
        if transparent and file.path.endswith(".exr"):
            alpha = image.channels["A"]
            wrong = int((~((alpha >= 0) & (alpha <= 1))).sum())
            facts.fault("colour", f"{wrong} values of alpha are not between 0 and 1", wrong)
        colour = np.stack([image.channels[name] for name in "RGB"])
        nan = int(np.isnan(colour).sum())
        facts.fault("colour", f"{nan} values are not a number", nan)
        infinite = int(np.isinf(colour).sum())
        facts.fault("colour", f"{infinite} values are infinite", infinite)
        if file.path.endswith(".exr"):
            facts.light = clipping.count(colour, image.channels.get("A"), in_circle)
        facts.empty = transparent and _shows_nothing(image, in_circle, is_rendered)
        # A light may be off, or reach nothing that the view shows.
        if not facts.empty and not image_set.lightfield.is_relit:
            pixels = np.stack([*colour, image.channels["A"]]) if transparent else colour
            facts.constant = _has_one_colour(pixels, in_circle)
            facts.black = facts.constant and not _middle(colour).any()
        # Cycles leaves a few values of 1e-6 there, and its denoiser a little more.
        if is_rendered and outside.any():
            is_lit = (colour[:, outside] > _FAINT).mean() > _MOST_LIT_OUTSIDE
            facts.fault("colour", "has colour where the lens sees nothing", is_lit)

    def _examine_pass(
        self, file: File, view_pass: Pass, image: images.Image, facts: ImageFacts
    ) -> None:
        problem = _channels_problem(image, dict.fromkeys(view_pass.channels, view_pass.dtype))
        if problem:
            facts.fault("passes", problem)
            return
        facts.nan = int(image.attributes.get(images.NAN_ATTRIBUTE, 0))
        pixels = np.stack([image.channels[name] for name in view_pass.channels])
        wrong = int((~np.isfinite(pixels)).sum())
        facts.fault("passes", f"{wrong} values are not finite", wrong)
        if view_pass.kind == "normal":
            lengths = np.linalg.norm(pixels, axis=0)
            wrong = int(((np.abs(lengths - 1) > _NOT_UNIT) & (lengths != 0)).sum())
            facts.fault("passes", f"{wrong} normals are not unit vectors", wrong)
        if view_pass.kind == "variance":
            wrong = int((pixels < 0).sum())
            facts.fault("passes", f"{wrong} variances are below 0", wrong)
        if view_pass.kind == "value":
            wrong = int(((pixels < 0) | (pixels > 1)).sum())
            facts.fault("passes", f"{wrong} values are not between 0 and 1", wrong)
        if view_pass.kind == "id":
            unknown = sorted(set(np.unique(pixels).tolist()) - self._numbers(view_pass))
            path = f"{view_pass.name}/{NAMES}"
            facts.fault("passes", f"has {unknown[:4]}, which {path} does not have", bool(unknown))
        if view_pass.name == "object":
            misses = self._misses(file)
            wrong = 0 if misses is None else int(((pixels[0] == 0) != misses).sum())
            facts.fault("passes", f"{wrong} pixels have a depth or an object, and not both", wrong)
        if view_pass.kind == "matte":
            coverage = pixels[1::2]
            is_unordered = np.diff(coverage, axis=0, append=0) > 0
            wrong = int(((coverage < 0) | is_unordered).any(axis=0).sum())
            facts.fault("passes", f"{wrong} pixels have parts below 0 or not in order", wrong)
            hashes = set(np.unique(pixels[::2][coverage > 0]).tolist())
            strange = len(hashes - _hashes(image))
            facts.fault("passes", f"has {strange} objects that its manifest does not have", strange)
        if view_pass.kind == "flow":
            visible = pixels[2] == 1
            wrong = int((~visible & (pixels[2] != 0)).sum())
            facts.fault("passes", f"{wrong} values of V are neither 0 nor 1", wrong)
            lens = self.sets[file.set].lightfield.lens
            wrong = int((visible & ~in_frame(lens, pixels[:2])).sum())
            facts.fault("passes", f"{wrong} visible points are out of the frame", wrong)
            for text in self._flow_faults(file, pixels, visible):
                facts.fault("passes", text)

    def _flow_faults(self, file: File, flow: NDArray[Any], visible: Bools) -> Iterator[str]:
        """Yield how a ``flow`` (3, h, w) differs from the flow that two views' depth gives."""
        image_set = self.sets[file.set]
        target = image_set.numbers.get(image_set.lightfield.views[file.view].others["flow"])
        depth = self._depth(image_set, file.view)
        if target is None:
            yield "leads to no view"
            return
        target_depth = self._depth(image_set, target)
        if depth is None or target_depth is None:
            return  # Another check reports it.
        target_path = self.dataset / image_set.folder / f"{image_set.views[target]}.exr"
        target_depth = _with_unknown(target_depth, target_path)
        camera = camera_of(image_set, file.view)
        other = camera_of(image_set, target)
        rows, columns = np.nonzero(np.isfinite(depth) & np.isfinite(flow).all(axis=0))
        points = camera.lift(depth[rows, columns].astype(np.float64), columns, rows)
        places = np.stack([columns, rows], axis=-1) + 0.5 + flow[:2, rows, columns].T
        is_visible = visible[rows, columns]
        off = other.pixels(points) - places
        off[:, 0] = shorter(other.lens, off[:, 0])
        # NaN where the other view has no ray to a point.
        is_there = (np.abs(off) <= _FLOW_OFF).all(axis=-1)
        wrong = int((is_visible & ~is_there).sum())
        if wrong:
            yield f"{wrong} visible points are not where their depth puts them"
            return
        # Compare only where the other view has 3 × 3 pixels around the point.
        last = np.array([other.lens.width, other.lens.height]) - 1
        compared = is_there & ((places >= 1) & (places < last)).all(axis=-1)
        column, row = np.floor(places[compared]).astype(np.int64).T
        nearest, farthest = consistency.recorded_range(other, target_depth, column, row)
        distance = np.linalg.norm(points[compared] - other.position, axis=-1)
        is_known = ~np.isnan(farthest)
        is_hidden = is_known & ~nothing_hides(farthest, distance, part=_HIDDEN)
        is_open = distance <= nearest
        wrong = int(np.where(is_visible[compared], is_hidden, is_open).sum())
        if wrong:
            yield f"{wrong} values of V are not what the depth of both views says"

    def _depth(self, image_set: ImageSet, view: int) -> NDArray[Any] | None:
        """Return the depth (height, width) of a view of a set. None if it has none of its size."""
        if image_set.lightfield.depth is None:
            return None
        lens = image_set.lightfield.lens
        path = self.dataset / image_set.folder / f"{image_set.views[view]}.exr"
        try:
            depth = images.read_image(path, ["Z"]).channels["Z"]
        except UserError:
            return None
        return depth if depth.shape == (lens.height, lens.width) else None

    def _misses(self, file: File) -> Bools | None:
        """Return where the rendered view of a pass hits nothing. None without its depth."""
        image_set = self.sets[file.set]
        depth = None if image_set.name else self._depth(image_set, file.view)
        # In half floats, inf may also be a depth of more than 65504 m.
        return np.isposinf(depth) if depth is not None and depth.dtype == np.float32 else None

    def _numbers(self, view_pass: Pass) -> set[int]:
        """Return the numbers in the names file of a pass. Empty if it cannot be read."""
        if view_pass not in self.numbers:
            try:
                numbers_by_name = read_json(self.dataset / view_pass.name / NAMES)
                self.numbers[view_pass] = {0, *numbers_by_name.values()}
            except (UserError, AttributeError, TypeError):
                self.numbers[view_pass] = set()
        return self.numbers[view_pass]

    def _compare_marks(self, file: File, image: images.Image, facts: ImageFacts) -> None:
        """Check that exactly the pixels that the source cannot see are marked as without source."""
        regions = self._of_source(file)
        target = self.sets[file.set].lightfield
        if regions is None:
            return
        with_source, without = regions
        if "Z" in image.channels:
            marked = np.isnan(image.channels["Z"])
        elif "A" in image.channels:
            marked = image.channels["A"] == 0
        else:
            marked = np.zeros(without.shape, bool)
        facts.marked = True
        missing = int((without & ~marked).sum())
        wrong = int((with_source & marked).sum())
        if target.transparent and "Z" not in image.channels:
            wrong = 0  # Alpha 0 may also mean that the source sees nothing there.
        facts.fault("marks", f"{missing} pixels without a source are not marked", missing)
        facts.fault("marks", f"{wrong} pixels with a source are marked as without", wrong)
        coloured = any(image.channels[name][without].any() for name in "RGB")
        facts.fault("marks", "has colour in pixels without a source", coloured)

    def _compare_with_source(self, file: File, image: images.Image, facts: ImageFacts) -> None:
        """Check that a reprojected view shows what the rendered view shows."""
        target = self.sets[file.set]
        source = rendered(self.sets)
        number = source_view(source, target.views[file.view])
        if source is None or number is None:
            return
        name = f"{IMAGES}/{source.views[number]}.exr"
        try:
            original = images.read_image(self.dataset / name)
        except UserError:
            return  # The check of the images reports it.
        problem = _format_problem(File(name, 0, number), source, original)
        height, width = next(iter(original.channels.values())).shape
        lens = source.lightfield.lens
        if problem or (width, height) != (lens.width, lens.height):
            return
        facts.compared = True
        facts.colour_compared = reprojected.has_same_light(target)
        for text in reprojected.faults(target, file.view, image, source, number, original):
            facts.fault("source", f"{text} {name}")

    def _of_lens(self, lens: Lens) -> tuple[Bools, Bools]:
        """Return where the lens has a ray, and where it has none. Both exclude the rim."""
        if lens not in self.regions:
            has_ray = np.isfinite(lens.pixel_rays(np.float32)[..., 0])
            self.regions[lens] = (_inner(has_ray), _inner(~has_ray))
        return self.regions[lens]

    def _of_source(self, file: File) -> tuple[Bools, Bools] | None:
        """Return where a reprojected view's source sees something, and where not.

        Both exclude the rim. Return None if the dataset has no such source.
        """
        target = self.sets[file.set]
        source = rendered(self.sets)
        number = source_view(source, target.views[file.view])
        if source is None or number is None:
            return None
        lens, from_lens = target.lightfield.lens, source.lightfield.lens
        to_world = target.lightfield.world_from_cameras[file.view]
        from_world = source.lightfield.world_from_cameras[number]
        # Round it, and remove −0, so that views turned alike share one answer.
        turn = np.round(from_world[:3, :3].T @ to_world[:3, :3], 5).astype(np.float32) + 0
        key = (lens, turn.tobytes())
        if key not in self.regions:
            pixels = from_lens.pixels(lens.pixel_rays(np.float32) @ turn.T)
            frame = np.array([from_lens.width, from_lens.height], np.float32)
            with np.errstate(invalid="ignore"):
                in_source = ((pixels >= 0) & (pixels <= frame)).all(axis=-1)
            if len(self.regions) > _MOST_REGIONS:
                self.regions.clear()
            self.regions[key] = (_inner(in_source), _inner(~in_source))
        return self.regions[key]


def checks(
    image_set: ImageSet, facts: Mapping[File, ImageFacts], volumes: Sequence[str] = ()
) -> list[Check]:
    """Return the checks of a set's images. An image passes or fails each by itself.

    ``volumes`` are the names of the scene's volumes. Depth does not see them.
    """
    readable = {file: fact for file, fact in facts.items() if "images" not in fact.faults}
    for fact in readable.values():
        # A failed render is black. But the sky may be black, too, which has no depth, and so may
        # the part of its source that a reprojection shows.
        failed = fact.black and fact.missed < 1 and not fact.colour_compared
        fact.fault(
            "colour", "is black: the render failed, or no light reaches what it shows", failed
        )
    checks = [
        _outcome(image_set, "images", facts, "are whole, of the right size and channels"),
        _outcome(image_set, "colour", readable, "have finite colours, and are not black"),
    ]
    with_depth = {file: fact for file, fact in readable.items() if fact.patches is not None}
    checks.append(_outcome(image_set, "depth", with_depth, "have positive depths, misses +inf"))
    if image_set.lightfield.light_groups:
        checks.append(_of_light_groups(image_set, readable))
    constant = sum(fact.constant and "colour" not in fact.faults for fact in readable.values())
    if constant:
        checks[1].warnings.append(f"{constant} images in {image_set.folder} have one colour")
    if image_set.name:
        marked = {file: fact for file, fact in readable.items() if fact.marked}
        compared = {file: fact for file, fact in readable.items() if fact.compared}
        return [
            *checks,
            _outcome(image_set, "marks", marked, "mark the pixels that their source cannot see"),
            _outcome(image_set, "source", compared, "show what their source shows"),
        ]
    if volumes and with_depth:
        missed = sum(fact.missed for fact in with_depth.values()) / len(with_depth)
        names = ", ".join(volumes[:8]) + (" …" if len(volumes) > 8 else "")
        checks[2].warnings.append(
            f"{missed:.1%} of the depths are inf; volumes are no surfaces: {names}"
        )
    counted = {file: fact for file, fact in readable.items() if fact.nan is not None}
    check = _outcome(image_set, COUNTS, counted, "have their renderer's counts, without NaN")
    clamped = [fact.clamped for fact in counted.values() if fact.clamped]
    if clamped:
        text = f"{sum(clamped)} values in {len(clamped)} views were clamped to the half range"
        check.warnings.append(text)
    check.figures["clamped"] = sum(clamped)
    return [*checks, check]


def _of_light_groups(image_set: ImageSet, facts: Mapping[File, ImageFacts]) -> Check:
    """Return the check that the light groups of each view add up to its colour."""
    reasons = {fact.not_summed for fact in facts.values() if fact.not_summed}
    if reasons:
        return Check(f"{image_set.prefix}light_groups", None, "; ".join(sorted(reasons)))
    summed = {file: fact for file, fact in facts.items() if fact.sum_error is not None}
    claim = "are the sum of their light groups, within the rounding of halves"
    check = _outcome(image_set, "light_groups", summed, claim)
    errors = [fact.sum_error for fact in summed.values() if fact.sum_error is not None]
    if errors:
        check.figures["largest_difference"] = float(f"{max(errors):.3g}")
    return check


def _outcome(image_set: ImageSet, name: str, facts: Mapping[File, ImageFacts], claim: str) -> Check:
    """Return the check ``name`` of the images. ``claim`` says in words what they must satisfy."""
    if not facts:
        return Check(f"{image_set.prefix}{name}", None, f"no image to see if they {claim}")
    faults = {
        file.path: ", ".join(fact.faults[name])
        for file, fact in facts.items()
        if name in fact.faults
    }
    detail = f"{len(facts) - len(faults)} of {len(facts)} {claim}"
    return Check.of_files(f"{image_set.prefix}{name}", faults, detail)


def of_passes(facts: Mapping[File, ImageFacts], missing: Sequence[str]) -> Check:
    """Return the check of the views' passes. ``missing`` are the paths of missing files."""
    faults = dict.fromkeys(missing, "is missing")
    faults |= {
        file.path: ", ".join(fact.faults["passes"]) for file, fact in facts.items() if fact.faults
    }
    count = len(facts) + len(missing)
    detail = f"{count - len(faults)} of {count} are there and hold what they must"
    check = Check.of_files("passes", faults, detail)
    lost: Counter[str] = Counter()
    for file, fact in facts.items():
        if file.of_pass and fact.nan:
            lost[file.of_pass.name] += fact.nan
    for name, number in lost.items():
        check.warnings.append(
            f"{number} values in {name} were not numbers to Cycles and are 0, as on bumped "
            "surfaces at the rim of an image circle"
        )
    return check


def with_extras(exports: Check, extras: Mapping[File, ImageFacts]) -> Check:
    """Return the check of the exports, extended by the faults of pictures for trainers."""
    problems = [
        f"{file.path}: {text}"
        for file, fact in extras.items()
        for texts in fact.faults.values()
        for text in texts
    ]
    passed = False if problems else exports.passed
    return replace(exports, passed=passed, problems=exports.problems + problems)


def _with_unknown(depth: NDArray[Any], path: Path) -> NDArray[Any]:
    """Return the ``depth`` of the view at ``path``, with NaN where the view may hide a surface."""
    return np.where(images.may_hide(path), depth.dtype.type(np.nan), depth)


def _hashes(image: images.Image) -> set[float]:
    """Return the hashes in a matte's manifest as floats. Empty if it cannot be read."""
    try:
        texts = json.loads(str(image.attributes.get(MANIFEST))).values()
        bits = np.array([int(text, 16) for text in texts], np.uint32)
    except (ValueError, AttributeError, TypeError, OverflowError):
        return set()
    # Cryptomatte avoids the exponents of 0 and infinity.
    exponent = ((bits >> 23) & 255).clip(1, 254)
    return set(((bits & 0x807FFFFF) | exponent << 23).view(np.float32).tolist())


def _inner(region: Bools, *, outside: bool = True) -> Bools:
    """Return a region without its rim. ``outside`` says whether it goes on beyond the image."""
    window = 2 * _RIM_PIXELS + 1
    # Importing scipy's erosion takes a quarter of a second.
    padded = np.pad(region, _RIM_PIXELS, constant_values=outside)
    rows = np.lib.stride_tricks.sliding_window_view(padded, window, axis=0).all(axis=-1)
    inner: Bools = np.lib.stride_tricks.sliding_window_view(rows, window, axis=1).all(axis=-1)
    return inner


def _middle(colour: NDArray[Any]) -> NDArray[Any]:
    return colour[:, colour.shape[1] // 2, colour.shape[2] // 2]


def _has_one_colour(colour: NDArray[Any], in_circle: Bools) -> bool:
    """Return whether almost all pixels in the image circle have the middle pixel's colour.

    ``colour`` is (channels, height, width).
    """
    differs = (colour != _middle(colour)[:, np.newaxis, np.newaxis]) & in_circle
    return bool(differs.sum(axis=(1, 2)).max() <= FEW * in_circle.sum())


def _shows_nothing(image: images.Image, in_circle: Bools, is_rendered: bool) -> bool:
    """Return whether a transparent view shows at most a few pixels.

    The image circle touches the image's edge. At its rim Cycles makes black samples opaque. A
    reprojection spreads that rim, so only the colour counts there.
    """
    if not is_rendered:
        return not any(image.channels[name].any() for name in "RGB")
    within = _inner(in_circle, outside=False)
    return bool((image.channels["A"][within] > 0).sum() <= FEW * in_circle.sum())


def _format_problem(file: File, image_set: ImageSet, image: images.Image) -> str | None:
    """Return which channels a view has and must have, if they differ in name or type."""
    types = {name: pixels.dtype for name, pixels in image.channels.items()}
    transparent = image_set.lightfield.transparent
    has_alpha = transparent or ("A" in types and image_set.name)
    colour = "RGBA" if has_alpha else "RGB"
    if file.path.endswith(".png"):
        required = dict.fromkeys(colour, "uint16" if types.get("R") == "uint16" else "uint8")
    else:
        required = dict.fromkeys(colour, "float16")
        if image_set.lightfield.depth:
            required["Z"] = "float16" if types.get("Z") == "float16" else "float32"
    return _channels_problem(image, required)


def _channels_problem(image: images.Image, required: Mapping[str, str]) -> str | None:
    """Return which channels an image has and must have, if they differ in name or type."""
    types = {name: str(pixels.dtype) for name, pixels in image.channels.items()}
    if types == required:
        return None
    return f"has the channels {_describe(types)}; must have {_describe(required)}"


def _describe(channels: Mapping[str, str]) -> str:
    return " ".join(f"{name}:{kind}" for name, kind in sorted(channels.items()))
