"""Learn radiance fields from exported files: held-out views of each lens, beside wrong readings.

Reads nerfstudio exports with depth (transforms.json, images/, depths/, masks/), as nerfstudio
documents them and not by the code that wrote them. Each is learned as it is, and with one thing
wrong: poses that belong to other views, images mirrored, depth of the other kind (Z taken for
distance, and distance for Z). Steps, seeds and all else are the same.

STEM.csv has a row for each field and each time it was looked at, STEM.svg and STEM.png the curves
and a held-out view of each.
"""

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.cli import run
from lightfield.core.files import read_json, write_csv
from lightfield.core.progress import Progress
from lightfield.imaging import images, plots
from radiance_field import RAYS, STEPS, Array, Field

LENSES = {"PINHOLE": "perspective", "OPENCV_FISHEYE": "fisheye", "EQUIRECTANGULAR": "panorama"}
TRUE = "as exported"
MILLIMETRES = 1000
Row = dict[str, Any]
# A field is looked at so many times on the way, at so many held-out rays.
LOOKS, LOOKED_AT = 4, 4000


@dataclass(frozen=True)
class Views:
    """Views through one lens; ``rays`` (h, w, 3) of unit length in the camera's own axes.

    ``depth`` (n, h, w) is metres as the files have it, inf for none, of the ``kind`` "Z" or
    "distance"; ``poses`` (n, 4, 4) are camera-to-world; ``valid`` (n, h, w) is what the lens sees.
    """

    lens: str
    rays: Array
    kind: str
    poses: Array
    colour: Array
    depth: Array
    valid: Array
    test: Array

    @property
    def distance(self) -> Array:
        if self.kind == "distance":
            return self.depth
        return self.depth / np.maximum(np.abs(self.rays[..., 2]), 0.05)

    def pixels(self, test: bool) -> tuple[Array, ...]:
        """Return origins, rays, colour and distance of all pixels of the views that test or not."""
        chosen = np.flatnonzero(self.test == test)
        rays = np.einsum("hwc,nrc->nhwr", self.rays, self.poses[chosen, :3, :3])
        origins = np.broadcast_to(self.poses[chosen, None, None, :3, 3], rays.shape)
        seen = self.valid[chosen]
        parts = (origins, rays, self.colour[chosen], self.distance[chosen])
        return tuple(np.asarray(part[seen], np.float32) for part in parts)


def read(folder: Path) -> Views:
    """Return the views of a nerfstudio export. Source: nerfstudio_dataparser.py, cameras.py."""
    content = read_json(folder / "transforms.json")
    frames = content["frames"]

    def stack(key: str, *channels: str) -> Array:
        found = [images.read_image(folder / frame[key], channels).channels for frame in frames]
        return np.stack([np.stack([one[name] for name in channels], -1) for one in found])

    first = images.read_image(folder / frames[0]["file_path"]).channels
    colour = stack("file_path", *"RGB") / np.float32(255)
    if "A" in first:
        colour = colour * (stack("file_path", "A") / np.float32(255))
    depth = stack("depth_file_path", "Y")[..., 0] / np.float32(MILLIMETRES)
    rays, kind = _rays(content)
    return Views(
        LENSES[content["camera_model"]],
        rays,
        kind,
        np.array([frame["transform_matrix"] for frame in frames]),
        colour,
        np.where(depth > 0, depth, np.float32(np.inf)),
        stack("mask_path", "Y")[..., 0] > 0 if "mask_path" in frames[0] else depth >= 0,
        np.array([frame["file_path"] in content["test_filenames"] for frame in frames]),
    )


def _rays(content: dict[str, Any]) -> tuple[Array, str]:
    """Return the rays (h, w, 3) of a camera that looks along −z, and what its depth is."""
    column, row = np.meshgrid(np.arange(content["w"]) + 0.5, np.arange(content["h"]) + 0.5)
    x = (column - content["cx"]) / content["fl_x"]
    y = -(row - content["cy"]) / content["fl_y"]
    if content["camera_model"] == "PINHOLE":
        rays = np.stack([x, y, -np.ones_like(x)], axis=-1)
        return rays / np.linalg.norm(rays, axis=-1, keepdims=True), "Z"
    if content["camera_model"] == "OPENCV_FISHEYE":
        angle = np.hypot(x, y)
        across = np.sinc(angle / np.pi)
        return np.stack([x * across, y * across, -np.cos(angle)], axis=-1), "distance"
    longitude, latitude = np.pi * x, np.pi * y
    level = np.cos(latitude)
    return np.stack(
        [np.sin(longitude) * level, np.sin(latitude), -np.cos(longitude) * level], axis=-1
    ), "distance"


