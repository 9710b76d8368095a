"""Calibrations as their tools write them, against the tools' own projections of points."""

import json
from pathlib import Path

import cv2
import numpy as np
import pycolmap
import pytest

from lightfield.configuration import scene_yaml
from lightfield.core.errors import UserError
from lightfield.geometry.lenses import from_camera
from lightfield.geometry.lenses.calibrations import read
from lightfield.planning.loading import scene_datasets
from lightfield.workflow import job_settings

FILES = Path(__file__).parent / "calibrations"
EUROC = FILES / "euroc_cam0_sensor.yaml"
TUM_VI = FILES / "tum_vi_camchain.yaml"
EUROC_K = np.array([[458.654, 0, 367.215], [0, 457.296, 248.375], [0, 0, 1]])
EUROC_D = np.array([-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05])
TUM_K = np.array(
    [
        [190.97847715128717, 0, 254.93170605935475],
        [0, 190.9733070521226, 256.8974428996504],
        [0, 0, 1],
    ]
)
TUM_D = np.array(
    [0.0034823894022493434, 0.0007150348452162257, -0.0020532361418706202, 0.00020293673591811182]
)
# TUM-VI's left camera as double sphere and as extended unified camera (Usenko et al. 2018).
TUM_DS = [-0.17213086034353243, 0.5931177593944744]
TUM_DS_PIXELS = [158.28600034966977, 158.2743455478755, 254.96116578191653, 256.8894394501779]
TUM_EUCM = [0.6291060871161842, 1.0418067403139693]
TUM_EUCM_PIXELS = [191.14799816648748, 191.13150946585135, 254.95857715233118, 256.8815466235898]


def points(widest):
    """Points before the camera, up to ``widest`` degrees from its axis, with y down."""
    theta, phi = np.meshgrid(np.radians(np.linspace(1, widest, 12)), np.linspace(0, 6, 17))
    sin = np.sin(theta)
    return np.stack([sin * np.cos(phi), sin * np.sin(phi), np.cos(theta)], -1).reshape(-1, 3)


def seen(lens, directions):
    """Where the lens sees directions with y down. Ours have y up, and look along −z."""
    return lens.pixels(directions * [1, -1, -1])


def opencv_pixels(directions, matrix, coefficients, fisheye=False):
    """OpenCV's pixels, whose first has its centre at (0, 0), counted from the image's corner."""
    still = np.zeros(3)
    given = directions.reshape(-1, 1, 3)
    if fisheye:
        found, _ = cv2.fisheye.projectPoints(given, still, still, matrix, coefficients)
    else:
        found, _ = cv2.projectPoints(given, still, still, matrix, coefficients)
    return found.reshape(-1, 2) + 0.5


def written_by_opencv(path, coefficients, **others):
    """Write a file of OpenCV's FileStorage, by OpenCV."""
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for key, value in others.items():
        file.write(key, value)
    file.write("camera_matrix", EUROC_K)
    file.write("distortion_coefficients", np.asarray(coefficients, float).reshape(-1, 1))
    file.release()
    return path


SIZE = {"image_width": 752, "image_height": 480}


@pytest.mark.parametrize("suffix", [".yml", ".xml", ".json"])
@pytest.mark.parametrize(
    "coefficients",
    [
        [*EUROC_D, 0],
        [-0.28, 0.07, 0.0002, 2e-5, 0.01, 0.002, -0.003, 0.0004],
        [-0.28, 0.07, 0.0002, 2e-5, 0.01, *[0] * 9],
    ],
    ids=["five", "eight", "fourteen"],
)
def test_opencvs_file_gives_opencvs_pixels(tmp_path, suffix, coefficients):
    path = written_by_opencv(tmp_path / f"camera{suffix}", coefficients, **SIZE)
    lens = read(path)
    assert (lens.width, lens.height) == (752, 480)
    directions = points(40)
    truth = opencv_pixels(directions, EUROC_K, np.array(coefficients))
    np.testing.assert_allclose(seen(lens, directions), truth, rtol=0, atol=1e-9)


