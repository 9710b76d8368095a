"""Consumers undistort views through calibrated lenses: they show what a perspective view shows."""

import cv2
import numpy as np
import pycolmap
import pytest
import tiny
import yaml
from checkouts import checkout

pytestmark = pytest.mark.slow

CAMERA = {"resolution": [160, 128], "sensor_size": [36, 28.5], "principal_point": [78.3, 66.1]}
LENSES = {
    "radtan": {
        "lens": "brown_conrady",
        "focal_length": 15.5,
        "coefficients": [-0.283, 0.074, 0.002, -0.001],
    },
    "fisheye": {
        "lens": "kannala_brandt",
        "focal_length": 15.5,
        "coefficients": [-0.01, 0.03, -0.02, 0.003],
        "fov": 170,
    },
    "division": {"lens": "division", "focal_length": 15.5, "coefficients": [-0.35], "fov": 170},
    "prism": {
        "lens": "thin_prism_fisheye",
        "focal_length": 15.5,
        "coefficients": [0.02, -0.03, 0.002, -0.001, 0.01, -0.002, 0.002, -0.001],
        "fov": 170,
    },
}
HEAD = {name: {"camera": CAMERA | lens} for name, lens in LENSES.items()} | {
    "perspective": {"camera": {"lens": "rectilinear", "fov": 55, "resolution": [72, 60]}},
}
SCENE = {
    "licence": "CC0-1.0",
    "scene": {"builder": "room"},
    "render": {"samples": 48, "max_bounces": 1},
    "rigs": {
        "lens": {
            "type": "lattice",
            "cameras": [2, 1, 1],
            "size": 0.6,
            "center": [-0.5, -1, 1.4],
            "rotation": [-8, 3, -40],
            "head": HEAD,
        }
    },
    "exports": {
        "colmap": {
            "sources": ["views"],
            "together": [f"lens_{name}" for name in HEAD],
            "points": 200,
            "exposure": -1,
        },
    },
}


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """The model of all cameras as COLMAP reads it, and the folder of its images."""
    folder = checkout(tmp_path_factory.mktemp("lenses") / "lenses", tiny=yaml.safe_dump(SCENE))
    tiny.build(folder, "--until", "export")
    export = folder / "results/tiny/lens_radtan/exports/colmap"
    return pycolmap.Reconstruction(export / "sparse/0"), export / "images"


def pictures(model, name):
    """Return one of the head's cameras, and its pictures in the order of the views."""
    reconstruction, folder = model
    images = [image for image in reconstruction.images.values() if image.name.split("/")[0] == name]
    images.sort(key=lambda image: image.name)
    (camera,) = {image.camera_id for image in images}
    read = [cv2.imread(str(folder / image.name)).astype(np.float32) for image in images]
    return reconstruction.cameras[camera], read


def matrix(camera):
    """Return a camera's matrix (3, 3) for OpenCV, which counts pixels from a pixel's centre."""
    found = np.array(camera.calibration_matrix())
    found[:2, 2] -= 0.5
    return found


def colmap_map(camera, target):
    """Return the place (2, height, width) in a view of each pixel of a perspective view."""
    rows, columns = np.indices((target.height, target.width)) + 0.5
    rays = np.stack([columns, rows, np.ones_like(rows)], axis=-1)
    rays = rays @ np.linalg.inv(target.calibration_matrix()).T
    places = camera.img_from_cam(rays.reshape(-1, 3)).reshape((*rays.shape[:2], 2))
    return (places - 0.5).transpose(2, 0, 1).astype(np.float32)


def opencv_map(camera, target):
    """Return the place (2, height, width) in a view of each pixel of a perspective view."""
    module = cv2.fisheye if camera.model.name == "OPENCV_FISHEYE" else cv2
    size = (target.width, target.height)
    return np.array(
        module.initUndistortRectifyMap(
            matrix(camera), camera.params[4:], np.eye(3), matrix(target), size, cv2.CV_32FC1
        )
    )


def psnr(found, truth):
    """Return the PSNR in dB where a picture has a value."""
    squares = (found - truth)[np.isfinite(found)] ** 2
    return 10 * np.log10(255**2 / squares.mean())


@pytest.mark.parametrize(
    ("name", "consumer"),
    [
        *((name, colmap_map) for name in LENSES),
        *((name, opencv_map) for name in ("radtan", "fisheye")),
    ],
)
def test_an_undistorted_view_shows_what_a_perspective_view_shows(model, name, consumer):
    target, truths = pictures(model, "perspective")
    camera, views = pictures(model, name)
    places = consumer(camera, target)
    for view, truth in zip(views, truths, strict=True):
        right, aside = (
            psnr(cv2.remap(view, x, y, cv2.INTER_LINEAR, borderValue=(np.nan,) * 3), truth)
            for x, y in (places, places + 0.5)
        )
        assert right > 35
        # Half a pixel off in both directions, as if a pixel's centre were its corner.
        assert right > aside + 5
