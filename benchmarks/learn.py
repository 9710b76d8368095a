"""Learn radiance fields from exported files: held-out views of each lens, beside wrong readings.

Runs in the consumers' environment (.venv-consumers), which has torch. Reads nerfstudio exports with
depth. A field is learned from each export as it is, and from each with one thing wrong:

- poses that belong to other views;
- mirrored images;
- depth of the other kind: Z taken for distance, and distance for Z.

Everything else is the same, steps and seeds too.

STEM.csv has a row for each field and each of its evaluations. STEM.svg and STEM.png show the curves
and a held-out view of each field.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

import torch

from lightfield.core.cli import run
from lightfield.core.files import write_csv
from lightfield.core.progress import Progress
from lightfield.imaging import plots
from nerfstudio_views import TRUE, Array, Views, read, readings
from radiance_field import Field

RAYS = 2048
STEPS = 400
RATE = 1e-2
LAST_RATE = 1e-3
# How often a field is evaluated while it learns, and at how many held-out rays.
EVALUATIONS = 4
EVALUATED_RAYS = 4000
Row = dict[str, Any]


def learn(views: Views, progress: Progress, steps: int = STEPS) -> tuple[Field, list[Row]]:
    """Return the field that the training views teach, and its quality along the way.

    Each row has ``step``, and ``psnr`` in decibel at rays of the test views.
    """
    torch.manual_seed(0)
    positions = views.poses[:, :3, 3]
    center = positions.mean(axis=0)
    radius = float(np.linalg.norm(positions - center, axis=1).max())
    field = Field(torch.tensor(center, dtype=torch.float32), radius)
    optimizer = torch.optim.Adam(field.parameters(), RATE, betas=(0.9, 0.99), eps=1e-12)
    decay = (LAST_RATE / RATE) ** (1 / steps)
    schedule = torch.optim.lr_scheduler.ExponentialLR(optimizer, decay)
    pixels = [torch.from_numpy(part) for part in views.pixels(test=False)]
    rows: list[Row] = []
    for step in range(1, steps + 1):
        chosen = torch.randint(len(pixels[0]), (RAYS,))
        optimizer.zero_grad()
        field.loss(*(part[chosen] for part in pixels)).backward()
        optimizer.step()
        schedule.step()
        if step % (steps // EVALUATIONS) == 0:
            rows.append({"step": step, "psnr": psnr(field, views)})
            progress.done()
    return field, rows


def psnr(field: Field, views: Views) -> float:
    """Return the PSNR in decibel of a field at random rays of the test views."""
    pixels = views.pixels(test=True)
    chosen = np.random.default_rng(2).integers(0, len(pixels[0]), EVALUATED_RAYS)
    origins, rays, colour, _ = (torch.from_numpy(part[chosen]) for part in pixels)
    error = field.render(origins, rays) - colour
    return -10 * float((error**2).mean().log10())


def picture(field: Field, views: Views) -> Array:
    """Return the field's render (h, w, 3) of the first test view, and the view itself below."""
    first = np.flatnonzero(views.test)[0]
    pose = torch.tensor(views.poses[first, :3], dtype=torch.float32)
    rays = torch.tensor(views.rays.reshape(-1, 3), dtype=torch.float32) @ pose[:, :3].T
    shown = field.render(pose[:, 3].expand(len(rays), -1), rays).numpy().reshape(views.rays.shape)
    shown[~views.valid[first]] = 0
    return np.vstack([shown, views.colour[first]])


def draw(rows: Sequence[Row], pictures: Mapping[str, Mapping[str, Array]], stem: Path) -> None:
    """Draw the curves of each lens, and for each reading its render above the view itself."""
    columns = 1 + max(map(len, pictures.values()))
    with plots.plot(stem, len(pictures), columns, (2.5 * columns, 3 * len(pictures))) as axes:
        lines = np.reshape(axes, (-1, columns))
        for line, (lens, shown) in zip(lines, pictures.items(), strict=True):
            same_lens = [row for row in rows if row["learned"] == row["held_out"] == lens]
            for number, (reading, image) in enumerate(shown.items()):
                curve = [row for row in same_lens if row["reading"] == reading]
                steps = [row["step"] for row in curve]
                values = [row["psnr"] for row in curve]
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
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("exports", type=Path, nargs="+", help="folders of nerfstudio exports, each of a lens")
    add("--steps", type=int, default=STEPS, help=f"steps of learning (default: {STEPS})")
    add("--output", type=Path, required=True, metavar="STEM", help="path without a suffix")
    arguments = parser.parse_args()

    exported = [read(folder) for folder in arguments.exports]
    crops = [views for views in exported if views.lens == "perspective"]
    progress = Progress(len(exported) * 4 * EVALUATIONS, "learn", "evaluations")
    rows: list[Row] = []
    pictures: dict[str, dict[str, Array]] = {}
    for views in exported:
        for reading, changed_views in readings(views):
            field, curve = learn(changed_views, progress, arguments.steps)
            pictures.setdefault(views.lens, {})[reading] = picture(field, changed_views)
            field_name = {"learned": views.lens, "reading": reading}
            rows += [field_name | {"held_out": views.lens} | row for row in curve]
            if reading == TRUE:
                last = field_name | {"step": arguments.steps}
                for crop in crops:
                    if crop is not views:
                        rows.append(last | {"held_out": crop.lens, "psnr": psnr(field, crop)})
            print(f"{views.lens} {reading}: {curve[-1]['psnr']:.2f} dB", flush=True)
    write_csv(arguments.output.with_name(f"{arguments.output.name}.csv"), rows)
    draw(rows, pictures, arguments.output)


if __name__ == "__main__":
    run(main)