def test_opencvs_fisheye_is_told_by_its_file_or_by_the_user(tmp_path):
    file = written_by_opencv(tmp_path / "said.yml", TUM_D, **SIZE, fisheye_model=1)
    silent = written_by_opencv(tmp_path / "silent.yml", TUM_D, **SIZE)
    directions = points(80)
    truth = opencv_pixels(directions, EUROC_K, TUM_D, fisheye=True)
    for lens in (read(file), read(silent, model="kannala_brandt")):
        np.testing.assert_allclose(seen(lens, directions), truth, rtol=0, atol=1e-9)
    with pytest.raises(UserError, match=r"silent\.yml: distortion_coefficients: has 4 numbers"):
        read(silent)
    with pytest.raises(UserError, match=r"said\.yml: fisheye_model: means kannala_brandt"):
        read(file, model="brown_conrady")


def test_a_model_that_a_files_own_contradicts_is_refused():
    assert read(TUM_VI, "cam0", model="kannala_brandt").name == "kannala_brandt"
    with pytest.raises(UserError, match=r"describes the lens kannala_brandt; leave out the key mo"):
        read(TUM_VI, "cam0", model="brown_conrady")


def test_four_coefficients_of_opencvs_usual_lens_need_its_name(tmp_path):
    path = written_by_opencv(tmp_path / "camera.yml", EUROC_D, **SIZE)
    directions = points(40)
    truth = opencv_pixels(directions, EUROC_K, EUROC_D)
    lens = read(path, model="brown_conrady")
    np.testing.assert_allclose(seen(lens, directions), truth, rtol=0, atol=1e-9)


def test_a_file_without_a_size_needs_a_resolution(tmp_path):
    path = written_by_opencv(tmp_path / "camera.xml", [*EUROC_D, 0])
    with pytest.raises(UserError, match=r"camera\.xml: image_size: is missing; add the key res"):
        read(path)
    assert read(path, resolution=(752, 480)).width == 752


def test_a_stereo_file_of_opencv_has_two_cameras(tmp_path):
    file = cv2.FileStorage(str(tmp_path / "intrinsics.yml"), cv2.FILE_STORAGE_WRITE)
    for number, shift in ((1, 0), (2, 3)):
        file.write(f"M{number}", EUROC_K + np.array([[0, 0, shift], [0, 0, 0], [0, 0, 0]]))
        file.write(f"D{number}", np.zeros((1, 5)))
    file.release()
    path = tmp_path / "intrinsics.yml"
    centers = [read(path, camera, resolution=(752, 480)).center for camera in (1, "2")]
    np.testing.assert_allclose(centers, [(367.715, 248.875), (370.715, 248.875)])
    with pytest.raises(UserError, match="holds 2 cameras; choose one with the key camera: 1, 2"):
        read(path, resolution=(752, 480))


def test_ros_says_which_lens_it_calibrated(tmp_path):
    path = tmp_path / "ost.yaml"
    path.write_text(
        "image_width: 752\nimage_height: 480\ncamera_name: narrow_stereo\n"
        "camera_matrix:\n  rows: 3\n  cols: 3\n"
        f"  data: {EUROC_K.ravel().tolist()}\n"
        "distortion_model: equidistant\n"
        f"distortion_coefficients:\n  rows: 1\n  cols: 4\n  data: {TUM_D.tolist()}\n"
    )
    directions = points(80)
    truth = opencv_pixels(directions, EUROC_K, TUM_D, fisheye=True)
    np.testing.assert_allclose(seen(read(path), directions), truth, rtol=0, atol=1e-9)


def test_eurocs_camera_is_opencvs():
    directions = points(35)
    truth = opencv_pixels(directions, EUROC_K, EUROC_D)
    np.testing.assert_allclose(seen(read(EUROC), directions), truth, rtol=0, atol=1e-9)


