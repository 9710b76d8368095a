"""Says why two datasets differ: first the cause, then settings, inputs, files and pixels.

Files differ if their bytes do, whatever sha256sums.txt says of them. Not compared are the report,
because it has times; what a package adds; and validation.json, because it follows from the rest.
"""

import filecmp
import math
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from lightfield.core.files import sha256
from lightfield.core.paths import files_below
from lightfield.core.progress import Progress
from lightfield.core.units import count
from lightfield.formats.layout import IMAGES, PACKAGED, REPORT, SUMS, VALIDATION, read_sums
from lightfield.formats.lightfield import NAME
from lightfield.formats.passes import FLOW, GROUP_PREFIX, PASSES
from lightfield.measurement import dataset_facts, picture_difference
from lightfield.measurement.dataset_facts import DatasetFacts, shortened
from lightfield.measurement.picture_difference import PictureDifference
from lightfield.stages.checks import Diff

_MOST_LINES = 10
_IMAGE_SUFFIXES = (".exr", ".png")
# Keys that decide what the views show, and keys that only say which view is for what.
_RESULTS_OF_RIG = ("lf_type", "view count", "pose")
_KEYS_OF_VIEWS = ("scene.", "rig.", *_RESULTS_OF_RIG, "camera.", "render.", "depth")
# The name of the scene YAML. It changes no pixel.
_NAME = "scene.name"
_SPLIT = "split"
# The blocks of settings in their order in the output. Other keys come after the keys of render.
_BLOCKS = ("scene", "rig", *_RESULTS_OF_RIG, _SPLIT, "camera", "render", "", "reprojections")
# Inputs that change last digits only.
_MACHINES = ("bpy", "machine")
_EQUAL_BYTES = "docs/explanation/equal-bytes.md"


def compare(job: Diff) -> None:
    """Print how the datasets of a job differ. Exits with status 1 if they do."""
    difference = _DatasetDifference(dataset_facts.read(job.a), dataset_facts.read(job.b))
    difference.find()
    print(difference.cause())
    if difference.is_empty:
        return
    print(f"A: {job.a}\nB: {job.b}")
    for title, lines in difference.sections():
        if lines:
            print("\n".join(["", title, *_first_lines(lines)]))
    sys.exit(1)


