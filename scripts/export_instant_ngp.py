"""Write the transforms.json with which instant-ngp opens a dataset.

Frames come in the order and, with --scale and --offset, with the numbers of SILVR's
generate_NERF_transforms.py. Perspective views, fisheye views and full panoramas go as they are.

instant-ngp does not hide the pixels outside a fisheye's image circle by itself: for PNG views
this writes dynamic_mask_<name>.png beside each view that has such pixels. It refuses EXR files
whose channels differ in type (half colour beside float depth), and hides pixels of an EXR only by
negative colour: EXR views are therefore copied to --exr-dir as R, G, B alone.

Give instant-ngp the transforms.json itself: of a folder it opens every .json, and lightfield.json
is not for it.
"""

import argparse
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core import cli
from lightfield.core.errors import UserError
from lightfield.core.files import read_json, write_json
from lightfield.core.progress import Progress
from lightfield.export import instant_ngp
from lightfield.geometry import lenses, rigs
from lightfield.imaging import images

# Enough views to know how far the scene reaches, and pixels of each.
BOUNDS_VIEWS = 64
BOUNDS_PIXELS = 64


def main() -> None:
    arguments = parsed()
    content = read_json(arguments.input_cfg)
    views = rigs.from_settings({"type": "poses", "file": str(arguments.input_cfg)}).poses()
    export = Export(arguments, content, views)
    scale, offset = export.placement()
    common = export.lens_keys | {"scale": scale, "offset": offset}
    if arguments.aabb_scale:
        common["aabb_scale"] = arguments.aabb_scale
    if arguments.render_aabb:
        common["render_aabb"] = [arguments.render_aabb[:3], arguments.render_aabb[3:]]
    if arguments.depth_dir:
        common["integer_depth_scale"] = instant_ngp.DEPTH_UNIT
    frames = export.frames()
    write_json(arguments.output, common | {"frames": frames})
    print(f"{arguments.output}: {len(frames)} frames, scale {scale:.6g}, offset {offset}")
    if arguments.split:
        splits = [frame.get("split") for frame in content["frames"]]
        for part in ("train", "test"):
            chosen = [f for f, split in zip(frames, splits, strict=True) if split == part]
            if not chosen:
                raise UserError(f"{arguments.input_cfg}: frames: none has the split {part!r}")
            path = arguments.output.with_stem(f"{arguments.output.stem}_{part}")
            write_json(path, common | {"frames": chosen})
            print(f"{path}: {len(chosen)} frames")