def test_kalibrs_fisheye_is_opencvs():
    directions = points(85)
    truth = opencv_pixels(directions, TUM_K, TUM_D, fisheye=True)
    np.testing.assert_allclose(seen(read(TUM_VI, "cam0"), directions), truth, rtol=0, atol=1e-9)
    assert read(TUM_VI, "cam1").center == (252.59949716835982 + 0.5, 254.91723064636983 + 0.5)


def kalibr(tmp_path, model, distortion, intrinsics, coefficients=()):
    path = tmp_path / "camchain.yaml"
    camera = {
        "camera_model": model,
        "distortion_model": distortion,
        "distortion_coeffs": [*coefficients],
        "intrinsics": intrinsics,
        "resolution": [512, 512],
    }
    path.write_text(json.dumps({"cam0": camera}))
    return path


def unified_ratio(p, xi):
    """Mei's camera: the sphere's point, seen from ξ behind its centre."""
    return p[:, :2] / (p[:, 2:] + xi[0])


def double_sphere_ratio(p, parameters):
    """Usenko's equations 40 to 42, of unit vectors."""
    xi, alpha = parameters
    z = xi + p[:, 2:]
    d2 = np.sqrt((p[:, :2] ** 2).sum(-1, keepdims=True) + z**2)
    return p[:, :2] / (alpha * d2 + (1 - alpha) * z)


def extended_unified_ratio(p, parameters):
    """Khomutenko's equation 8."""
    alpha, beta = parameters
    d = np.sqrt(beta * (p[:, :2] ** 2).sum(-1, keepdims=True) + p[:, 2:] ** 2)
    return p[:, :2] / (alpha * d + (1 - alpha) * p[:, 2:])


@pytest.mark.parametrize(
    ("model", "parameters", "pixels", "ratio"),
    [
        ("omni", [0.9], TUM_DS_PIXELS, unified_ratio),
        ("ds", TUM_DS, TUM_DS_PIXELS, double_sphere_ratio),
        ("eucm", TUM_EUCM, TUM_EUCM_PIXELS, extended_unified_ratio),
    ],
)
def test_kalibrs_other_cameras_have_their_own_numbers_first(
    tmp_path, model, parameters, pixels, ratio
):
    lens = read(kalibr(tmp_path, model, "none", [*parameters, *pixels]))
    directions = points(95)
    fx, fy, cx, cy = pixels
    truth = ratio(directions, parameters) * [fx, fy] + [cx + 0.5, cy + 0.5]
    np.testing.assert_allclose(seen(lens, directions), truth, rtol=0, atol=1e-9)


def test_kalibrs_fov_camera_is_colmaps(tmp_path):
    pixels = [300.0, 301.0, 255.0, 257.0]
    lens = read(kalibr(tmp_path, "pinhole", "fov", pixels, [0.92]))
    camera = pycolmap.Camera(
        model="FOV", width=512, height=512, params=[300, 301, 255.5, 257.5, 0.92]
    )
    directions = points(70)
    np.testing.assert_allclose(
        seen(lens, directions), camera.img_from_cam(directions), rtol=0, atol=1e-9
    )


def test_kalibrs_omni_with_a_distortion_is_refused(tmp_path):
    path = kalibr(tmp_path, "omni", "radtan", [0.9, *TUM_DS_PIXELS], EUROC_D)
    with pytest.raises(UserError, match=r"camchain\.yaml: cam0\.distortion_model: is 'radtan', b"):
        read(path)


