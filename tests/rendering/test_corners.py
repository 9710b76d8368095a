"""Boards in rendered views: OpenCV finds their corners where corners.json has them."""

import json

import cv2
import numpy as np
import pytest
from checkouts import checkout, snakemake

from lightfield.core.files import sha256
from lightfield.formats.lightfield import LightField

pytestmark = pytest.mark.slow

# A bar in front of the ChArUco board: the middle and the size of a box.
BAR = ((-0.06, 0.2, 1.0), (0.05, 0.02, 0.5))
# Even light has no noise. A second box hides nothing, because cameras do not see it.
BUILDER = f"""
import bpy

def build(parameters):
    world = bpy.context.scene.world = bpy.data.worlds.new("even")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.9, 0.9, 0.9, 1)
    bpy.ops.mesh.primitive_cube_add(size=1, location={BAR[0]}, scale={BAR[1]})
    bpy.ops.mesh.primitive_cube_add(size=1, location=(3, -0.1, 1), scale=(1, 0.02, 1))
    bpy.context.object.visible_camera = False
    bpy.context.object.visible_diffuse = False
"""
CAMERA = "{lens: rectilinear, fov: 40, resolution: [320, 240], principal_point: [157.3, 121.9]}"
SCENE = f"""
scene:
  builder: ./builder.py
  targets:
    charuco: {{type: charuco, squares: [5, 4], square: 0.04, marker: 0.03, position: [0, 0.3, 1],
      rotation: [85, 5, 8]}}
    aprilgrid: {{type: aprilgrid, tags: [3, 2], tag: 0.06, position: [3, 0.3, 1],
      rotation: [95, 5, -8]}}
    chessboard: {{type: chessboard, squares: [6, 5], square: 0.035, position: [-3, 0.3, 1],
      rotation: [90, -5, 12]}}
render: {{samples: 16, max_bounces: 1, depth: none}}
rigs:
  charuco: {{type: plane, cameras: [2, 1], size: 0.1, center: [0, -0.2, 1], camera: &lens {CAMERA}}}
  aprilgrid: {{type: plane, cameras: [1, 1], center: [3, -0.2, 1], camera: *lens}}
  chessboard: {{type: plane, cameras: [1, 1], center: [-3, -0.2, 1], camera: *lens}}
  behind: {{type: plane, cameras: [1, 1], center: [-3, 0.8, 1], rotation: [0, 0, 180],
    camera: *lens}}
reprojections: {{png: {{format: png}}}}
mesh: {{formats: [ply], rigs: [behind]}}
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = checkout(tmp_path_factory.mktemp("corners") / "plenoforge", boards=SCENE)
    (folder / "builder.py").write_text(BUILDER)
    run = snakemake(folder, "--config", "scenes=boards", "preset=full")
    assert run.returncode == 0, run.stdout + run.stderr
    return folder / "results/boards"


class View:
    """A view's picture, and its corners of a board: pixels in OpenCV's convention by their ids."""

    def __init__(self, dataset, board, name="view_0000f"):
        content = json.loads((dataset / "corners.json").read_text())
        self.board = content["boards"][board]
        self.entries = [each for each in content["views"][name] if each["board"] == board]
        self.visible = {each["id"] for each in self.entries if each["visible"]}
        self.pixels = {each["id"]: np.array(each["pixel"]) - 0.5 for each in self.entries}
        self.picture = cv2.imread(str(dataset / f"png/{name}.png"), cv2.IMREAD_GRAYSCALE)

    def refined(self, corners):
        criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
        corners = np.array(corners, np.float32).reshape(-1, 1, 2)
        return cv2.cornerSubPix(self.picture, corners, (4, 4), (-1, -1), criteria).reshape(-1, 2)

    def distances(self, corners, ids):
        return np.array(
            [np.linalg.norm(c - self.pixels[i]) for c, i in zip(corners, ids, strict=True)]
        )


@pytest.mark.parametrize("name", ["view_0000f", "view_0001f"])
def test_opencv_detects_a_charuco_boards_corners_where_they_are(results, name):
    view = View(results / "charuco", "charuco", name)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)
    board = cv2.aruco.CharucoBoard((5, 4), 0.04, 0.03, dictionary)
    corners, ids, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(view.picture)
    ids = ids.ravel().tolist()
    assert len(ids) >= 6
    assert {*ids} <= view.visible
    assert np.median(view.distances(view.refined(corners), ids)) < 0.2
    np.testing.assert_allclose(view.board["corners"], board.getChessboardCorners(), atol=1e-8)


def test_opencv_detects_an_aprilgrids_tags_with_their_ids(results):
    """A surface that cameras do not see hides nothing."""
    view = View(results / "aprilgrid", "aprilgrid")
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = 2
    # Kalibr's black squares touch the tags. AprilTag's own search tells them apart.
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_APRILTAG
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    detected, tags, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(view.picture)
    assert sorted(tags.ravel()) == [*range(6)]
    assert view.visible == {*range(24)}
    # A tag's corners in OpenCV's order are Kalibr's lower right, lower left, and the upper ones.
    first = [tag // 3 * 12 + tag % 3 * 2 for tag in tags.ravel().tolist()]
    ids = [corner for n in first for corner in (n + 1, n, n + 6, n + 7)]
    assert np.median(view.distances(view.refined(detected), ids)) < 0.2


def test_opencv_finds_a_chessboards_corners_where_they_are(results):
    view = View(results / "chessboard", "chessboard")
    found, corners = cv2.findChessboardCorners(view.picture, (5, 4))
    assert found
    assert view.visible == {*range(20)}
    distances = view.distances(view.refined(corners), range(20))
    assert np.median(distances) < 0.2
    assert distances.max() < 0.3


def test_a_corner_behind_a_surface_is_not_visible(results):
    """A ray from the camera to a corner crosses the bar's box."""
    middle, size = np.array(BAR)
    hidden = 0
    for view in LightField.read(results / "charuco/lightfield.json").views:
        shown = View(results / "charuco", "charuco", view.name)
        points = np.array(shown.board["corners"])
        matrix = np.array(shown.board["world_from_board"])
        places = points @ matrix[:3, :3].T + matrix[:3, 3]
        for corner in shown.pixels:
            ray = places[corner] - view.position
            near, far = np.sort(
                [(middle - half - view.position) / ray for half in (size / 2, -size / 2)], axis=0
            )
            crosses = near.max() < min(far.min(), 1) and far.min() > 0
            assert (corner in shown.visible) == (not crosses), (view.name, corner)
            hidden += crosses
    assert hidden >= 3


