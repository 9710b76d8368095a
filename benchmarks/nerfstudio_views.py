"""Views of a nerfstudio export, read as nerfstudio documents the files.

Shares no code with the exporter, so that a mistake there is not repeated here. Reads
transforms.json, images/, depths/ and masks/. Needs no torch.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from lightfield.core.files import read_json

Array = np.ndarray[Any, Any]

LENSES = {"OPENCV": "perspective", "OPENCV_FISHEYE": "fisheye", "EQUIRECTANGULAR": "panorama"}
TRUE = "as exported"
SHUFFLED = "shuffled poses"
MILLIMETRES = 1000


@dataclass(frozen=True)
class Views:
    """Views through one lens.

    - ``rays`` (h, w, 3): of unit length, in the camera's own axes.
    - ``kind``: the kind of depth, "Z" or "distance".
    - ``poses`` (n, 4, 4): camera-to-world.
    - ``colour`` (n, h, w, 3): sRGB from 0 to 1.
    - ``depth`` (n, h, w): metres as the files have it, inf for none.
    - ``valid`` (n, h, w): the pixels that the lens covers.
    - ``test`` (n,): the views to test with.
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
        """Return origins, rays, colour and distance of the valid pixels of test or training views.

        Each is float32; origins, rays and colour are (n, 3), distance is (n,).
        """
        chosen = np.flatnonzero(self.test == test)
        rays = np.einsum("hwc,nrc->nhwr", self.rays, self.poses[chosen, :3, :3])
        origins = np.broadcast_to(self.poses[chosen, None, None, :3, 3], rays.shape)
        valid = self.valid[chosen]
        parts = (origins, rays, self.colour[chosen], self.distance[chosen])
        return tuple(np.asarray(part[valid], np.float32) for part in parts)


def read(folder: Path) -> Views:
    """Return the views of a nerfstudio export. Source: nerfstudio_dataparser.py, cameras.py."""
    content = read_json(folder / "transforms.json")
    frames = content["frames"]

    def stack(key: str) -> Array:
        return np.stack([np.asarray(Image.open(folder / frame[key])) for frame in frames])

    images = stack("file_path") / np.float32(255)
    # Transparent views are composited over black.
    colour = images[..., :3] * images[..., 3:] if images.shape[-1] == 4 else images
    depth = stack("depth_file_path") / np.float32(MILLIMETRES)
    masked = "mask_path" in frames[0]
    rays, kind = _rays(content)
    return Views(
        LENSES[content["camera_model"]],
        rays,
        kind,
        np.array([frame["transform_matrix"] for frame in frames]),
        colour,
        np.where(depth > 0, depth, np.float32(np.inf)),
        stack("mask_path") > 0 if masked else np.ones(depth.shape, bool),
        np.array([frame["file_path"] in content["test_filenames"] for frame in frames]),
    )


def _rays(content: dict[str, Any]) -> tuple[Array, str]:
    """Return the rays (h, w, 3) of a camera that looks along −z, and the kind of its depth."""
    column, row = np.meshgrid(np.arange(content["w"]) + 0.5, np.arange(content["h"]) + 0.5)
    x = (column - content["cx"]) / content["fl_x"]
    y = -(row - content["cy"]) / content["fl_y"]
    if content["camera_model"] == "OPENCV":
        rays = np.stack([x, y, -np.ones_like(x)], axis=-1)
        return rays / np.linalg.norm(rays, axis=-1, keepdims=True), "Z"
    if content["camera_model"] == "OPENCV_FISHEYE":
        angle = np.hypot(x, y)
        across = np.sinc(angle / np.pi)
        return np.stack([x * across, y * across, -np.cos(angle)], axis=-1), "distance"
    longitude = np.pi * x
    latitude = np.pi * y
    level = np.cos(latitude)
    return np.stack(
        [np.sin(longitude) * level, np.sin(latitude), -np.cos(longitude) * level], axis=-1
    ), "distance"


def readings(views: Views) -> Iterator[tuple[str, Views]]:
    """Yield the views as exported, and with one thing wrong."""
    yield TRUE, views
    order = np.random.default_rng(1).permutation(len(views.poses))
    yield SHUFFLED, replace(views, poses=views.poses[order])
    mirrored = {name: getattr(views, name)[:, :, ::-1] for name in ("colour", "depth", "valid")}
    yield "mirrored images", replace(views, **mirrored)
    wrong_kind = {"Z": "distance", "distance": "Z"}[views.kind]
    yield f"{views.kind} taken for {wrong_kind}", replace(views, kind=wrong_kind)
