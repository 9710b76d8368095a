"""COLMAP itself reads the exported models, and finds cameras, poses, points and depth of the views.

The scene is the inside of a sphere, so all its points are known.
"""

import math

import cv2
import numpy as np
import pycolmap
import pytest
from sphere import CALIBRATED, LENSES, RADIUS, colour_of, look, look_at_ball, write_views
from test_exports import RIG, VIEWS, exported, on_sphere

from lightfield.export.source import SourceDataset
from lightfield.exporters import EXPORTERS
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.products import exports

# COLMAP's cameras look along +Z, with Y down.
FLIP = np.diag([1.0, -1, -1, 1])
FORMS = ["binary", "text"]
MODELS = {
    "perspective": "PINHOLE",
    "png": "PINHOLE",
    "shifted": "PINHOLE",
    "fisheye": "OPENCV_FISHEYE",
    "opencv": "OPENCV_FISHEYE",
    "panorama": "EQUIRECTANGULAR",
} | {name: name for name in CALIBRATED}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder = tmp_path_factory.mktemp("colmap") / "dataset"
    for source in MODELS:
        suffix = ".png" if source == "png" else ".exr"
        camera = (LENSES | CALIBRATED).get(source, LENSES["perspective"])
        write_views(folder / source, camera, RIG, suffix)
    # Points of 8-bit pictures come from the depth of the rendered views.
    write_views(folder, VIEWS, RIG)
    return folder


def read(folder):
    """Return the model of an export, as COLMAP reads it."""
    return pycolmap.Reconstruction(folder / "sparse" / "0")


def observed(model):
    """Yield each image, with the pixels (n, 2) and the places (n, 3) of the points that it sees."""
    for image in model.images.values():
        seen = [point for point in image.points2D if point.has_point3D()]
        assert len(seen) == len(image.points2D)
        pixels = np.array([point.xy for point in seen]).reshape(-1, 2)
        places = [model.points3D[point.point3D_id].xyz for point in seen]
        yield image, pixels, np.array(places).reshape(-1, 3)


def assert_has_the_cameras_of(model, views, lens):
    """Check the lens of a model, and the poses of its images, against views by image name."""
    (camera,) = model.cameras.values()
    assert (camera.width, camera.height) == (lens.width, lens.height)
    rays = lens.pixel_rays()
    row, column = np.nonzero(np.isfinite(rays[..., 0]))
    found = camera.cam_ray_from_img(np.column_stack([column, row]) + 0.5)
    np.testing.assert_allclose(found, rays[row, column] * [1, -1, -1], atol=1e-6)
    assert {image.name for image in model.images.values()} == views.keys()
    for image in model.images.values():
        world_from_camera = np.vstack([image.cam_from_world().inverse().matrix(), [0, 0, 0, 1]])
        np.testing.assert_allclose(
            world_from_camera @ FLIP, views[image.name].world_from_camera, atol=1e-12
        )


def assert_projects_its_points(model):
    """Check that COLMAP projects each point to the pixel that its image notes, and the tracks."""
    noted = set()
    for image, pixels, places in observed(model):
        projected = [image.project_point(place) for place in places]
        np.testing.assert_allclose(np.reshape(projected, (-1, 2)), pixels, atol=1e-6)
        noted |= {
            (image.image_id, index, point.point3D_id) for index, point in enumerate(image.points2D)
        }
    tracks = {
        (element.image_id, element.point2D_idx, number)
        for number, point in model.points3D.items()
        for element in point.track.elements
    }
    assert tracks == noted


def views_of(folder):
    """Return the views of a light field by the names of their images."""
    lightfield = LightField.read(folder / "lightfield.json")
    return {f"{view.name}.png": view for view in lightfield.views}, lightfield.lens


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("source", MODELS)
def test_colmap_reads_the_cameras_and_projects_the_points(dataset, tmp_path, source, form):
    folder = exported(dataset, "colmap", source, tmp_path, format=form, points=400)
    model = read(folder)
    assert_has_the_cameras_of(model, *views_of(dataset / source))
    assert {camera.model_name for camera in model.cameras.values()} == {MODELS[source]}
    assert_projects_its_points(model)
    assert len(model.points3D) == 400
    for point in model.points3D.values():
        on_sphere(point.xyz, 1e-5)
        np.testing.assert_allclose(point.color, colour_of(point.xyz), atol=6)
    pictures = {path.name for path in (folder / "images").iterdir()}
    assert pictures == {image.name for image in model.images.values()}


