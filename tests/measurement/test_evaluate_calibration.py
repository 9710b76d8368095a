"""The error of calibrations: OpenCV calibrates cameras whose lenses are known."""

import json
import re

import cv2
import numpy as np
import pytest
from PIL import Image

from lightfield.formats.lightfield import LightField, View
from lightfield.geometry import boards, lenses

SIZE = (240, 180)
RECTILINEAR = {
    "lens": "rectilinear",
    "focal_length": 24,
    "sensor_size": 36,
    "resolution": [*SIZE],
    "principal_point": [122.3, 88.9],
}
FISHEYE = {
    "lens": "kannala_brandt",
    "focal_length": 11,
    "sensor_size": 36,
    "fov": 150,
    "coefficients": [0.02, -0.01, 0.004, -0.001],
    "resolution": [*SIZE],
    "principal_point": [118.6, 91.2],
}
BOARD = {"type": "charuco", "squares": [7, 5], "square": 0.04, "marker": 0.03}
# Cv2's axes of a camera: y down, z ahead.
OPENCV = np.diag([1.0, -1.0, -1.0])


@pytest.fixture
def lightfield(tmp_path):
    """Return a function that writes the lightfield.json of a camera."""

    def write(camera):
        path = tmp_path / "lightfield.json"
        lens = lenses.from_camera(camera)
        LightField(lens.to_lightfield(), [View.placed("view", np.eye(4))]).write(path)
        return path

    return write


def views_of_board(camera):
    """Return a board's corners and their pixels in views of a camera, in OpenCV's convention."""
    lens = lenses.from_camera(camera)
    board = boards.from_settings({"board": BOARD}, "scene.yaml")["board"]
    rng = np.random.default_rng(1)
    points, pixels = [], []
    for _ in range(12):
        turn, _ = cv2.Rodrigues(rng.uniform(-0.5, 0.5, 3))
        place = [*rng.uniform(-0.1, 0.1, 2), rng.uniform(0.15, 0.3)]
        middle = board.corners() - board.corners().mean(axis=0)
        seen = lens.pixels((middle @ turn.T + place) @ OPENCV)
        shown = lens.in_frame(seen)
        points.append(board.corners()[shown])
        pixels.append(seen[shown] - 0.5)
    return points, pixels


def write_opencv(path, matrix, coefficients):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", SIZE[0])
    storage.write("image_height", SIZE[1])
    storage.write("camera_matrix", matrix)
    storage.write("distortion_coefficients", coefficients)
    storage.release()
    return path


def figures_of(run_program, lightfield, calibration, output, *options):
    run = run_program(
        "evaluate_calibration.py",
        lightfield,
        "--calibration",
        calibration,
        "--output",
        output,
        *options,
    )
    return run.stdout, json.loads((output / "calibration.json").read_text())


def test_a_calibration_from_exact_corners_is_the_true_lens(tmp_path, run_program, lightfield):
    points, pixels = views_of_board(RECTILINEAR)
    flags = cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST
    _, matrix, coefficients, _, _ = cv2.calibrateCamera(
        [each.astype(np.float32) for each in points],
        [each.astype(np.float32) for each in pixels],
        SIZE,
        None,
        None,
        flags=flags,
    )
    file = write_opencv(tmp_path / "opencv.yaml", matrix, coefficients)
    table, content = figures_of(run_program, lightfield(RECTILINEAR), file, tmp_path / "out")
    assert content["as_calibrated"]["max"] < 1e-3
    assert content["as_calibrated"]["without_value"] == 0
    assert re.search(r"as calibrated +0\.000", table)


def test_opencvs_fisheye_from_exact_corners_is_the_true_lens(tmp_path, run_program, lightfield):
    points, pixels = views_of_board(FISHEYE)
    criteria = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 2000, 1e-15)
    start = np.array([[70.0, 0, 120], [0, 70, 90], [0, 0, 1]])
    # OpenCV 5 has the flags elsewhere, with other numbers.
    of_flags = cv2.fisheye if hasattr(cv2.fisheye, "CALIB_FIX_SKEW") else cv2
    flags = of_flags.CALIB_RECOMPUTE_EXTRINSIC | of_flags.CALIB_FIX_SKEW
    flags |= of_flags.CALIB_USE_INTRINSIC_GUESS
    _, matrix, coefficients, _, _ = cv2.fisheye.calibrate(
        [each[None] for each in points],
        [each[None] for each in pixels],
        SIZE,
        start,
        np.zeros((4, 1)),
        flags=flags,
        criteria=criteria,
    )
    file = write_opencv(tmp_path / "opencv.yaml", matrix, coefficients)
    _, content = figures_of(
        run_program, lightfield(FISHEYE), file, tmp_path / "out", "--model", "kannala_brandt"
    )
    assert content["as_calibrated"]["median"] < 1e-3
    assert content["as_calibrated"]["max"] < 1e-3


def test_a_moved_principal_point_is_an_error_that_a_rotation_takes_away(
    tmp_path, run_program, lightfield
):
    # A narrow lens, in whose frame a rotation moves all pixels by about as much.
    focal_length = 100 / 36 * SIZE[0]
    center = 122.3 - 0.5 + 2, 88.9 - 0.5
    matrix = np.array([[focal_length, 0, center[0]], [0, focal_length, center[1]], [0, 0, 1]])
    file = write_opencv(tmp_path / "opencv.yaml", matrix, np.zeros((5, 1)))
    output = tmp_path / "out"
    table, content = figures_of(
        run_program, lightfield(RECTILINEAR | {"focal_length": 100}), file, output
    )
    assert content["as_calibrated"]["median"] == pytest.approx(2)
    assert content["as_calibrated"]["max"] == pytest.approx(2)
    assert content["after_rotation"]["rms"] < 0.05
    # The rotation turns rays to the left, around +y.
    assert content["rotation_degrees"][1] == pytest.approx(np.degrees(2 / focal_length), rel=0.02)
    with Image.open(output / "calibration_error.png") as picture:
        assert picture.width > picture.height
    assert len(table.splitlines()) == 4


def test_a_calibration_of_other_pictures_is_refused(tmp_path, run_program, lightfield):
    file = tmp_path / "cameras.txt"
    file.write_text("1 PINHOLE 640 480 300 300 320 240\n")
    run = run_program(
        "evaluate_calibration.py", lightfield(RECTILINEAR), "--calibration", file, check=False
    )
    assert run.returncode == 1
    assert "cameras.txt" in run.stderr and "640 × 480" in run.stderr
    assert "240 × 180" in run.stderr and "Traceback" not in run.stderr
