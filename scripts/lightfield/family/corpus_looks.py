"""How the members of a corpus look: a thumbnail of each, its depths and its brightness.

Only a few views of each dataset are read. A cache keeps the result until the views change.
"""

import hashlib
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from lightfield.configuration.corpus import THUMBNAILS
from lightfield.configuration.shown_look import ShownLook
from lightfield.core.errors import UserError
from lightfield.core.files import read_json, sha256, write_bytes, write_json
from lightfield.core.progress import Progress
from lightfield.engine import receipts
from lightfield.formats.layout import IMAGES
from lightfield.formats.lightfield import NAME, LightField
from lightfield.geometry.depth import converted
from lightfield.imaging import images, pictures
from lightfield.imaging.look import Look as BlenderLook
from lightfield.workflow.member_record import MemberRecord

# Views of a dataset that are read, evenly spread over it.
VIEWS = 4
# Pixels of a thumbnail's longer side.
THUMBNAIL = 160
_QUALITY = 75
# Write the cache after each so many members, so that a kill loses little work.
STEP = 200

Array = pictures.Array
# The sums over the pixels of a member's views, and the SHA-256 of its thumbnail.
Look = Mapping[str, Any]


def looks(
    folder: Path,
    members: Sequence[MemberRecord],
    cache: Path,
    shown_look: ShownLook | None = None,
) -> dict[str, Look]:
    """Return the look of each valid member by its name, and write the missing thumbnails.

    ``shown_look`` is Blender's look of the thumbnails, if they have one. Removes the thumbnails of
    others. ``folder`` is the family's. Raises `UserError` if a view is missing or damaged.
    """
    cached = _read(cache)
    valid = [member for member in members if member.is_valid and member.datasets]
    looks_by_member = {
        member.name: cached[member.name]
        for member in valid
        if _holds(folder, member, cached, shown_look)
    }
    if receipt := receipts.current():
        for name in looks_by_member:
            receipt.note_kept(thumbnail(folder, name))
    new = [member for member in valid if member.name not in looks_by_member]
    if new:
        progress = Progress(len(new), "thumbnails", "members", len(looks_by_member))
        for number, member in enumerate(new, 1):
            looks_by_member[member.name] = {
                "made_of": _made_of(member, shown_look),
                **_look(folder, member, shown_look),
            }
            if number % STEP == 0:
                write_json(cache, looks_by_member)
            progress.done()
    if looks_by_member != cached:
        write_json(cache, looks_by_member)
    for path in folder.glob(f"{THUMBNAILS}/*.webp"):
        if path.stem not in looks_by_member:
            path.unlink()
    return {
        member.name: {
            key: value for key, value in looks_by_member[member.name].items() if key != "made_of"
        }
        for member in valid
    }


def thumbnail(folder: Path, name: str) -> Path:
    """Return the path of a member's thumbnail."""
    return folder / THUMBNAILS / f"{name}.webp"


def _read(cache: Path) -> dict[str, dict[str, Any]]:
    """Return the content of a cache. Empty if it is missing or damaged: it can be made again."""
    try:
        content = read_json(cache)
    except UserError:
        return {}
    return content if isinstance(content, dict) else {}


def _made_of(member: MemberRecord, shown_look: ShownLook | None) -> str:
    """Return a key that changes with the datasets' bytes and with the settings of their looks."""
    sums = [[rig, dataset.sha256sums] for rig, dataset in sorted(member.datasets.items())]
    made_of = repr([sums, VIEWS, THUMBNAIL, _QUALITY, *([shown_look] if shown_look else [])])
    return hashlib.sha256(made_of.encode()).hexdigest()


def _holds(
    folder: Path,
    member: MemberRecord,
    cached: Mapping[str, dict[str, Any]],
    shown_look: ShownLook | None,
) -> bool:
    """Return whether the cache knows a member as it is, and its thumbnail is whole."""
    entry = cached.get(member.name, {})
    path = thumbnail(folder, member.name)
    return (
        entry.get("made_of") == _made_of(member, shown_look)
        and path.is_file()
        and sha256(path) == entry.get("thumbnail")
    )


