"""instant-ngp's transforms.json, read as its loader does (src/nerf_loader.cu, common_device.cuh).

Its world is SILVR's: (x, y, z) of lightfield.json is (y, −x, z) there. The keys tell the lens:
``ftheta_p0`` to ``ftheta_p4`` a fisheye, ``latlong`` a panorama, only ``fl_x`` to ``cy`` a pinhole.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import read_json, reading
from lightfield.core.names import PARTS
from oracles.readers.cameras import Camera, OfColmap, Panorama, Pinhole, PolynomialFisheye
from oracles.readers.contents import (
    DepthMap,
    Exported,
    ExportedCamera,
    ExportedView,
    UnitCube,
    number,
    numbers,
    same,
)

# The mask beside a picture.
MASK = "dynamic_mask_{}.png"
# Columns: the axes of lightfield.json in the loader's world.
WORLD = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])


def read(path: Path) -> Exported:
    """Read a transforms.json, or a transforms_<part>.json of the views of one part."""
    with reading(path, "transforms.json"):
        content = read_json(path)
        part = path.stem.rpartition("_")[2]
        exported = Exported(views_of=part if part in PARTS else None)
        exported.cameras.append(ExportedCamera(str(path), _camera(path, content, exported)))
        from_loader = np.eye(4)
        from_loader[:3, :3] = WORLD.T
        for index, frame in enumerate(content["frames"]):
            place = f"frames[{index}]"
            with reading(f"{path}: {place}", "frame"):
                matrix = from_loader @ numbers(frame["transform_matrix"], (4, 4))
                name = Path(str(frame["file_path"])).stem
                exported.views.append(ExportedView(path, place, name, matrix))
                if "depth_path" in frame:
                    picture = path.parent / str(frame["depth_path"])
                    exported.expect_picture(f"{path}: {place}: depth_path", picture, name, "{}.png")
                    # The loader scales a pinhole's rays to length 1 along the axis. Other rays have
                    # length 1.
                    is_pinhole = isinstance(exported.cameras[0].camera, Pinhole | OfColmap)
                    meaning = "z" if is_pinhole else "distance"
                    unit = number(content["integer_depth_scale"])
                    exported.add_picture(picture, name, "steps", meaning=meaning, unit=unit)
                mask = path.parent / Path(str(frame["file_path"])).with_name(MASK.format(name))
                exported.add_picture(mask, name, "hidden")
        options = dict(content["options"])
        _compare_options(path, content, options, exported)
        is_given = options["scale"] is not None
        exported.cube = UnitCube(
            str(path),
            number(content["scale"]),
            numbers(content["offset"], (3,)),
            number(options["scale"]) if is_given else None,
            numbers(options["offset"], (3,)) if is_given else None,
            not is_given and options["bounds"] == "depth",
        )
    return exported


def _camera(path: Path, content: dict[str, Any], exported: Exported) -> Camera:
    """Return the lens. For a fisheye and a panorama, the loader only displays the focal length."""
    width, height = int(content["w"]), int(content["h"])
    fx, fy = number(content["fl_x"]), number(content["fl_y"])
    cx, cy = number(content["cx"]), number(content["cy"])
    if "ftheta_p0" in content:
        p0, p1, p2, p3, p4 = (number(content[f"ftheta_p{power}"]) for power in range(5))
        for key, value in (("fl_x", fx), ("fl_y", fy)):
            exported.expect(f"{path}: {key}", value, 1 / abs(p1))
        return PolynomialFisheye(width, height, cx, cy, (p0, p1, p2, p3, p4))
    if "latlong" in content:
        exported.expect(f"{path}: latlong", content["latlong"], True)
        for key, value in (("fl_x", fx), ("fl_y", fy)):
            exported.expect(f"{path}: {key}", value, width / (2 * math.pi))
        for key, value, side in (("cx", cx, width), ("cy", cy, height)):
            exported.expect(f"{path}: {key}", value, side / 2)
        return Panorama(width, height, -math.pi, math.pi, math.pi / 2, -math.pi / 2)
    for key, focal, side in (("camera_angle_x", fx, width), ("camera_angle_y", fy, height)):
        exported.expect(f"{path}: {key}", content[key], 2 * math.atan(side / (2 * focal)))
    distortion = [number(content.get(key, 0.0)) for key in ("k1", "k2", "p1", "p2")]
    if any(distortion):
        return OfColmap(width, height, "OPENCV", (fx, fy, cx, cy, *distortion))
    return Pinhole(width, height, fx, fy, cx, cy)


def _compare_options(
    path: Path, content: dict[str, Any], options: dict[str, Any], exported: Exported
) -> None:
    """Compare the keys for the training volume and for depth with the export's options."""
    for key in ("aabb_scale", "render_aabb"):
        if not same(content.get(key), options[key]):
            exported.faults.append(
                f"{path}: {key}: is {content.get(key)!r}, but its options have {options[key]!r}"
            )
    with_depth = [frame for frame in content["frames"] if "depth_path" in frame]
    exported.expect(
        f"{path}: frames with a depth_path",
        len(with_depth),
        len(content["frames"]) if options["depth"] else 0,
    )
    if with_depth:
        # The loader scales a pinhole's rays to length 1 along the axis. Other rays have length 1.
        meaning = "z" if isinstance(exported.cameras[0].camera, Pinhole | OfColmap) else "distance"
        exported.depth_map = DepthMap(
            f"{path}: integer_depth_scale",
            path.parent / str(with_depth[0]["depth_path"]),
            Path(str(with_depth[0]["file_path"])).stem,
            number(content["integer_depth_scale"]),
            meaning,
        )
