"""Draw pictures of the documents: each type of rig, and a view in each of its lenses or passes.

Without arguments it draws the rigs. --passes and --lenses name datasets of one's own.
"""

import argparse
import base64
import io
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from lightfield.formats.lightfield import LightField  # noqa: E402
from lightfield.geometry import rigs  # noqa: E402
from lightfield.report import pass_pictures  # noqa: E402

# isort: split
import matplotlib  # noqa: E402
import numpy as np  # noqa: E402
from PIL import Image, ImageDraw, ImageFont  # noqa: E402

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

FOLDER = ROOT / "docs" / "pictures"
KEYS = [
    {"position": [-0.5, -0.4, 0]},
    {"position": [-0.2, 0.4, 0.3]},
    {"position": [0.2, -0.3, 0.1]},
    {"position": [0.5, 0.4, 0.4]},
]
RIGS = [
    {"type": "plane", "cameras": [5, 4]},
    {"type": "cuboid", "cameras": [3, 3, 3]},
    {"type": "cylinder", "cameras": [12, 4]},
    {"type": "sphere", "subdivisions": 2},
    {"type": "lattice", "cameras": [4, 3, 3]},
    {"type": "hemisphere", "count": 40},
    {"type": "ring", "count": 16, "elevation": 30},
    {"type": "spiral", "count": 40, "turns": 3},
    {"type": "path", "count": 12, "keys": KEYS},
    {"type": "random", "count": 20},
]
GREY = "#777777"


def draw_rigs(path: Path) -> None:
    """Draw each type of rig, with an arrow along each camera's optical axis."""
    figure = pyplot.figure(figsize=(13, 5.6), dpi=100)
    for place, settings in enumerate(RIGS, 1):
        poses = rigs.from_settings(settings).poses()
        matrices = np.array([pose.world_from_camera() for pose in poses])
        positions = matrices[:, :3, 3]
        directions = -matrices[:, :3, 2] * 0.2
        middle = (positions.min(axis=0) + positions.max(axis=0)) / 2
        half = np.ptp(positions, axis=0).max() / 2 + 0.12
        axes = figure.add_subplot(2, 5, place, projection="3d")
        axes.quiver(*positions.T, *directions.T, color="#0b8f83", linewidth=1)
        axes.scatter(*positions.T, color="#20435c", s=9)
        axes.set_title(settings["type"], color=GREY)
        axes.set_box_aspect((1, 1, 1), zoom=1.2)
        limits = np.stack([middle - half, middle + half], axis=1)
        axes.set(xlim=limits[0], ylim=limits[1], zlim=limits[2])
        axes.view_init(elev=24, azim=-58)
        axes.set_axis_off()
    figure.subplots_adjust(0, 0, 1, 0.93, 0, 0.08)
    figure.savefig(path, transparent=False)
    pyplot.close(figure)


def sheet(path: Path, tiles: dict[str, Image.Image], columns: int) -> None:
    """Write pictures of equal height side by side, each above its name."""
    font = ImageFont.load_default(15)
    height = max(tile.height for tile in tiles.values())
    names = list(tiles)
    rows = [names[start : start + columns] for start in range(0, len(names), columns)]
    widths = [sum(tiles[name].width + 8 for name in row) - 8 for row in rows]
    picture = Image.new("RGB", (max(widths), len(rows) * (height + 28)), "white")
    draw = ImageDraw.Draw(picture)
    for number, row in enumerate(rows):
        left = 0
        for name in row:
            top = number * (height + 28)
            picture.paste(tiles[name], (left, top))
            draw.text((left + 2, top + height + 4), name, GREY, font)
            left += tiles[name].width + 8
    picture.save(path, quality=88)


def draw_passes(path: Path, folder: Path) -> None:
    """Draw the passes of a dataset's first view."""
    lightfield = LightField.read(folder / "lightfield.json")
    pictures = pass_pictures.collect(folder, lightfield, lightfield.views[0], exposure=0.0)
    tiles = {
        name: Image.open(io.BytesIO(base64.b64decode(data.partition(",")[2]))).convert("RGB")
        for name, _, data in pictures
    }
    sheet(path, tiles, 4)


def draw_lenses(path: Path, folder: Path) -> None:
    """Draw the first view of each of a dataset's reprojections."""
    images = sorted(folder.glob("*/view_*.png"))
    tiles = {file.parent.name: Image.open(file).convert("RGB") for file in images}
    sheet(path, dict(sorted(tiles.items(), key=lambda item: item[1].width)), 4)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--passes", type=Path, help="dataset whose passes are drawn")
    parser.add_argument("--lenses", type=Path, help="dataset whose reprojections are drawn")
    arguments = parser.parse_args()
    draw_rigs(FOLDER / "rig_types.png")
    if arguments.passes:
        draw_passes(FOLDER / "passes.jpg", arguments.passes)
    if arguments.lenses:
        draw_lenses(FOLDER / "lenses.jpg", arguments.lenses)


if __name__ == "__main__":
    main()
