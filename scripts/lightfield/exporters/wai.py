"""Writes MapAnything's container, WAI: perspective views with depth, and how much they share.

- ``scene_meta.json``: the frames. Poses are matrices from camera to world in metres. Cameras have
  OpenCV's axes, x right, y down and z forward. The first pixel's centre is at (0, 0).
- ``images/``: the views as 8-bit RGB. Transparent views are in front of black.
- ``depth/``: Z in metres as EXR with one channel of 32-bit floats. 0 for none.
- ``masks/``: 0 means ignored. Only for views with pixels that show nothing.
- ``covisibility/v0/pairwise_covisibility--<n>x<n>.npy``: the share of the pixels of each view (row)
  whose surface each view (column) sees.

MapAnything's datasets walk from view to view by these shares. They find the file by its folder, and
its shape by its name. The key last_modified is left out, so that equal views give equal bytes.
Sources: MapAnything's data_processing/README.md, utils/wai and datasets/wai.
"""

from pathlib import Path
from typing import Any

from lightfield.core.files import absolute_path, write_bytes, write_json
from lightfield.export import cameras, covisibility, heads
from lightfield.export.pictures import write_pictures, write_z
from lightfield.export.source import SourceDataset
from lightfield.exporters.base import NO_DEPTH, TO_RECTILINEAR, Developed, Joined
from lightfield.formats import npz
from lightfield.formats.lightfield import View
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.imaging import images

_MODALITIES = {
    "image": {"frame_key": "image", "format": "image"},
    "depth": {"frame_key": "depth", "format": "depth"},
    "mask": {"frame_key": "mask_path", "format": "binary"},
}


class Wai(Joined, Developed):
    """A scene in WAI, MapAnything's container for training and benchmarks."""

    name = "wai"
    summary = "Scene in WAI, MapAnything's container for feed-forward reconstruction."
    rank = 11
    loader = (
        "from mapanything.utils.wai.core import load_frame\n"
        "view = load_frame('{}', '{view}', ['image', 'depth'])"
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if not isinstance(lens, Rectilinear):
            return f"is not perspective, but MapAnything takes only such views; {TO_RECTILINEAR}"
        return None if has_depth else NO_DEPTH

    def joins(self, lens: Lens, other: Lens) -> bool:
        # Each frame has its own intrinsics.
        return True

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write a source's views into ``folder``."""
        source = heads.by_camera(source)
        frames = []
        for view, has_mask in write_pictures(
            source,
            folder,
            "wai",
            picture="images/{}.png",
            mask="masks/{}.png",
            write=lambda view, path: images.write_png(path, source.opaque(view)),
        ):
            write_z(source, view, folder / "depth" / f"{view.name}.exr")
            frames.append(_frame(source, view, has_mask))
        path = _write_covisibility(source, folder)
        content = {
            "scene_name": absolute_path(source.dataset).name,
            "dataset_name": source.scene_name,
            "version": "0.1",
            "shared_intrinsics": len(source.lenses) == 1,
            "camera_model": "PINHOLE",
            "camera_convention": "opencv",
            "scale_type": "metric",
            "scene_modalities": {"pairwise_covisibility": {"scene_key": path, "format": "mmap"}},
            "frame_modalities": {
                name: keys
                for name, keys in _MODALITIES.items()
                if any(keys["frame_key"] in frame for frame in frames)
            },
            "frames": frames,
        }
        write_json(folder / "scene_meta.json", content)


def _frame(source: SourceDataset, view: View, has_mask: bool) -> dict[str, Any]:
    """Return what scene_meta.json says of a view."""
    image = f"images/{view.name}.png"
    return {
        "frame_name": view.name,
        # nerfstudio's key for the image.
        "file_path": image,
        "image": image,
        "depth": f"depth/{view.name}.exr",
        **({"mask_path": f"masks/{view.name}.png"} if has_mask else {}),
        "transform_matrix": cameras.opencv_matrix(view).tolist(),
        **_intrinsics(source.view(view).lens),
    }


def _intrinsics(lens: Lens) -> dict[str, float]:
    """Return the keys of a lens, in pixels. The first pixel's centre is at (0, 0)."""
    assert isinstance(lens, Rectilinear)
    fx, fy, cx, cy = cameras.opencv_pinhole(lens)
    return {"fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": lens.width, "h": lens.height}


def _write_covisibility(source: SourceDataset, folder: Path) -> str:
    """Write the shares of pixels that views see of each other. Return the file's path."""
    shares = covisibility.shares(source)
    path = f"covisibility/v0/pairwise_covisibility--{len(shares)}x{len(shares)}.npy"
    write_bytes(folder / path, npz.npy(shares))
    return path
