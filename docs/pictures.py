"""Draw pictures of the documents: rigs, views in their lenses and passes, a walk, points, depth.

Without arguments it draws the rigs. The options name datasets of one's own. --walk names the output
of scripts/synthesize.py for a closed path.
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
from lightfield.imaging.pictures import develop  # noqa: E402
from lightfield.reading.opening import open_dataset  # noqa: E402
from lightfield.report import pass_pictures  # noqa: E402

# isort: split
import matplotlib  # noqa: E402
import numpy as np  # noqa: E402
from PIL import Image, ImageDraw, ImageFont, ImageOps  # noqa: E402

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
# Width and height of the pictures of docs/index.md.
WAY = (480, 240)


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
    """Draw the first picture of each camera of a head."""
    tiles = {}
    for dataset in sorted(folder.glob("*/lightfield.json")):
        name = LightField.read(dataset).head.name
        picture = min(dataset.parent.glob("png/view_*.png"))
        tiles[name] = Image.open(picture).convert("RGB")
    sheet(path, dict(sorted(tiles.items(), key=lambda item: item[1].width)), 6)


def draw_walk(path: Path, folder: Path) -> None:
    """Write an animation of synthesised views, which repeats for ever."""
    frames = [Image.open(file).convert("RGB") for file in sorted(folder.glob("png/*.png"))]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=67, quality=80, method=6)


def draw_points(path: Path, folder: Path) -> None:
    """Draw the cameras of a dataset as frusta around the points that they see."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 0.05
    figure = pyplot.figure(figsize=(4.8, 2.4), dpi=300, facecolor="#10181f")
    # A square that is higher than the figure.
    axes = figure.add_axes((0, -0.5, 1, 2), projection="3d", computed_zorder=False)
    points, colours = [], []
    for view in open_dataset(folder).views:
        pose = np.asarray(view.world_from_camera)
        eye = pose[:3, 3]
        frame = np.column_stack([corners, np.full(4, -0.14)]) @ pose[:3, :3].T + eye
        for corner, following in zip(frame, np.roll(frame, -1, axis=0), strict=True):
            axes.plot(*np.transpose([eye, corner, following]), color="#2fd0c0", linewidth=0.6)
        origins, directions = view.rays()
        seen = np.isfinite(view.distance) & (view.alpha > 0.99)
        points.append((origins + directions * view.distance[..., None])[seen][::5])
        colours.append(develop(view.rgb, 0.5)[seen][::5] / 255)
    # In one collection, near points hide distant ones.
    axes.scatter(*np.concatenate(points).T, c=np.concatenate(colours), s=0.6, linewidths=0)
    axes.set(xlim=(-0.7, 0.7), ylim=(-0.7, 0.7), zlim=(-0.4, 0.8), facecolor="#10181f")
    axes.set_box_aspect((1.4, 1.4, 1.2), zoom=1.0)
    axes.view_init(elev=24, azim=-58)
    axes.set_axis_off()
    picture = io.BytesIO()
    figure.savefig(picture)
    pyplot.close(figure)
    Image.open(picture).convert("RGB").resize(WAY).save(path, quality=88)


def draw_depth(path: Path, folder: Path) -> None:
    """Draw a view that looks forward beside its depth, where near surfaces are bright."""
    views = open_dataset(folder).views
    view = max(views, key=lambda view: -view.world_from_camera[1][2])
    nearness = 1 / view.distance
    coloured = pyplot.get_cmap("magma")(nearness / np.nanquantile(nearness, 0.98), bytes=True)
    pixels = np.hstack([develop(view.rgb, 0.0), coloured[..., :3]])
    Image.fromarray(pixels).resize(WAY).save(path, quality=88)


def draw_blend(path: Path, folder: Path) -> None:
    """Draw the first view of a dataset that was rendered from a .blend."""
    picture = Image.fromarray(develop(open_dataset(folder).views[0].rgb, -0.7))
    ImageOps.fit(picture, WAY).save(path, quality=88)


def draw_splat(path: Path, folder: Path) -> None:
    """Draw a view of the evaluations in ``folder``: splat, walk."""
    tiles = {}
    for name in ("splat", "walk"):
        picture = folder / name / "pictures" / "view_0003f.png"
        truth, shown, _ = np.hsplit(np.asarray(Image.open(picture).convert("RGB")), 3)
        tiles |= {name: Image.fromarray(shown), "true view": Image.fromarray(truth)}
    sheet(path, {name: tiles[name] for name in ("splat", "walk", "true view")}, 3)


def draw_places(path: Path) -> None:
    """Draw the first places of each builder, from the pictures of all their places."""
    picture = Image.new("RGB", WAY)
    for row, builder in enumerate(("garden", "lone_monk", "barbershop", "rooms")):
        sheet = Image.open(FOLDER / f"places_{builder}.jpg")
        four_places = sheet.crop((0, 0, sheet.width, sheet.width // 8))
        picture.paste(four_places.resize((WAY[0], WAY[1] // 4)), (0, row * WAY[1] // 4))
    picture.save(path, quality=88)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--passes", type=Path, help="dataset whose passes are drawn")
    parser.add_argument("--lenses", type=Path, help="results of a scene whose head has all lenses")
    parser.add_argument("--walk", type=Path, help="folder of synthesised views of a closed path")
    parser.add_argument("--points", type=Path, help="dataset around an object, with alpha")
    parser.add_argument("--depth", type=Path, help="dataset of fisheyes, of which one is drawn")
    parser.add_argument("--blend", type=Path, help="dataset of a .blend, whose first view is drawn")
    parser.add_argument("--splat", type=Path, help="folder of the evaluations splat and walk")
    arguments = parser.parse_args()
    draw_rigs(FOLDER / "rig_types.png")
    draw_places(FOLDER / "way_cluster.jpg")
    for flag, draw, name in (
        ("passes", draw_passes, "passes.jpg"),
        ("lenses", draw_lenses, "lenses.jpg"),
        ("walk", draw_walk, "garden_walk.webp"),
        ("points", draw_points, "way_train.jpg"),
        ("depth", draw_depth, "way_study.jpg"),
        ("blend", draw_blend, "way_blend.jpg"),
        ("splat", draw_splat, "splat.jpg"),
    ):
        if source := getattr(arguments, flag):
            draw(FOLDER / name, source)


if __name__ == "__main__":
    main()
