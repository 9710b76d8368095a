"""OpenDIBR's cameras.json, read as its ioHelper.h and vertex.fs do.

Its world is OpenGL's, y up: (x, y, z) of lightfield.json is (x, z, −y) there. The first camera is
the viewport at the start. It has no picture.
"""

from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import read_json, reading
from lightfield.geometry.rotations import euler_to_matrix
from oracles.readers.contents import (
    Exported,
    ExportedCamera,
    ExportedView,
    Floats,
    development,
    numbers,
)
from oracles.readers.omaf import depth_range_of, lens_of

# Rows: the axes of OpenGL's world in lightfield.json's.
WORLD = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
# Suffix, bits of colour and bits of depth for each value of the option ``format``.
PICTURES = {"png": (".png", 8, 16), "h265": (".mp4", 10, 12)}


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the cameras.json of an export."""
    path = listing.parent / "cameras.json"
    exported = Exported()
    with reading(path, "list of OpenDIBR's cameras"):
        content = read_json(path)
        exported.expect(f"{path}: Axial_system", content["Axial_system"], "OPENGL")
        pictures = PICTURES[options["format"]]
        viewport, *cameras = content["cameras"]
        for index, camera in enumerate(cameras, 1):
            with reading(f"{path}: cameras[{index}]", "camera"):
                _read_camera(path, f"cameras[{index}]", camera, pictures, exported)
                if options["format"] == "png":
                    _add_pictures(path.parent, camera, options, exported)
        with reading(f"{path}: cameras[0]", "camera"):
            _check_viewport(f"{path}: cameras[0]", viewport, exported)
    return exported


def _read_camera(
    path: Path,
    place: str,
    camera: dict[str, Any],
    pictures: tuple[str, int, int],
    exported: Exported,
) -> None:
    """Read a view's camera. ``pictures`` are a suffix, the bits of colour, and those of depth."""
    suffix, colour_bits, depth_bits = pictures
    name = str(camera["NameColor"]).removesuffix(f"_texture{suffix}")
    for key, kind in (("NameColor", "texture"), ("NameDepth", "depth")):
        picture = path.parent / str(camera[key])
        exported.expect_picture(f"{path}: {place}: {key}", picture, name, f"{{}}_{kind}{suffix}")
    where = f"{path}: {place} ({name})"
    for key, bits in (("BitDepthColor", colour_bits), ("BitDepthDepth", depth_bits)):
        exported.expect(f"{where}: {key}", camera[key], bits)
    exported.views.append(ExportedView(path, place, name, _matrix(camera)))
    exported.cameras.append(ExportedCamera(where, lens_of(camera)))
    exported.ranges.append(depth_range_of(where, name, camera))


def _add_pictures(
    folder: Path, camera: dict[str, Any], options: dict[str, Any], exported: Exported
) -> None:
    """Add the texture and the depth of the camera that was read last."""
    view = exported.views[-1].name
    depth_range = exported.ranges[-1]
    colours = development(options)
    exported.add_picture(folder / camera["NameColor"], view, "colour", development=colours)
    exported.add_picture(
        folder / camera["NameDepth"],
        view,
        "levels",
        meaning=depth_range.meaning,
        limits=(depth_range.near, depth_range.far),
        bits=int(camera["BitDepthDepth"]),
    )


def _matrix(camera: dict[str, Any]) -> Floats:
    """Return the camera-to-world matrix (4, 4) of a position and XYZ Euler degrees."""
    matrix = np.eye(4)
    angles = np.radians(numbers(camera["Rotation"], (3,)))
    matrix[:3, :3] = WORLD.T @ euler_to_matrix(angles)
    matrix[:3, 3] = WORLD.T @ numbers(camera["Position"], (3,))
    return matrix


def _check_viewport(place: str, viewport: dict[str, Any], exported: Exported) -> None:
    """Check that the viewport is at the mean of the views, with the rotation of the first view."""
    matrix = _matrix(viewport)
    middle = np.mean([view.world_from_camera[:3, 3] for view in exported.views], axis=0)
    width, height = numbers(viewport["Resolution"], (2,)).tolist()
    fx, fy = numbers(viewport["Focal"], (2,)).tolist()
    near, far = numbers(viewport["Depth_range"], (2,)).tolist()
    exported.expect(f"{place}: NameColor", viewport["NameColor"], "viewport")
    exported.expect(f"{place}: Projection", viewport["Projection"], "Perspective")
    exported.expect(f"{place}: Position", matrix[:3, 3].tolist(), middle.tolist())
    turn = exported.views[0].world_from_camera[:3, :3]
    exported.expect(f"{place}: Rotation", matrix[:3, :3].tolist(), turn.tolist())
    exported.expect(
        f"{place}: Principle_point", viewport["Principle_point"], [width / 2, height / 2]
    )
    exported.expect(f"{place}: Focal", [fx, fy], [width / 2] * 2)
    exported.expect(f"{place}: Depth_range: grows", 0 < near < far, True)