# A camera of each of COLMAP's models.
COLMAP = {
    "SIMPLE_PINHOLE": [500, 321, 239],
    "PINHOLE": [500, 505, 321, 239],
    "SIMPLE_RADIAL": [500, 321, 239, -0.05],
    "RADIAL": [500, 321, 239, -0.05, 0.01],
    "OPENCV": [500, 505, 321, 239, -0.05, 0.01, 0.002, -0.001],
    "FULL_OPENCV": [500, 505, 321, 239, -0.05, 0.01, 0.002, -0.001, 0.003, 0.01, 0.002, 0.001],
    "OPENCV_FISHEYE": [300, 305, 321, 239, -0.02, 0.01, -0.004, 0.001],
    "SIMPLE_RADIAL_FISHEYE": [300, 321, 239, 0.02],
    "RADIAL_FISHEYE": [300, 321, 239, 0.02, -0.004],
    "FOV": [300, 305, 321, 239, 0.9],
    "THIN_PRISM_FISHEYE": [300, 305, 321, 239, -0.02, 0.01, 0.001, -0.002, 0.003, 0, 0.001, 0.002],
    "RAD_TAN_THIN_PRISM_FISHEYE": [
        *(241, 240, 317, 236, -0.026, 0.097, -0.057, 0.006, 0.004, -0.001),
        *(0.0006, -0.0002, 0.0003, -0.0001, -0.0006, 0.0001),
    ],
    "SIMPLE_DIVISION": [400, 321, 239, -0.2],
    "DIVISION": [400, 405, 321, 239, -0.2],
    "SIMPLE_FISHEYE": [300, 321, 239],
    "FISHEYE": [300, 305, 321, 239],
    "EUCM": [300, 305, 321, 239, 0.6, 1.1],
    "EQUIRECTANGULAR": [640, 480],
}


def colmap_files(folder, model):
    """Write a model with one camera as text and as binary, by COLMAP."""
    camera = pycolmap.Camera(camera_id=7, model=model, width=640, height=480, params=COLMAP[model])
    other = pycolmap.Camera(camera_id=2, model="PINHOLE", width=64, height=48, params=[9, 9, 3, 3])
    reconstruction = pycolmap.Reconstruction()
    for each in (camera, other):
        reconstruction.add_camera(each)
    reconstruction.write_text(str(folder))
    reconstruction.write_binary(str(folder))
    return camera


def test_all_camera_models_of_colmap_have_a_test():
    assert {*COLMAP} == {*pycolmap.CameraModelId.__members__} - {"INVALID"}


@pytest.mark.parametrize("model", COLMAP)
def test_colmaps_file_gives_colmaps_pixels(tmp_path, model):
    camera = colmap_files(tmp_path, model)
    directions = points(30)
    truth = camera.img_from_cam(directions)
    for name in ("cameras.txt", "cameras.bin"):
        lens = read(tmp_path / name, 7)
        assert (lens.width, lens.height) == (640, 480)
        np.testing.assert_allclose(seen(lens, directions), truth, rtol=0, atol=1e-9)


def test_a_pinhole_is_rectilinear_if_its_pixels_are_square(tmp_path):
    names = {}
    for model in ("SIMPLE_PINHOLE", "PINHOLE"):
        colmap_files(tmp_path, model)
        names[model] = read(tmp_path / "cameras.txt", 7).name
    assert names == {"SIMPLE_PINHOLE": "rectilinear", "PINHOLE": "brown_conrady"}


def transforms(tmp_path, **keys):
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps({"w": 640, "h": 480, "frames": [], **keys}))
    return path


def test_nerfstudios_keys_are_colmaps_numbers(tmp_path):
    keys = {"fl_x": 500, "fl_y": 505, "cx": 321, "cy": 239}
    distorted = {"k1": -0.05, "k2": 0.01, "p1": 0.002, "p2": -0.001}
    fisheye = {"k1": -0.02, "k2": 0.01, "k3": -0.004, "k4": 0.001}
    aria = dict(
        zip(("fl_x", "fl_y", "cx", "cy"), COLMAP["RAD_TAN_THIN_PRISM_FISHEYE"], strict=False)
    )
    for content, model, numbers in (
        ({**keys, **distorted}, "OPENCV", distorted.values()),
        ({**keys, **fisheye, "camera_model": "OPENCV_FISHEYE"}, "OPENCV_FISHEYE", fisheye.values()),
        ({**keys, **fisheye, "is_fisheye": True}, "OPENCV_FISHEYE", fisheye.values()),
        (
            {
                **aria,
                "camera_model": "FISHEYE624",
                "distortion_params": COLMAP["RAD_TAN_THIN_PRISM_FISHEYE"][4:],
            },
            "RAD_TAN_THIN_PRISM_FISHEYE",
            COLMAP["RAD_TAN_THIN_PRISM_FISHEYE"][4:],
        ),
    ):
        pixels = [content[key] for key in ("fl_x", "fl_y", "cx", "cy")]
        camera = pycolmap.Camera(model=model, width=640, height=480, params=[*pixels, *numbers])
        directions = points(30)
        lens = read(transforms(tmp_path, **content))
        np.testing.assert_allclose(
            seen(lens, directions), camera.img_from_cam(directions), rtol=0, atol=1e-9
        )