@dataclass
class _DatasetDifference:
    """All differences of two datasets."""

    a: DatasetFacts
    b: DatasetFacts
    settings: dict[str, str] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    only_in: dict[str, list[str]] = field(default_factory=dict)
    # What differs in files that both have.
    files: dict[str, str] = field(default_factory=dict)
    # Unreadable images, and files that are not as the sha256sums.txt of their dataset says.
    damaged: dict[str, str] = field(default_factory=dict)
    pictures: dict[str, PictureDifference] = field(default_factory=dict)
    file_count: int = 0

    @property
    def is_empty(self) -> bool:
        """Whether the datasets are equal."""
        return not (self.files or self.only_in["A"] or self.only_in["B"])

    def find(self) -> None:
        """Find all differences."""
        self.settings = _changes(self.a.settings, self.b.settings) | self._changed_views()
        self.inputs = _changes(self.a.inputs, self.b.inputs)
        if self.a.of_receipts and self.b.of_receipts:
            self.settings |= _changes(self.a.of_receipts.rig, self.b.of_receipts.rig)
            self.inputs |= _changes(self.a.of_receipts.inputs, self.b.of_receipts.inputs)
        self.settings = dict(sorted(self.settings.items(), key=lambda item: _order(item[0])))
        self._compare_files()
        self._compare_pictures()

    def _changed_views(self) -> dict[str, str]:
        """Return how the views of both datasets differ in number, pose and split."""
        changes: dict[str, str] = {}
        for place, ours in self.a.lightfields.items():
            theirs = self.b.lightfields.get(place)
            if theirs is None or dataset_facts.reprojection_of(place):
                continue
            at = f" in {place}" if place else ""
            if len(ours.views) != len(theirs.views):
                changes[f"view count{at}"] = f"{len(ours.views)} → {len(theirs.views)}"
            if moved := dataset_facts.changed_poses(ours, theirs):
                farthest = max(moved, key=lambda name: moved[name])
                distance, angle = moved[farthest]
                changes[f"pose{at}"] = (
                    f"{count(len(moved), 'view')} moved, {farthest} by {distance:.3g} m and "
                    f"{angle:.3g}°"
                )
            splits = {view.name: view.split for view in theirs.views}
            others = [v for v in ours.views if v.name in splits and v.split != splits[v.name]]
            if others:
                first = others[0]
                changes[f"{_SPLIT}{at}"] = (
                    f"{count(len(others), 'view')}, such as {first.name}: {first.split} → "
                    f"{splits[first.name]}"
                )
        return changes

    def _compare_files(self) -> None:
        """Compare the bytes of all files."""
        names_a = _names(self.a.folder)
        names_b = _names(self.b.folder)
        self.only_in = {
            "A": [name for name in names_a if name not in names_b],
            "B": [name for name in names_b if name not in names_a],
        }
        common_names = [name for name in names_a if name in names_b]
        self.file_count = len(common_names)
        progress = Progress(self.file_count, "diff", "files")
        for name in common_names:
            paths = self._paths(name)
            if not filecmp.cmp(*paths, shallow=False):
                sizes = [path.stat().st_size for path in paths]
                if sizes[0] == sizes[1]:
                    self.files[name] = f"both have {count(sizes[0], 'byte')}"
                else:
                    self.files[name] = f"{sizes[0]:,} → {count(sizes[1], 'byte')}"
                self._check_sums(name)
            progress.done()

    def _check_sums(self, name: str) -> None:
        """Note a file that differs, if it is not as its own list of checksums says."""
        for where, sums, path in zip("AB", self._sums, self._paths(name), strict=True):
            if name in sums and sums[name] != sha256(path):
                self.damaged[name] = where
                self.files[name] += f"; {where}'s is not as its {SUMS} says"

    @cached_property
    def _sums(self) -> list[dict[str, str]]:
        """The checksums that both datasets list."""
        lists: list[dict[str, str]] = []
        for facts in (self.a, self.b):
            sums: dict[str, str] = {}
            for path in (facts.folder / SUMS, *facts.folder.glob(f"*/{SUMS}")):
                home = path.parent.relative_to(facts.folder)
                listed = read_sums(path) if path.is_file() else {}
                sums |= {(home / name).as_posix(): digest for name, digest in listed.items()}
            lists.append(sums)
        return lists

    def _compare_pictures(self) -> None:
        """Compare the pixels of all images that differ."""
        names = [name for name in self.files if name.endswith(_IMAGE_SUFFIXES)]
        if not names:
            return
        progress = Progress(len(names), "diff", "images")
        for name in names:
            found = self.pictures[name] = picture_difference.compare(*self._paths(name))
            if found.unreadable:
                self.damaged.setdefault(name, found.unreadable[0])
            progress.done()

    def _paths(self, name: str) -> tuple[Path, Path]:
        return self.a.folder / name, self.b.folder / name

    def cause(self) -> str:
        """Return in one line why the datasets differ."""
        if self.is_empty:
            return f"equal: {count(self.file_count, 'file')} of {self.a.folder} and {self.b.folder}"
        subject, reasons = self._first_difference()
        if self.pictures and self._has_equal_pixels():
            differing = _listed([*self.settings, *self.inputs])
            return f"equal pixels; only {differing or 'how the files are written differs'}"
        if reasons:
            return f"{subject} differ because {_listed(reasons)}"
        if not self.files:
            return self._missing_files()
        if self.damaged:
            name, where = next(iter(self.damaged.items()))
            return f"{subject} differ because {where} has damaged files, such as {name}"
        if machines := [f"{key}: {self.inputs[key]}" for key in _MACHINES if key in self.inputs]:
            other = " and ".join(machines)
            return f"equal settings; other {other}: last digits may differ, see {_EQUAL_BYTES}"
        machine = self.a.inputs.get("machine", "no machine in lightfield.json")
        versions = f"bpy {self.a.inputs.get('bpy', 'unknown')}, {machine}"
        return f"{subject} differ, but all settings and inputs that are recorded agree ({versions})"

    def _has_equal_pixels(self) -> bool:
        """Return whether both datasets have the same images, with equal pixels."""
        only = [*self.only_in["A"], *self.only_in["B"]]
        has_more = any(name.endswith(_IMAGE_SUFFIXES) for name in only)
        return not has_more and all(found.has_equal_pixels for found in self.pictures.values())

    def _missing_files(self) -> str:
        """Return the cause if all files that both have are equal."""
        lacks = {"A": "B", "B": "A"}
        return "; ".join(
            f"{lacks[where]} lacks {count(len(names), 'file')} of {where}, such as {names[0]}"
            for where, names in self.only_in.items()
            if names
        )

    def _first_difference(self) -> tuple[str, list[str]]:
        """Return what differs first on the way from the views to the exports, and its reasons."""
        equal = {name for name, found in self.pictures.items() if found.has_equal_pixels}
        names = [*(self.files.keys() - equal), *self.only_in["A"], *self.only_in["B"]]
        if any(_is_of_views(name) for name in names):
            reasons = [
                key for key in self.settings if key.startswith(_KEYS_OF_VIEWS) and key != _NAME
            ]
            if any(key.startswith("rig.") for key in reasons):
                # These follow from the keys of the rig.
                reasons = [key for key in reasons if not key.startswith(_RESULTS_OF_RIG)]
            return "the views", reasons or [key for key in self.inputs if key not in _MACHINES]
        reprojections = {
            dataset_facts.reprojection_of(place)
            for facts in (self.a, self.b)
            for place in facts.lightfields
        } - {""}
        for reprojection in sorted(reprojections):
            if any(_is_of_reprojection(name, reprojection) for name in names):
                prefix = f"reprojections.{reprojection}"
                reasons = [key for key in self.settings if f"{key}.".startswith(f"{prefix}.")]
                if reasons:
                    return f"the images in {reprojection}", reasons
        return "the files", [*self.settings]

    def sections(self) -> Iterable[tuple[str, Sequence[str]]]:
        """Yield the titles and lines of what differs."""
        yield "settings", [f"{key}: {change}" for key, change in self.settings.items()]
        yield "inputs", [f"{key}: {change}" for key, change in self.inputs.items()]
        for where, names in self.only_in.items():
            yield f"files only in {where}: {len(names)}", names
        title = f"files with other bytes: {len(self.files)} of {self.file_count}"
        yield title, [f"{name}: {change}" for name, change in self.files.items()]
        folders: dict[str, list[str]] = {}
        for name in self.pictures:
            folders.setdefault(str(Path(name).parent), []).append(name)
        for folder, names in folders.items():
            yield f"pixels in {folder}", self._lines_of_pictures(names)

    def _lines_of_pictures(self, names: list[str]) -> list[str]:
        """Return a line for each image, the one that differs most first."""

        def rank(name: str) -> tuple[float, float]:
            found = self.pictures[name]
            return (math.inf if found.psnr is None else found.psnr, -found.size)

        lines: list[str] = []
        for name in sorted(names, key=rank):
            found = self.pictures[name]
            remarks = [*found.remarks]
            if found.psnr is not None and math.isfinite(found.psnr) and len(lines) < _MOST_LINES:
                flip = picture_difference.flip(*self._paths(name))
                remarks += [f"PSNR {found.psnr:.1f} dB", f"FLIP {flip:.3g}"]
            lines.append(f"{Path(name).name}: {', '.join(remarks)}")
        return lines