def readings(views: Views) -> Iterator[tuple[str, Views]]:
    """Yield the views as exported, and with one thing wrong."""
    yield TRUE, views
    order = np.random.default_rng(1).permutation(len(views.poses))
    yield "shuffled poses", replace(views, poses=views.poses[order])
    mirrored = {name: getattr(views, name)[:, :, ::-1] for name in ("colour", "depth", "valid")}
    yield "mirrored images", replace(views, **mirrored)
    other = {"Z": "distance", "distance": "Z"}[views.kind]
    yield f"{views.kind} taken for {other}", replace(views, kind=other)


def learn(views: Views, progress: Progress, steps: int = STEPS) -> tuple[Field, list[Row]]:
    """Return the field that the views to train on teach, and how good it was on the way.

    Each row has ``step``, and ``psnr`` in decibel at rays of the views that test.
    """
    places = views.poses[:, :3, 3]
    center = places.mean(axis=0)
    radius = float(np.linalg.norm(places - center, axis=1).max())
    field = Field(center, radius, steps)
    train, random = views.pixels(test=False), np.random.default_rng(0)
    rows: list[Row] = []
    for step in range(1, steps + 1):
        chosen = random.integers(0, len(train[0]), RAYS)
        field.learn(*(part[chosen] for part in train))
        if step % (steps // LOOKS) == 0:
            rows.append({"step": step, "psnr": psnr(field, views)})
            progress.done()
    return field, rows


def psnr(field: Field, views: Views) -> float:
    """Return the likeness in decibel of a field to rays of the views that test."""
    test = views.pixels(test=True)
    chosen = np.random.default_rng(2).integers(0, len(test[0]), LOOKED_AT)
    origins, rays, colour, _ = (part[chosen] for part in test)
    error = field.show(origins, rays).clip(0, 1) - colour
    return -10 * float(np.log10((error**2).mean()))


def picture(field: Field, views: Views) -> Array:
    """Return what a field shows (h, w, 3) of the first view that tests, and its truth below."""
    first = np.flatnonzero(views.test)[0]
    pose, rays = views.poses[first], views.rays.reshape(-1, 3) @ views.poses[first, :3, :3].T
    origins = np.broadcast_to(pose[:3, 3], rays.shape)
    shown = field.show(origins, rays.astype(np.float32)).reshape(views.rays.shape).clip(0, 1)
    shown[~views.valid[first]] = 0
    return np.vstack([shown, views.colour[first]])


def draw(rows: Sequence[Row], pictures: Mapping[str, Mapping[str, Array]], stem: Path) -> None:
    """Draw the curves of each lens, and of each reading what it shows above what it was shown."""
    columns = 1 + max(map(len, pictures.values()))
    with plots.plot(stem, len(pictures), columns, (2.5 * columns, 3 * len(pictures))) as axes:
        lines = np.reshape(axes, (-1, columns))
        for line, (lens, shown) in zip(lines, pictures.items(), strict=True):
            own = [row for row in rows if row["learned"] == row["held_out"] == lens]
            for number, (reading, image) in enumerate(shown.items()):
                curve = [row for row in own if row["reading"] == reading]
                steps, values = [row["step"] for row in curve], [row["psnr"] for row in curve]
                style = {"color": plots.COLOURS[number], "marker": plots.MARKERS[number]}
                line[0].plot(steps, values, label=reading, **style)
                line[1 + number].imshow(image)
                line[1 + number].set_title(f"{reading}\n{values[-1]:.1f} dB", fontsize=9)
            for panel in line[1:]:
                panel.axis("off")
            line[0].set(title=lens, xlabel="steps", ylabel="PSNR of held-out rays, dB")
            # Between the true reading and the wrong ones.
            line[0].legend(fontsize=7, loc="center right", bbox_to_anchor=(1, 0.71))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("exports", type=Path, nargs="+", help="folders of nerfstudio exports, each of a lens")
    add("--steps", type=int, default=STEPS, help=f"of learning (default: {STEPS})")
    add("--output", type=Path, required=True, metavar="STEM")
    arguments = parser.parse_args()

    exported = [read(folder) for folder in arguments.exports]
    crops = [views for views in exported if views.lens == "perspective"]
    progress = Progress(len(exported) * 4 * LOOKS, "learn", "looks")
    rows: list[Row] = []
    pictures: dict[str, dict[str, Array]] = {}
    for views in exported:
        for reading, read_so in readings(views):
            field, found = learn(read_so, progress, arguments.steps)
            pictures.setdefault(views.lens, {})[reading] = picture(field, read_so)
            own = {"learned": views.lens, "reading": reading}
            rows += [own | {"held_out": views.lens} | row for row in found]
            if reading == TRUE:
                last = own | {"step": arguments.steps}
                for other in crops:
                    if other is not views:
                        rows.append(last | {"held_out": other.lens, "psnr": psnr(field, other)})
            print(f"{views.lens} {reading}: {found[-1]['psnr']:.2f} dB", flush=True)
    write_csv(arguments.output.with_name(f"{arguments.output.name}.csv"), rows)
    draw(rows, pictures, arguments.output)


if __name__ == "__main__":
    run(main)