@pytest.mark.parametrize("source", ["perspective", "shifted", "fisheye", "opencv"])
def test_a_view_sees_every_point_in_its_image(dataset, tmp_path, source):
    """Nothing inside a sphere hides anything."""
    folder = exported(dataset, "colmap", source, tmp_path, points=400)
    model = read(folder)
    _, lens = views_of(dataset / source)
    everything = np.array([point.xyz for point in model.points3D.values()])
    for image, pixels, _ in observed(model):
        local = image.cam_from_world() * everything
        angle = np.degrees(np.arctan2(np.hypot(*local.T[:2]), local[:, 2]))
        is_inside = np.array(
            [
                # Points behind a camera have no pixel.
                pixel is not None and ((pixel > 0) & (pixel < (lens.width, lens.height))).all()
                for pixel in map(image.project_point, everything)
            ]
        )
        mask = folder / "masks" / f"{image.name}.png"
        if mask.exists():
            valid = images.read_image(mask).channels["Y"] > 0
            # A pixel at the rim of an image circle is valid, but partly outside the circle.
            is_inside &= angle <= LENSES[source]["fov"] / 2
            column, row = np.array(
                [image.project_point(point) for point in everything[is_inside]]
            ).T.astype(int)
            is_inside[is_inside] = valid[row, column]
        assert len(pixels) == is_inside.sum()
    assert (folder / "masks").exists() == (source in ("fisheye", "opencv"))


@pytest.mark.parametrize("source", ["perspective", "shifted", "fisheye", "opencv"])
def test_colmap_lifts_the_depth_maps_to_the_scene(dataset, tmp_path, source):
    folder = exported(dataset, "colmap", source, tmp_path, depth=True, points=50)
    model = read(folder)
    for image in model.images.values():
        depth = read_depth(folder, image)
        row, column = np.nonzero(depth)
        assert len(row) > 1000
        pixels = np.column_stack([column, row]) + 0.5
        directions = model.cameras[image.camera_id].cam_from_img(pixels)
        local = np.column_stack([directions, np.ones(len(row))]) * depth[row, column, None]
        on_sphere(image.cam_from_world().inverse() * local, 1e-5)


def read_depth(folder, image):
    """Return an image's depth map (h, w) in metres, as COLMAP reads it."""
    depth_map = pycolmap.DepthMap()
    depth_map.read(folder / "stereo/depth_maps" / f"{image.name}.geometric.bin")
    return depth_map.to_array()