def _names(folder: Path) -> dict[str, None]:
    """Return the paths of a dataset's files in it, in their order."""
    names: dict[str, None] = {}
    for path in files_below(folder):
        relative = path.relative_to(folder)
        is_of_package = relative.as_posix() in PACKAGED
        # A list of checksums follows from the other files, and a validation's figures do.
        is_derived = relative.name in (SUMS, VALIDATION)
        if REPORT not in relative.parts[:2] and not is_of_package and not is_derived:
            names[relative.as_posix()] = None
    return names


def _is_of_views(name: str) -> bool:
    """Return whether a file is a view, or a pass of a view."""
    folder, _, file = dataset_facts.in_frame(name).partition("/")
    is_group = folder.startswith(GROUP_PREFIX)
    return "/" not in file and (is_group or folder in (IMAGES, FLOW.name, *PASSES))


def _is_of_reprojection(name: str, reprojection: str) -> bool:
    """Return whether a file lies in the folder of a reprojection."""
    parts = dataset_facts.in_frame(name).split("/")
    return len(parts) == 2 and parts[0] == reprojection and parts[1] != NAME


def _changes(a: Mapping[str, Any], b: Mapping[str, Any]) -> dict[str, str]:
    """Return the values that differ, as ``value → other value``, by their keys.

    A block that only one has, such as a reprojection, counts as one key.
    """
    changes = {}
    for key in {**a, **b}:
        if key in a and key in b:
            if a[key] != b[key]:
                changes[key] = f"{shortened(a[key])} → {shortened(b[key])}"
            continue
        mine, others, where = (a, b, "A") if key in a else (b, a, "B")
        block = re.match(r"(?:reprojections|exports)\.[^.]+|mesh|video", key)
        if block and not any(f"{other}.".startswith(f"{block[0]}.") for other in others):
            changes[block[0]] = f"only in {where}"
        else:
            values = (shortened(mine[key]), "–")
            changes[key] = " → ".join(values if where == "A" else reversed(values))
    return changes


def _listed(keys: Sequence[str]) -> str:
    """Return the keys that differ as a part of a sentence. "" without keys."""
    if not keys:
        return ""
    others = " and others" if keys[3:] else ""
    return f"{', '.join(keys[:3])}{others} {'differs' if len(keys) == 1 else 'differ'}"


def _order(key: str) -> int:
    """Return the place of a setting's block in the output."""
    if key.startswith(("mesh", "video", "exports")):
        return len(_BLOCKS)
    block = key.partition(" in ")[0].partition(".")[0]
    return _BLOCKS.index(block if block in _BLOCKS else "")


def _first_lines(lines: Sequence[str]) -> list[str]:
    """Return the first lines, and how many more there are."""
    more = len(lines) - _MOST_LINES
    shown = [f"  {line}" for line in lines[:_MOST_LINES]]
    return [*shown, f"  and {more:,} more"] if more > 0 else shown