def test_a_board_from_behind_has_pixels_but_no_visible_corners(results):
    view = View(results / "behind", "chessboard")
    assert len(view.pixels) == 20
    assert not view.visible


def test_boards_are_objects_of_the_scene(results):
    objects = json.loads((results / "behind/mesh/objects.json").read_text())["objects"]
    boxes = {each["name"]: each["box"] for each in objects}
    assert {"charuco", "aprilgrid", "chessboard"} <= boxes.keys()
    # Five by four squares, and a square around them, 3 mm thick.
    assert sorted(boxes["charuco"]["size"]) == pytest.approx([0.003, 0.24, 0.28], abs=1e-6)


def test_cameras_at_random_places_keep_away_from_a_board(results, run_program, tmp_path):
    content = json.loads((results / "chessboard/corners.json").read_text())
    board = content["boards"]["chessboard"]
    rig = {"type": "random", "count": 20, "size": 0.3, "center": board["position"]}
    settings = {
        "rig": rig | {"clearance": 0.05},
        "targets": {"chessboard": {key: board[key] for key in ("type", "squares", "square")}},
    }
    settings["targets"]["chessboard"] |= {key: board[key] for key in ("position", "rotation")}
    (tmp_path / "settings.json").write_text(json.dumps(settings))
    blend = results.parents[1] / "work/boards/scene.blend"
    arguments = ("--blend", blend, "--settings", tmp_path / "settings.json")
    run_program("free_places.py", *arguments, "--output", tmp_path / "places.json")
    places = np.array(json.loads((tmp_path / "places.json").read_text())["places"])
    matrix = np.linalg.inv(board["world_from_board"])
    x, y, z = matrix[:3, :3] @ (0.3 * places + board["position"]).T + matrix[:3, 3:]
    # The pattern is 0.21 × 0.175 m, and has a margin of a square.
    outside = np.maximum(np.abs(np.array([x - 0.105, y - 0.0875])) - [[0.14], [0.1225]], 0)
    distances = np.linalg.norm([*outside, z], axis=0)
    # The board is 3 mm thick.
    assert distances.min() > 0.05 - 0.004
    assert (distances < 0.1).any()


def test_a_board_with_the_name_of_an_object_is_refused(results, run_program, tmp_path):
    board = {"type": "chessboard", "squares": [3, 2], "square": 0.1}
    (tmp_path / "settings.json").write_text(json.dumps({"targets": {"Cube": board}}))
    blend = results.parents[1] / "work/boards/scene.blend"
    before = sha256(blend)
    arguments = ("--blend", blend, "--settings", tmp_path / "settings.json", "--skip-memory")
    run = run_program(
        "inventory.py", *arguments, "--output", tmp_path / "inventory.json", check=False
    )
    assert run.returncode == 1
    assert "scene.blend: targets.Cube: the scene has an object Cube" in run.stderr
    assert "Traceback" not in run.stderr
    assert not (tmp_path / "inventory.json").exists()
    (tmp_path / "settings.json").write_text(json.dumps({"targets": {"board": board}}))
    run_program("inventory.py", *arguments, "--output", tmp_path / "inventory.json")
    # Two boxes, and the board.
    assert json.loads((tmp_path / "inventory.json").read_text())["objects"] == 3
    assert sha256(blend) == before


def test_corners_are_published_with_the_dataset(results):
    sums = (results / "charuco/sha256sums.txt").read_text()
    assert f"{sha256(results / 'charuco/corners.json')}  corners.json\n" in sums
    assert all(
        json.loads((results / rig / "validation.json").read_text())["valid"]
        for rig in ("charuco", "aprilgrid", "chessboard", "behind")
    )