def test_depth_maps_are_0_where_a_view_sees_the_sky(tmp_path):
    def open_above(lens, matrix):
        colour, distance = look(lens, matrix)
        distance[: lens.height // 2] = np.inf
        return colour, distance

    folder = tmp_path / "dataset"
    write_views(folder, LENSES["perspective"], RIG, see=open_above)
    made = exported(folder, "colmap", "views", tmp_path, depth=True, points=50)
    for image in read(made).images.values():
        z = read_depth(made, image)
        assert z.shape == (48, 64)
        assert (z[:24] == 0).all()
        assert ((z[24:] > 0.5) & (z[24:] < 2 * RADIUS)).all()


@pytest.mark.parametrize("form", FORMS)
def test_a_model_has_the_views_of_the_rigs_that_test_too(tmp_path, form):
    views = {}
    for rig, split in (("around", "train"), ("along", "test")):
        turned = RIG | {"split": split, "rotation": [10, 20, 3 * len(rig)]}
        folder = tmp_path / rig / "dataset"
        write_views(folder, LENSES["perspective"], turned, see=look_at_ball)
        rig_views, lens = views_of(folder)
        prefix = "" if rig == "around" else "along_"
        views |= {f"{prefix}{name}": view for name, view in rig_views.items()}
    beside = {"along": tmp_path / "along/dataset"}
    source = SourceDataset(tmp_path / "around/dataset", "", ".exr", beside)
    settings = EXPORTERS["colmap"](sources=["views"], points=200, format=form)
    exports.run(source, settings, tmp_path / "made")
    model = read(tmp_path / "made")
    assert_has_the_cameras_of(model, views, lens)
    assert_projects_its_points(model)
    tests = (tmp_path / "made/sparse/0/test.txt").read_text().split()
    assert sorted(tests) == sorted(name for name in views if name.startswith("along_"))


def test_colmap_sees_the_points_all_around_a_panorama(tmp_path, capsys):
    write_views(tmp_path / "dataset", LENSES["panorama"], RIG)
    folder = exported(tmp_path / "dataset", "colmap", "views", tmp_path, points=400)
    assert "gsplat, 3DGRUT and the original 3D Gaussian splatting do not" in capsys.readouterr().err
    assert not (folder / "masks").exists()
    model = read(folder)
    assert_projects_its_points(model)
    for image, _, places in observed(model):
        assert len(places) > 100
        on_sphere(places, 1e-5)
        assert ((image.cam_from_world() * places)[:, 2] < 0).any()


@pytest.mark.parametrize("form", FORMS)
def test_a_model_may_have_no_points(tmp_path, form):
    def sky(lens, _):
        shape = (lens.height, lens.width)
        return np.ones((*shape, 3)), np.full(shape, np.inf)

    write_views(tmp_path / "dataset", LENSES["perspective"], RIG, see=sky)
    model = read(exported(tmp_path / "dataset", "colmap", "views", tmp_path, format=form))
    assert len(model.images) == 12
    assert not model.points3D


def test_every_image_with_finite_depth_has_a_point(tmp_path, capsys):
    camera = {"lens": "rectilinear", "fov": 40, "resolution": [24, 24]}
    write_views(tmp_path / "dataset", camera, {"type": "sphere", "subdivisions": 2, "size": 0.2})
    sky = "view_0007f"
    path = tmp_path / "dataset" / "exr" / f"{sky}.exr"
    image = images.read_image(path)
    nothing = {**image.channels, "Z": np.full_like(image.channels["Z"], np.inf)}
    images.write_exr(path, nothing, {images.DEPTH_ATTRIBUTE: "z"})
    # The views look in 42 directions, so four points are too few.
    model = read(exported(tmp_path / "dataset", "colmap", "views", tmp_path, points=4))
    assert len(model.images) == 42
    for image, _, places in observed(model):
        assert len(places) > 0 or image.name == f"{sky}.png"
        on_sphere(places, 1e-5)
    assert_projects_its_points(model)
    alone = sum(point.track.length() == 1 for point in model.points3D.values())
    printed = capsys.readouterr().out
    assert f"{len(model.points3D)} points; only one view sees {alone} of them" in printed


# ---- 3DGRUT ---------------------------------------------------------------------------------


def read_by_3dgrut(camera):
    """Return the angles in radians that 3DGRUT computes for pixels, and those that it projects.

    Follows its dataset_colmap.py, OpenCVFisheyeCameraModel in NCore and cameraProjections.cuh.
    The first are the angles (h, w) of pixels. The others are two rows: angles up to the largest,
    and their radii in focal lengths.
    """
    width, height = camera.width, camera.height
    fx, fy, cx, cy, *distortion = camera.params
    corner = math.hypot(max(cx, width - cx), max(cy, height - cy))
    largest = max(corner / fx, corner / fy)
    radius = np.polynomial.Polynomial([c for k in (1, *distortion) for c in (0, k)])
    y, x = np.mgrid[:height, :width] + 0.5
    seen = np.hypot((x - cx) / fx, (y - cy) / fy)
    angles = seen * largest / max(width / 2 / fx, height / 2 / fy)
    for _ in range(3):
        angles = angles - (radius(angles) - seen) / radius.deriv()(angles)
    projected = np.linspace(0, largest, 1000)
    return angles, np.stack([projected, radius(projected)])


TURNING = [0.02, -0.01, 0.003, -0.001]


@pytest.mark.parametrize(
    ("changed", "problem"),
    [
        ({"coefficients": TURNING}, "stops growing at 109.2°, but 3DGRUT reads it up to 121.5°"),
        ({"coefficients": [0, 0, 0, 0]}, None),
        ({"coefficients": [0.02, 0.01, 0, 0]}, None),
        # Newton's method starts beyond the corner's angle, where the radius falls.
        ({"coefficients": [0.021, -0.0043, -0.002, -0.0006], "fov": 174}, "stops growing at"),
        ({"coefficients": TURNING, "focal_length": 40}, None),
        ({"coefficients": [-0.1, 0, 0, 0], "focal_length": 24}, "draws nothing beyond 60.8°"),
    ],
)
def test_a_fisheye_that_3dgrut_misreads_is_warned_of(tmp_path, capsys, changed, problem):
    camera = {
        "lens": "kannala_brandt",
        "focal_length": 12,
        "fov": 160,
        "resolution": [96, 96],
        **changed,
    }
    write_views(tmp_path / "dataset", camera, {"type": "plane", "cameras": [2, 1], "size": 0.2})
    folder = exported(tmp_path / "dataset", "colmap", "views", tmp_path, points=50)
    warned = [line for line in capsys.readouterr().err.splitlines() if "warning" in line]
    assert [problem in line for line in warned] == [True] * (problem is not None)
    rays = lenses.from_camera(camera).pixel_rays()
    seen = np.isfinite(rays[..., 0])
    true = np.arccos(-rays[..., 2][seen])
    (read_camera,) = read(folder).cameras.values()
    with np.errstate(all="ignore"):
        angles, (projected, radii) = read_by_3dgrut(read_camera)
    off = np.abs(angles[seen] - true).max() > 0.01
    unseen = projected > true.max() + 0.02
    folds_in = (radii[unseen] < radii[~unseen].max() - 0.01).any()
    cut = true.max() > projected.max()
    assert (off or folds_in or cut) == (problem is not None)


def written(tmp_path, camera):
    """Export views of a camera. Return COLMAP's camera, the lens, and the export's folder."""
    write_views(tmp_path / "dataset", camera, RIG)
    folder = exported(tmp_path / "dataset", "colmap", "views", tmp_path, points=50)
    (found,) = read(folder).cameras.values()
    return found, lenses.from_camera(camera)


def test_a_unified_lens_is_colmaps_extended_one(tmp_path):
    camera = CALIBRATED["EUCM"] | {"lens": "unified", "coefficients": [0.8]}
    found, lens = written(tmp_path, camera)
    assert found.model_name == "EUCM"
    angles, azimuths = np.radians(np.meshgrid(np.linspace(1, 80, 9), np.linspace(0, 350, 9)))
    rays = np.stack(
        [np.sin(angles) * np.cos(azimuths), np.sin(angles) * np.sin(azimuths), np.cos(angles)], -1
    ).reshape(-1, 3)
    np.testing.assert_allclose(
        found.img_from_cam(rays), lens.pixels(rays * [1, -1, -1]), rtol=0, atol=1e-9
    )


def test_a_division_lens_beyond_180_degrees_is_colmaps(tmp_path):
    camera = CALIBRATED["DIVISION"] | {"focal_length": 6, "coefficients": [-0.5], "fov": 230}
    found, lens = written(tmp_path, camera)
    angles = np.radians([60, 89, 91, 112])
    rays = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], -1)
    pixels = lens.pixels(rays * [1, -1, -1])
    assert np.isfinite(pixels).all()
    np.testing.assert_allclose(found.img_from_cam(rays), pixels, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("model", "programs"),
    [
        ("FULL_OPENCV", "gsplat stops at"),
        ("FOV", "gsplat and 3DGRUT stop at, and Brush takes for a pinhole"),
        ("THIN_PRISM_FISHEYE", "gsplat and 3DGRUT stop at"),
        ("EUCM", "gsplat, 3DGRUT and Brush stop at"),
    ],
)
def test_a_model_that_trainers_do_not_read_is_a_warning(tmp_path, capsys, model, programs):
    written(tmp_path, CALIBRATED[model])
    assert f"camera: is COLMAP's {model}, which {programs}" in capsys.readouterr().err