class Export:
    """The views of one lightfield.json, and what is written of them."""

    def __init__(
        self, arguments: argparse.Namespace, content: Mapping[str, Any], views: list[rigs.Pose]
    ) -> None:
        self.arguments = arguments
        self.views = views
        try:
            self.lens = lenses.from_lightfield(content)
            self.lens_keys = instant_ngp.lens_keys(self.lens)
        except UserError as error:
            raise UserError(f"{arguments.input_cfg}: {error}") from None
        self.meaning = content.get("depth")
        self.rays = self.lens.pixel_rays()
        self.blind = instant_ngp.blind_pixels(self.lens)
        self.image_dir: Path = arguments.image_dir or arguments.input_cfg.parent
        self.exr_dir: Path = arguments.exr_dir or arguments.output.parent / "instant_ngp"

    def placement(self) -> tuple[float, list[float]]:
        """Return scale and offset: as given, or fitted to what the views see, or to the rig."""
        cameras = np.array([view.position for view in self.views])
        if self.arguments.scale is not None:
            offset = self.arguments.offset or (0.5, 0.5, 0.5)
            return self.arguments.scale, instant_ngp.placed(cameras, self.arguments.scale, offset)
        if not self.arguments.depth_bounds:
            return instant_ngp.fitted_to_rig(cameras)
        points = np.concatenate(list(self.seen_points()))
        if not len(points):
            raise UserError(f"{self.image_dir}: no view sees anything at a finite depth")
        return instant_ngp.fitted(*instant_ngp.scene_bounds(cameras, points))

    def seen_points(self) -> Iterator[Any]:
        """Yield world points (n, 3) seen by views spread over the rig."""
        count = min(BOUNDS_VIEWS, len(self.views))
        step = max(1, max(self.lens.width, self.lens.height) // BOUNDS_PIXELS)
        first = step // 2
        for index in np.unique(np.linspace(0, len(self.views) - 1, count).round().astype(int)):
            view = self.views[index]
            depth, meaning = self.depth(view)
            part = np.s_[first::step, first::step]
            yield instant_ngp.world_points(depth[part], meaning, self.rays[part], view)

    def frames(self) -> list[dict[str, Any]]:
        """Write every view's files and return the frames that name them."""
        progress = Progress(len(self.views), "export")
        start = self.arguments.output.parent.resolve()
        frames = []
        missing = []
        for view in self.views:
            image = self.image_dir / f"{view.name}{self.arguments.image_suffix}"
            if self.arguments.image_suffix == ".exr":
                image = self.copied_exr(view, image)
            else:
                if not image.is_file():
                    missing.append(image)
                self.write_mask(view, image)
            frame: dict[str, Any] = {
                "file_path": Path(os.path.relpath(image.resolve(), start)).as_posix(),
                "transform_matrix": instant_ngp.transform_matrix(view).tolist(),
            }
            if self.arguments.depth_dir:
                path = self.write_depth(view)
                frame["depth_path"] = Path(os.path.relpath(path.resolve(), start)).as_posix()
            frames.append(frame)
            progress.done()
        if missing:
            print(
                f"warning: {len(missing)} images are not there, the first is {missing[0]}",
                file=sys.stderr,
            )
        return frames

    def depth(self, view: rigs.Pose) -> tuple[Any, str]:
        """Return a view's channel Z and whether it is "z" or "distance"."""
        path = self.image_dir / f"{view.name}.exr"
        image = images.read_image(path, ["Z"])
        self.check_size(path, image.channels["Z"])
        meaning = image.attributes.get(images.DEPTH_ATTRIBUTE, self.meaning)
        if meaning not in ("z", "distance"):
            raise UserError(
                f"{self.arguments.input_cfg}: depth: is {self.meaning!r}; must be z or distance "
                "to tell what channel Z of the views holds"
            )
        return image.channels["Z"], str(meaning)

    def check_size(self, path: Path, pixels: Any) -> None:
        height, width = pixels.shape[:2]
        if (width, height) != (self.lens.width, self.lens.height):
            raise UserError(
                f"{path}: is {width} × {height}, but {self.arguments.input_cfg} says "
                f"{self.lens.width} × {self.lens.height}"
            )

    def copied_exr(self, view: rigs.Pose, source: Path) -> Path:
        """Copy R, G, B as half floats, with −1 in pixels that instant-ngp must not train on."""
        channels = images.read_image(source).channels
        missing = [name for name in "RGB" if name not in channels]
        if missing:
            raise UserError(f"{source}: has no channel {missing[0]}")
        self.check_size(source, channels["R"])
        hidden = self.blind | np.isnan(channels.get("Z", np.zeros(1)))
        target = self.exr_dir / source.name
        images.write_exr(
            target,
            {name: np.where(hidden, -1, channels[name]).astype(np.float16) for name in "RGB"},
        )
        return target

    def write_mask(self, view: rigs.Pose, image: Path) -> None:
        """Write the mask of a PNG view if it has pixels without a ray or without a source."""
        hidden = self.blind
        if image.is_file():
            channels = images.read_image(image).channels
            self.check_size(image, next(iter(channels.values())))
            if "A" in channels:
                hidden = hidden | (channels["A"] == 0)
        if hidden.any():
            mask = np.where(hidden, 255, 0).astype(np.uint8)
            images.write_png(image.parent / f"dynamic_mask_{view.name}.png", mask)

    def write_depth(self, view: rigs.Pose) -> Path:
        depth, meaning = self.depth(view)
        as_z = instant_ngp.reads_z_depth(self.lens)
        path: Path = self.arguments.depth_dir / f"{view.name}.png"
        images.write_png(path, instant_ngp.depth_map(depth, meaning, self.rays, as_z))
        return path


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--input-cfg", type=Path, required=True, help="the lightfield.json")
    parser.add_argument("--output", type=Path, required=True, help="the transforms.json to write")
    parser.add_argument(
        "--image-dir", type=Path, help="folder of the views (default: that of --input-cfg)"
    )
    parser.add_argument("--image-suffix", choices=[".png", ".exr"], default=".png")
    parser.add_argument(
        "--exr-dir",
        type=Path,
        help="folder for the copies of EXR views (default: instant_ngp beside --output)",
    )
    parser.add_argument(
        "--depth-dir",
        type=Path,
        help="write 16-bit depth PNGs there, in millimetres, from channel Z of the .exr views",
    )
    parser.add_argument(
        "--scale", type=float, help="metres to unit cubes (default: fitted to the scene)"
    )
    parser.add_argument(
        "--offset",
        type=float,
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="where the mean camera lies in the unit cube, with --scale (default: 0.5 0.5 0.5)",
    )
    parser.add_argument(
        "--depth-bounds",
        action="store_true",
        help="fit to what channel Z of the .exr views sees: cameras and nine tenths of the points "
        "fill the unit cube (default: the rig fills a fifth of it)",
    )
    parser.add_argument(
        "--aabb-scale",
        type=int,
        choices=[1, 2, 4, 8, 16, 32, 64, 128],
        help="side of the training volume in unit cubes (instant-ngp's default: 1)",
    )
    parser.add_argument(
        "--render-aabb",
        type=float,
        nargs=6,
        metavar=("X0", "Y0", "Z0", "X1", "Y1", "Z1"),
        help="the part of the unit cube that instant-ngp shows",
    )
    parser.add_argument(
        "--split",
        action="store_true",
        help="also write <output>_train.json and <output>_test.json by the frames' split",
    )
    arguments = parser.parse_args()
    if arguments.scale is None and arguments.offset is not None:
        raise UserError("--offset: goes with --scale; without it both are fitted")
    if arguments.scale is not None and not arguments.scale > 0:
        raise UserError(f"--scale: is {arguments.scale}; must be above 0")
    return arguments


if __name__ == "__main__":
    cli.run(main)