def test_instant_ngps_angle_gives_the_focal_length(tmp_path):
    lens = read(transforms(tmp_path, camera_angle_x=np.pi / 2))
    np.testing.assert_allclose(lens.K, [[320, 0, 320], [0, 320, 240], [0, 0, 1]])


def test_frames_with_cameras_of_their_own_are_chosen_by_their_files(tmp_path):
    frames = [{"file_path": f"images/{x}.png", "fl_x": x, "w": 64, "h": 48} for x in (50, 60)]
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps({"camera_model": "PINHOLE", "frames": frames}))
    assert read(path, "images/60.png").K[0, 0] == pytest.approx(60)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.yaml", "camera_matrix: [1, 2]\n", "camera_matrix: has 2 numbers; must have 9"),
        ("a.yaml", "camera_matrix: [a, 0, 1, 0, 1, 1, 0, 0, 1]\n", "camera_matrix: has 'a'; must"),
        ("a.yaml", "camera_matrix: [1, 5, 1, 0, 1, 1, 0, 0, 1]\n", "camera_matrix: must be fx, 0"),
        ("a.yaml", "camera_matrix: [1, 0, 1, 0, 1, 1, 0, 0, 1]\n", "distortion_coefficients: is m"),
        ("a.yaml", "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   data: [1\n", "a.yaml:"),
        ("a.yaml", "x: !!python/object/apply:os.system [ls]\n", "could not determine a construct"),
        ("a.yaml", "hello: 1\n", "holds no calibration; a calibration is OpenCV's"),
        ("a.yaml", "- 1\n", "holds no keys; a calibration is OpenCV's"),
        ("a.yaml", "cam0: {intrinsics: [1, 1, 1], resolution: [4, 4]}", "cam0.intrinsics: has 3 n"),
        ("a.yaml", "cam0: {camera_model: x, intrinsics: [1]}", "cam0.camera_model: is 'x'; must"),
        ("a.yaml", "cam0: {distortion_model: x, intrinsics: [1, 1, 1, 1]}", "cam0.distortion_mod"),
        ("a.yaml", "cam0: {intrinsics: [-1, 1, 1, 1], resolution: [4, 4]}", "focal length -1; mus"),
        ("a.yaml", "cam0: {intrinsics: [1, 1, 1, 1]}", "cam0.resolution: is missing"),
        ("a.yaml", "cam0: {intrinsics: [1, 1, 1, 1], resolution: [4.5, 4]}", "must be whole num"),
        ("a.xml", "<opencv_storage><camera_matrix>", "is not XML"),
        ("a.xml", "<opencv_storage/>", "holds no"),
        ("a.json", "{", "is not JSON"),
        ("a.json", '{"fl_x": 5, "w": 4, "h": 4, "k4": 1}', "k4: means different lenses"),
        ("a.json", '{"fl_x": 5, "w": 4, "h": 4, "camera_model": "X"}', "camera_model: is 'X'"),
        ("a.json", '{"camera_angle_x": 5, "w": 4, "h": 4}', "camera_angle_x: is 5; must be an"),
        ("a.json", '{"fl_x": NaN, "w": 4, "h": 4}', "fl_x: has nan; must be finite"),
        ("a.json", f'{{"fl_x": {"9" * 400}, "w": 4, "h": 4}}', "fl_x: has 9999"),
        ("a.json", f'{{"K": {"[" * 500}{"]" * 500}}}', "K: has [[[["),
        ("a.txt", "1 FISHBOWL 4 4 1 2\n", "camera 1: MODEL: is FISHBOWL; must be one of SIMPLE_P"),
        ("a.txt", "1 PINHOLE 4 4 1 2\n", "camera 1: PINHOLE: has 2 numbers; must have 4"),
        ("a.txt", "1 PINHOLE 4 4 1 2 x 4\n", "camera 1: PINHOLE: has 'x'; must be finite numbers"),
        ("a.txt", "# only a comment\n", "holds no camera"),
        ("a.txt", "Dear reader\n", "must be CAMERA_ID, MODEL"),
        ("a.bin", "abc", "is not a valid cameras.bin: it is cut short"),
        ("a.bin", "\1" + "\0" * 7 + "\1\0\0\0\x63\0\0\0" + "\0" * 16, "has the model 99"),
        ("a.png", "", "must end in .yaml"),
    ],
)
def test_a_damaged_file_names_its_key(tmp_path, name, content, message):
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(UserError) as error:
        read(path)
    assert str(error.value).startswith(str(path))
    assert message in str(error.value)


