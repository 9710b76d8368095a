"""Reads an export for LichtFeld Studio as its transforms.cpp and blender_loader.cpp do.

LichtFeld has no Python package. OpenCV stands in for its cameras.
"""

import json
from pathlib import Path

import cv2
import numpy as np

RADIUS = 3.0


def rays_of(content):
    """Return the directions (h, w, 3) of the pixels' centres: x right, y down, z forward."""
    width, height = content["w"], content["h"]
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    model = content["camera_model"]
    if model == "EQUIRECTANGULAR":
        longitude = 2 * np.pi * columns / width - np.pi
        latitude = np.pi / 2 - np.pi * rows / height
        across = np.cos(latitude)
        return np.stack(
            [across * np.sin(longitude), -np.sin(latitude), across * np.cos(longitude)], axis=-1
        )
    fx, fy, cx, cy = (content[key] for key in ("fl_x", "fl_y", "cx", "cy"))
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    pixels = np.stack([columns, rows], axis=-1).reshape(-1, 1, 2)
    if model == "PINHOLE":
        flat = cv2.undistortPoints(pixels, matrix, None)
    else:
        assert model == "OPENCV_FISHEYE"
        distortion = np.array([content["k1"], content["k2"], content["k3"], 0.0])
        flat = cv2.fisheye.undistortPoints(pixels, matrix, distortion)
    rays = np.concatenate([flat[:, 0], np.ones((len(flat), 1))], axis=-1)
    return (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).reshape(height, width, 3)


def check(folder, names, matrices, rays):
    content = json.loads((folder / "transforms.json").read_text())
    # The axes of its files are OpenGL's.
    local = rays_of(content) * [1, -1, -1]
    seen = np.isfinite(rays[..., 0])
    radians = np.arccos(np.clip((local * rays).sum(axis=-1)[seen], -1, 1)).max()
    metres = levels = 0.0
    for frame in content["frames"]:
        image = folder / frame["file_path"]
        pose = np.array(frame["transform_matrix"])
        np.testing.assert_allclose(pose, matrices[names.index(image.stem)], atol=1e-9)
        mask = folder / "masks" / f"{image.stem}.png"
        valid = seen
        if mask.exists():
            valid = cv2.imread(str(mask), cv2.IMREAD_GRAYSCALE) > 0
        assert (valid == seen).all()
        world = local @ pose[:3, :3].T
        along = world @ pose[:3, 3]
        distance = -along + np.sqrt(along**2 + RADIUS**2 - pose[:3, 3] @ pose[:3, 3])
        points = pose[:3, 3] + world * distance[..., None]
        expected = 40 + 175 * (points / RADIUS / 2 + 0.5)
        picture = cv2.imread(str(image))[..., ::-1]
        levels = max(levels, np.abs(picture - expected)[valid].max())
        depth = folder / "depth" / f"{image.stem}.png"
        if depth.exists():
            steps = cv2.imread(str(depth), cv2.IMREAD_UNCHANGED)
            z = -local[..., 2] * distance
            # LichtFeld fits scale and shift of each view. A true scale needs no shift.
            has_depth = steps > 0
            assert (has_depth == valid).all()
            scale = (z * steps)[has_depth].sum() / (steps.astype(float) ** 2)[has_depth].sum()
            metres = max(metres, np.abs(scale * steps - z)[has_depth].max())
    for part in ("train", "test"):
        listed = (folder / f"{part}.txt").read_text().split()
        assert {Path(name).stem for name in listed} <= set(names)
    print(
        f"LichtFeld's files, {folder.name}, {content['camera_model']}: {len(content['frames'])} "
        f"views; rays within {radians:.2g} rad, colours within {levels:.1f} levels, depth within "
        f"{1000 * metres:.2g} mm of a common scale"
    )
    assert radians < 1e-6
    assert levels < 3
    assert metres < 1e-3
