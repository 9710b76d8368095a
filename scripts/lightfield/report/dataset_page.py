"""A dataset's page: one file that shows what it looks like, how good it is, what it cost."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import absolute_path
from lightfield.dataset import blend
from lightfield.dataset.lightfield import NAME, LightField
from lightfield.dataset.passes import FLOW
from lightfield.dataset.splits_file import SPLITS
from lightfield.export import transforms
from lightfield.geometry import rigs
from lightfield.geometry.lenses import Lens
from lightfield.geometry.overview import middle_view
from lightfield.imaging import images
from lightfield.report import contact_sheet, faults, page, pass_pictures, tables, views
from lightfield.report.packing import webp
from lightfield.validation.files import IMAGES, REPORT, SUMS

PICTURES = ("overview", "contact_sheet")
PLOTS = ("depth", "noise")
WIDEST = 1600
# Of each reprojection so many views are shown.
MOST_REPROJECTED = 24
SHEET_QUALITY = 84
DEPTHS = {"z": "Z-depth, metres", "distance": "distance, metres"}


@dataclass(frozen=True)
class Origin:
    """What the page says of how the dataset came about, beside what its files do."""

    rig: rigs.Rig
    # Of the scene YAML, the text; and what makes the dataset from it.
    yaml: str
    command: str
    has_panorama: bool
    measurements: Sequence[Path] = ()
    # What the scene's .blend says, for a user's own.
    inventory: Mapping[str, Any] | None = None


def write(output: Path, folder: Path, name: str, origin: Origin) -> None:
    """Write the page of the dataset in ``folder``, which is called ``name``: scene/rig.

    What is not there (validation, measurements, depth, costs) has no section.
    """
    lightfield = LightField.read(folder / NAME)
    rig = origin.rig
    lightfield.require_rig(rig)
    validation = tables.validation(folder / "validation.json")
    looks = views.collect(folder / IMAGES, lightfield, rig, _unreadable(validation))
    middle = lightfield.views[middle_view(rig)]
    report = folder / REPORT
    found = origin.measurements
    own = absolute_path(folder)
    measured = {
        "error_vs_time": tables.error_vs_time(found, str(lightfield.scene["name"])),
        "synthesis": tables.synthesis(found, f"{own.parent.name}/{own.name}"),
        "learning": tables.learning(found, f"{own.parent.name}/{own.name}"),
        "reprojection": tables.reprojection(found),
        "stability": tables.stability(found),
    }
    page.write(
        output,
        "page.html.j2",
        name=name,
        home="../" * (name.count("/") + 2) + "index.html",
        facts=facts(folder, lightfield, rig, looks.missed),
        middle=None if origin.has_panorama else middle.name,
        passes_of=middle.name,
        pictures={stem: page.photo(report / f"{stem}.png", WIDEST) for stem in PICTURES},
        plots={stem: page.plot(report / stem) for stem in PLOTS},
        taken=_taken(origin, lightfield),
        looks=looks,
        frames=list(rig.sequence.folders) if rig.sequence else [],
        frame=own.name,
        passes=list(pass_pictures.collect(folder, lightfield, middle, looks.data["exposure"])),
        reprojected=list(_reprojected(folder)),
        render=lightfield.render,
        validation=validation,
        faults={
            (group, check["short"]): faults.collect(folder / (group or IMAGES), check["views"])
            for group, check in _failed(validation)
        },
        measured={title: one for title, one in measured.items() if one},
        costs=tables.costs(report / "costs.json"),
        files=files(folder, lightfield, valid=not validation or validation["valid"]),
        transforms=[path.relative_to(folder).as_posix() for path in transforms(folder)],
        yaml=origin.yaml,
        command=origin.command,
    )


def _taken(origin: Origin, lightfield: LightField) -> list[str]:
    """Return what was taken of the user's own .blend and what was not; nothing without one."""
    if origin.inventory is None:
        return []
    own_camera = isinstance(origin.rig, rigs.BlendCamera)
    return blend.usage_notes(origin.inventory, [lightfield.frame], lightfield.render, own_camera)