def scene(tmp_path, monkeypatch, camera, name="own", **blocks):
    """Write a scene YAML whose rig has a camera, and return the rig's dataset."""
    content = {
        "scene": {"builder": "rooms"},
        "rigs": {"wall": {"type": "plane", "cameras": [2, 2], "baseline": 0.1, "camera": camera}},
        "render": {"samples": 4},
        **blocks,
    }
    (tmp_path / f"{name}.yaml").write_text(json.dumps(content))
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    (dataset,) = scene_datasets(name)
    return dataset


def test_the_numbers_of_a_file_take_its_place_in_the_settings_of_jobs(tmp_path, monkeypatch):
    file = tmp_path / "cameras.txt"
    camera = {"lens": "calibrated", "file": str(file)}
    seen_settings = []
    for focal_length in (500, 501):
        file.write_text(f"1 SIMPLE_PINHOLE 640 480 {focal_length} 321 239\n")
        # A process reads a scene YAML once.
        dataset = scene(tmp_path, monkeypatch, camera, f"own_{focal_length}")
        seen_settings.append(job_settings.lightfield(dataset).model_dump(mode="json"))
    before, after = (settings["rig"]["camera"] for settings in seen_settings)
    assert "file" not in before
    assert before["focal_length"] == 500 * 36 / 640
    assert after == {**before, "focal_length": 501 * 36 / 640}


def test_a_mistake_in_the_file_stands_at_the_cameras_key(tmp_path, monkeypatch):
    camera = {"lens": "calibrated", "file": str(TUM_VI)}
    with pytest.raises(UserError, match=r"rigs\.wall\.camera\.file: .*camchain\.yaml: holds 2 cam"):
        scene(tmp_path, monkeypatch, camera)


def test_a_lens_ends_at_its_fov():
    camera = {"lens": "calibrated", "file": str(TUM_VI), "camera": "cam0", "fov": 170}
    lens = from_camera(camera)
    axis_angles = np.radians([84, 86])
    rays = np.stack([np.sin(axis_angles), np.zeros(2), -np.cos(axis_angles)], -1)
    assert np.isfinite(lens.pixels(rays)[:, 0]).tolist() == [True, False]


def test_views_can_be_resampled_through_a_calibration(tmp_path, monkeypatch):
    around = {"lens": "equirectangular", "resolution": [64, 32]}
    euroc = {"camera": {"lens": "calibrated", "file": str(EUROC)}}
    dataset = scene(tmp_path, monkeypatch, around, reprojections={"euroc": euroc})
    lens = dataset.reprojections["euroc"].camera.make()
    directions = points(35)
    truth = opencv_pixels(directions, EUROC_K, EUROC_D)
    np.testing.assert_allclose(seen(lens, directions), truth, rtol=0, atol=1e-9)