def test_gsplats_half_pixel_is_a_warning_because_it_moves_eurocs_pixels(tmp_path, capsys):
    """gsplat gives COLMAP's principal point to OpenCV, whose pixels' centres are whole numbers."""
    camera = {
        "lens": "brown_conrady",
        "focal_length": 21.96,
        "coefficients": [-0.2834, 0.074, 0.0002, 2e-5],
        "resolution": [75, 48],
    }
    found, _ = written(tmp_path, camera)
    assert "camera: gsplat undistorts it as if the first" in capsys.readouterr().err
    # As in gsplat's examples/datasets/colmap.py.
    matrix, distortion, size = found.calibration_matrix(), found.params[4:8], (75, 48)
    flat, _ = cv2.getOptimalNewCameraMatrix(matrix, distortion, size, 0)
    columns, rows = cv2.initUndistortRectifyMap(matrix, distortion, None, flat, size, cv2.CV_32FC1)
    shown = found.cam_from_img(np.stack([columns, rows], -1).reshape(-1, 2).astype(float) + 0.5)
    taken = shown @ flat[:2, :2].T + flat[:2, 2]
    row, column = np.mgrid[:48, :75] + 0.5
    moved = np.linalg.norm(taken - np.stack([column, row], -1).reshape(-1, 2), axis=-1)
    assert 0.3 < moved.max() < 0.6
