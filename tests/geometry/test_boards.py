"""Boards: the cells that OpenCV draws and detects, and the corners of OpenCV and Kalibr."""

import cv2
import numpy as np
import pytest

from lightfield.core.errors import UserError
from lightfield.geometry import boards

CHARUCO = {"type": "charuco", "squares": [5, 4], "square": 0.04, "marker": 0.028}
APRILGRID = {"type": "aprilgrid", "tags": [3, 2], "tag": 0.08, "spacing": 0.25}


def board(**keys):
    return boards.from_settings({"board": keys}, "scene.yaml")["board"]


def drawn(pattern, pixels_a_metre):
    """Return a picture of the cells, whose edges must lie between pixels."""
    edges = [np.rint(pixels_a_metre * sides) for sides in (pattern.rows, pattern.columns)]
    places = [np.searchsorted(e, np.arange(e[-1]) + 0.5) - 1 for e in edges]
    return np.where(pattern.is_white[np.ix_(*places)], 255, 0).astype(np.uint8)


@pytest.mark.parametrize("squares", [[5, 4], [4, 5], [6, 6]])
def test_a_charuco_board_is_the_picture_that_opencv_draws(squares):
    ours = board(**CHARUCO | {"squares": squares}, border=0)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)
    theirs = cv2.aruco.CharucoBoard(squares, 0.04, 0.028, dictionary)
    # A marker has 7 cells of 4 pixels, and is 6 pixels from the edges of its square of 40 pixels.
    picture = theirs.generateImage([40 * count for count in squares])
    np.testing.assert_array_equal(drawn(ours.pattern(), 1000), picture)
    np.testing.assert_allclose(ours.corners(), theirs.getChessboardCorners(), atol=1e-8)


@pytest.mark.parametrize("dictionary", [*boards.MARKERS, *boards.APRIL_TAGS])
def test_each_dictionary_has_opencvs_number_of_markers(dictionary):
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    assert {**boards.MARKERS, **boards.APRIL_TAGS}[dictionary] == len(known.bytesList)


def kalibr_corners(tag, columns):
    """Return the ids of a tag's corners as Kalibr's detector has them, from the lower left."""
    first = tag // columns * 4 * columns + tag % columns * 2
    return [first, first + 1, first + 2 * columns + 1, first + 2 * columns]


@pytest.mark.parametrize("border_bits", [1, 2])
def test_opencv_detects_the_tags_of_an_aprilgrid_where_kalibr_has_them(border_bits):
    ours = board(**APRILGRID, border_bits=border_bits)
    scale = 5000
    pattern = ours.pattern()
    picture = cv2.GaussianBlur(drawn(pattern, scale), (0, 0), 1)
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = border_bits
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    detected, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(picture)
    assert sorted(ids.ravel()) == [*range(6)]
    # The board lies flat, and its middle is the picture's.
    height, width = picture.shape
    pixels = ours.world_corners[:, :2] * (scale, -scale) + (width / 2, height / 2)
    for corners, tag in zip(detected, ids.ravel(), strict=True):
        # OpenCV begins at the tag's upper left corner, which is Kalibr's lower right, and goes on
        # clockwise. Its first pixel's centre is (0, 0).
        lower_left, lower_right, upper_right, upper_left = kalibr_corners(int(tag), 3)
        expected = pixels[[lower_right, lower_left, upper_left, upper_right]]
        np.testing.assert_allclose(corners[0] + 0.5, expected, atol=0.5)


def test_the_first_tag_of_an_aprilgrid_is_apriltags_own():
    """Its code in AprilTag's family begins at the upper left, with the highest bit."""
    pattern = board(**APRILGRID, border=0).pattern()
    bits = pattern.is_white[-9:-3, 3:9]
    assert int("".join("01"[int(bit)] for bit in bits.ravel()), 2) == 0xD5D628584


def test_kalibrs_grid_points():
    """Source: createGridPoints of Kalibr's GridCalibrationTargetAprilgrid.cpp."""
    corners = board(**APRILGRID).corners()
    assert corners[[0, 1, 2, 6, 12]].tolist() == pytest.approx(
        np.array([[0, 0, 0], [0.08, 0, 0], [0.1, 0, 0], [0, 0.08, 0], [0, 0.1, 0]])
    )
    assert len(corners) == 24


def test_opencv_finds_the_corners_of_a_chessboard():
    ours = board(type="chessboard", squares=[8, 5], square=0.03)
    picture = cv2.GaussianBlur(drawn(ours.pattern(), 1000), (0, 0), 1)
    found, corners = cv2.findChessboardCorners(picture, (7, 4))
    assert found
    expected = 1000 * (ours.corners()[:, :2] + 0.03) - 0.5
    np.testing.assert_allclose(corners.reshape(-1, 2), expected, atol=0.1)


def test_a_standing_board_faces_its_camera_upright():
    ours = board(**CHARUCO, position=[1, 2, 3], rotation=[90, 0, 0])
    np.testing.assert_allclose(ours.front, [0, -1, 0], atol=1e-12)
    # Five by four squares: the first inner corner is 1.5 squares left of and 1 above the middle.
    np.testing.assert_allclose(ours.world_corners[0], [1 - 0.06, 2, 3 + 0.04], atol=1e-12)
    np.testing.assert_allclose(ours.world_corners[-1], [1 + 0.06, 2, 3 - 0.04], atol=1e-12)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (CHARUCO | {"marker": 0.04}, "marker: 0.04 m must be smaller than a square"),
        (CHARUCO | {"squares": [1, 4]}, "squares"),
        (CHARUCO | {"squares": [11, 10], "dictionary": "DICT_4X4_50"}, "squares: need 55 markers"),
        (CHARUCO | {"dictionary": "DICT_5x5_250"}, "dictionary"),
        (APRILGRID | {"tags": [30, 20]}, "tags: need 600 markers"),
        (APRILGRID | {"dictionary": "DICT_5X5_250"}, "dictionary"),
    ],
)
def test_a_mistake_in_a_board_names_the_key(keys, message):
    with pytest.raises(UserError, match="board") as error:
        board(**keys)
    assert message in str(error.value)