def _look(folder: Path, member: MemberRecord, shown_look: ShownLook | None) -> dict[str, Any]:
    """Read views of a member, and write its thumbnail. Return what the views show.

    - ``depth``: the least and the largest distance in metres, or null without any surface.
    - ``brightness``: the mean luminance of what is visible; transparent pixels do not count.
    - ``over_exposed``: the share of this beyond 1 in a channel.
    - ``covered``: the share of the pixels that show a surface, or null without depth.
    - ``thumbnail``: the SHA-256 of the thumbnail.
    """
    datasets = [folder / member.name / rig for rig in sorted(member.datasets)]
    views = [view for dataset in datasets for view in _measured_views(dataset)]
    opacity = sum(view["opacity"] for view in views)
    depths = [depth for view in views for depth in view["depth"]]
    covered = [view["covered"] for view in views if view["covered"] is not None]
    look = shown_look.resolved(LightField.read(datasets[0] / NAME)) if shown_look else None
    content = _webp(views[len(views) // 2]["image"], look)
    write_bytes(thumbnail(folder, member.name), content)
    return {
        "depth": [round(min(depths), 4), round(max(depths), 4)] if depths else None,
        "brightness": _share(sum(view["light"] for view in views), opacity),
        "over_exposed": _share(sum(view["over_exposed"] for view in views), opacity),
        "covered": round(float(np.mean(covered)), 4) if covered else None,
        "thumbnail": hashlib.sha256(content).hexdigest(),
    }


def _share(part: float, whole: float) -> float:
    return round(part / whole, 4) if whole else 0.0


def chosen_views(dataset: Path, lightfield: LightField) -> list[Path]:
    """Return the files of the views of a dataset that are read, evenly spread over it."""
    names = [view.name for view in lightfield.views]
    count = min(VIEWS, len(names))
    numbers = [(2 * step + 1) * len(names) // (2 * count) for step in range(count)]
    return [dataset / IMAGES / f"{names[number]}.exr" for number in numbers]


def _measured_views(dataset: Path) -> Iterator[dict[str, Any]]:
    """Yield what `_measured` returns for each of the `chosen_views`."""
    lightfield = LightField.read(dataset / NAME)
    rays = lightfield.lens.pixel_rays()
    for path in chosen_views(dataset, lightfield):
        yield _measured(path, rays, lightfield.depth)


def _measured(path: Path, rays: Array, meaning: str | None) -> dict[str, Any]:
    """Return a view's sums over its pixels, which `_look` puts together.

    ``rays`` (height, width, 3) and the ``meaning`` of depth are as in `converted`.
    """
    image = images.read_image(path)
    colour = np.where(np.isfinite(image.colour), image.colour, 0)
    alpha = image.channels.get("A", np.ones(colour.shape[:2], np.float32)).astype(np.float32)
    depth = image.channels.get("Z", np.full(alpha.shape, math.inf, np.float32))
    distance = converted(depth, rays, meaning, "distance")
    hit = distance[np.isfinite(distance) & (distance > 0)]
    return {
        "image": np.dstack([colour, alpha]),
        "opacity": float(alpha.sum(dtype=np.float64)),
        "light": float(pictures.luminance(colour).sum(dtype=np.float64)),
        "over_exposed": float(alpha[(colour > 1).any(axis=-1)].sum(dtype=np.float64)),
        "depth": [float(hit.min()), float(hit.max())] if hit.size else [],
        "covered": hit.size / distance.size if "Z" in image.channels else None,
    }


def _webp(image: Array, look: BlenderLook | None) -> bytes:
    """Return linear (height, width, 4) pixels with associated alpha as a thumbnail."""
    file = io.BytesIO()
    picture = Image.fromarray(pictures.thumbnail(image, THUMBNAIL, look=look))
    picture.save(file, "WEBP", quality=_QUALITY, method=4)
    return file.getvalue()