def _failed(validation: Mapping[str, Any] | None) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield each failed check with the image set that it is of, "" for the views."""
    for group, checks in (validation or {"groups": {}})["groups"].items():
        yield from ((group, check) for check in checks if check["passed"] is False)


def _unreadable(validation: Mapping[str, Any] | None) -> set[str]:
    """Return the views of which validation says that they are missing or no whole images."""
    return {
        view
        for group, check in _failed(validation)
        if not group and check["short"] in ("views", "images")
        for view in check["views"]
    }


def facts(
    folder: Path, lightfield: LightField, rig: rigs.Rig, missed: float | None
) -> list[tuple[str, str]]:
    """Return what one wants to know first of a dataset, each with its title.

    ``missed`` is the part of the depths that are inf.
    """
    lens = lightfield.lens
    render = lightfield.render
    parts = [view.split for view in lightfield.views]
    counts = [f"{parts.count(part)} {part}" for part in dict.fromkeys(parts) if part]
    # Views that others made say nothing of theirs.
    samples = f"{render['samples']} a pixel" if "samples" in render else None
    if render.get("adaptive_threshold"):
        samples = f"up to {samples}, adaptive"
    if render.get("denoise"):
        samples = f"{samples}, denoised"
    exrs = list((folder / IMAGES).glob("*.exr"))
    first = folder / IMAGES / f"{lightfield.views[0].name}.exr"
    bpy = images.attribute(first, images.BPY_ATTRIBUTE)
    found = {
        "Views": f"{len(parts)}" + (f" ({', '.join(counts)})" if counts else ""),
        "Rig": rig_text(rig, lightfield.matrices[:, :3, 3]),
        "Lens": lens.description,
        "Field of view": field_of_view(lens),
        "Resolution": f"{lens.width} × {lens.height}",
        "Frame": str(lightfield.frame),
        "Samples": samples,
        "Depth": DEPTHS.get(lightfield.depth or "", "none"),
        "Depth that is inf": None if missed is None else f"{100 * missed:.3g} %",
        "Size of the views": page.bytes_(sum(path.stat().st_size for path in exrs)),
        "Rendered by": bpy and f"Cycles in bpy {bpy}",
    }
    return [(title, text) for title, text in found.items() if text]


def rig_text(rig: rigs.Rig, places: views.Array) -> str:
    """Return a rig in words: its type, its cameras along each axis, and its size.

    Loose poses and paths are as large as the box around their ``places`` (n, 3).
    """
    kind = rig.type
    if isinstance(rig, rigs.Grid):
        kind += " " + " × ".join(map(str, rig.cameras))
    size = tuple(np.ptp(places, axis=0).tolist()) if rig.is_loose else rig.size
    if isinstance(size, tuple):
        return f"{kind}, {' × '.join(f'{side:.4g}' for side in size)} m"
    return f"{kind}, {'⌀ ' if rig.is_round else ''}{size:g} m"


def field_of_view(lens: Lens) -> str:
    """Return the angles that the image spans, across and down, through the principal point."""
    x, y = lens.center
    lines = (
        lens.rays(np.linspace(0, lens.width, 513), y),
        lens.rays(x, np.linspace(0, lens.height, 513)),
    )
    angles = []
    for rays in lines:
        seen = rays[np.isfinite(rays[:, 0])]
        chords = np.linalg.norm(np.diff(seen, axis=0), axis=1)
        angles.append(math.degrees(2 * np.arcsin(chords / 2).sum()))
    return " × ".join(f"{angle:.4g}°" for angle in angles)


def _reprojected(folder: Path) -> Iterator[tuple[str, str, int, int, str]]:
    """Yield name, lens, number of views and of those shown, and sheet of each reprojection."""
    for path in sorted(folder.glob(f"*/{NAME}")):
        lightfield = LightField.read(path)
        lens = lightfield.lens
        count = len(lightfield.views)
        shown = lightfield.views[:: math.ceil(count / MOST_REPROJECTED)]
        suffix = next((one.suffix for one in path.parent.glob(f"{shown[0].name}.*")), ".exr")
        paths = [path.with_name(f"{view.name}{suffix}") for view in shown]
        sheet = webp(contact_sheet.sheet(paths, lens.width, lens.height), SHEET_QUALITY)
        yield path.parent.name, lens.description, count, len(shown), sheet


def files(folder: Path, lightfield: LightField, valid: bool) -> list[tuple[str, str]]:
    """Return the dataset's files and what each is; only a valid one has checksums."""
    depth = {
        "z": ", and Z: metres along the optical axis",
        "distance": ", and Z: metres from the camera",
    }.get(lightfield.depth or "", "")
    if depth:
        depth += "; inf where a ray hit nothing"
    first = lightfield.views[0].name
    found = [
        (f"{IMAGES}/{first}.exr …", f"the views: scene-linear Rec. 709 R, G, B as half{depth}"),
        ("lightfield.json", "the lens once; position, rotation, and world_matrix of each view"),
    ]
    wanted = [*lightfield.passes, *([FLOW] if lightfield.views[0].flow else [])]
    found += [(f"{one.name}/", one.meaning) for one in wanted]
    if (folder.parent / SPLITS).is_file():
        found.append((f"../{SPLITS}", "which of the scene's views train, and which test"))
    for inner in sorted(folder.glob(f"*/{NAME}")):
        lens = LightField.read(inner).lens.description
        found.append((f"{inner.parent.name}/", f"the same views through another lens: {lens}"))
    found.append(("validation.json", "what was checked, and what came out"))
    if valid:
        found.append((SUMS, f"checksums of all of these: sha256sum -c {SUMS}"))
    return found
