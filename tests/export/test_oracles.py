"""The oracles agree with every export, and name a number that differs from lightfield.json's.

The scene is a ball in a sphere. It has every export that this project writes.
"""

import functools
import json
import re
import shutil
import struct
import zlib
from contextlib import contextmanager

import numpy as np
import oracles
import pytest
from oracles import exported_cameras, exported_depth, exported_pictures
from pydantic import TypeAdapter
from sphere import LENSES, look_at_ball, write_views

from lightfield import export
from lightfield.configuration.exports import settings_of
from lightfield.core.files import read_json, write_json
from lightfield.core.flags import parsed
from lightfield.export import zarr_store
from lightfield.export.source import SourceDataset
from lightfield.formats.lightfield import LightField
from lightfield.formats.splits_file import splits_content
from lightfield.imaging import images
from lightfield.stages.exports import ExportInstantNgp
from lightfield.validation.files import read_sets

VIEWS = {"lens": "equidistant", "fov": 180, "resolution": [64, 64]}
# HCI's layout needs equal steps across and down. No number of a pose is round.
RIG = {
    "type": "plane",
    "cameras": [5, 2],
    "size": [0.8, 1, 0.2],
    "center": [0.3, -0.2, 0.1],
    "rotation": [10, 20, 30],
}
SPLIT = {"test": ["view_0001f"], "validation": ["view_0004f"]}
SETS = {
    "perspective": LENSES["perspective"],
    "shifted": LENSES["shifted"],
    "fisheye": LENSES["fisheye"],
    "wide": LENSES["wide"],
    "opencv": LENSES["opencv"],
    "panorama": LENSES["panorama"],
    "half": LENSES["half"],
    "split": LENSES["perspective"],
}
# The exports of each set; "views" are the rendered ones.
EXPORTS = {
    "views": {"opendibr": {}, "point_cloud": {"voxel": 0.1}},
    "perspective": {
        "colmap": {"format": "text", "points": 60, "depth": True},
        "nerfstudio": {"points": 60, "depth": True},
        "nerf_synthetic": {},
        "opendibr": {},
        "miv": {},
        "hci": {},
        "lichtfeld": {"points": 60, "depth": True, "format": "exr"},
        "ncore": {"points": 60},
        "poses_csv": {},
    },
    "shifted": {"colmap": {"points": 60}, "nerfstudio": {"points": 60}, "opendibr": {}, "miv": {}},
    "fisheye": {
        "colmap": {"points": 60},
        "lichtfeld": {"points": 60, "depth": True},
        "nerfstudio": {"points": 60, "depth": True},
        "opendibr": {},
        "scannetpp": {"points": 60},
    },
    "wide": {"nerfstudio": {"points": 60}, "ncore": {"points": 60}},
    "opencv": {"colmap": {"format": "text", "points": 60}},
    "panorama": {
        "colmap": {"format": "text", "points": 60},
        "lichtfeld": {"points": 60},
        "nerfstudio": {"points": 60},
        "opendibr": {},
        "miv": {},
    },
    "half": {"opendibr": {}, "miv": {}},
    "split": {
        "colmap": {"format": "text", "points": 60},
        "lichtfeld": {"points": 60},
        "nerfstudio": {"points": 60},
    },
}
INSTANT_NGP = {
    "views": ["--depth-bounds"],
    "perspective": ["--depth-bounds", "--aabb-scale", "4"],
    "shifted": [
        "--scale",
        "0.3",
        "--offset",
        "0.1",
        "0.2",
        "0.3",
        "--aabb-scale",
        "2",
        "--render-aabb",
        "0.1",
        "0.2",
        "0.3",
        "0.6",
        "0.7",
        "0.8",
    ],
    "wide": [],
    "opencv": [],
    "panorama": [],
    "split": [],
}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exported") / "scene" / "dataset"
    write_views(folder, VIEWS, RIG, see=look_at_ball)
    for name, camera in SETS.items():
        rig = RIG | ({"split": SPLIT} if name == "split" else {})
        write_views(folder / name, camera, rig, see=look_at_ball)
    for name, formats in EXPORTS.items():
        for kind, options in formats.items():
            write_export(folder, name, kind, options)
    for name, arguments in INSTANT_NGP.items():
        write_instant_ngp(folder, name, arguments)
    return folder


def home(folder, name):
    return folder if name == "views" else folder / name


def write_export(folder, name, kind, options, beside=None):
    settings = TypeAdapter(settings_of(kind)).validate_python({"sources": [name], **options})
    source = SourceDataset(folder, "" if name == "views" else name, ".exr", beside or {})
    export.run(kind, source, settings, home(folder, name) / "exports" / kind)


def write_instant_ngp(folder, name, arguments):
    folder_of_set = home(folder, name)
    images = folder / "exr" if folder_of_set == folder else folder_of_set
    files = ["--input-cfg", folder_of_set / "lightfield.json"]
    files += ["--output", folder_of_set / "transforms.json"]
    files += ["--image-suffix", ".exr", "--image-dir", images]
    files += ["--depth-dir", folder_of_set / "instant_ngp" / "depth"]
    parsed(ExportInstantNgp, None, [*map(str, files), *arguments]).run()


@functools.cache
def read_once(folder, reprojections, _contents):
    """Return the sets of a dataset. ``_contents`` are those of the files that this reads."""
    return read_sets(folder, reprojections)[0]


def sets_and_lists(folder, name, kind):
    """Return the sets that an export concerns, and the export's lists."""
    lists = home(folder, name).glob("transforms*.json")
    if kind != "instant_ngp":
        lists = [home(folder, name) / "exports" / kind / "export.json"]
    reprojections = () if name == "views" else (name,)
    files = [folder / each / "lightfield.json" for each in ("", *reprojections)]
    sets = read_once(folder, reprojections, tuple(file.read_bytes() for file in files))
    return sets, {path.resolve() for path in lists}


def problems(folder, name, kind):
    """Return what is wrong with the cameras, points and depth of one export."""
    sets, lists = sets_and_lists(folder, name, kind)
    lines, exports = exported_cameras.check(folder, sets, lists)
    lines += exported_depth.faults(folder, sets, exports)
    return [line.replace(f"{folder}/", "") for line in lines]


def picture_problems(folder, name, kind):
    """Return what is wrong with the pictures of one export."""
    sets, lists = sets_and_lists(folder, name, kind)
    _, exports = exported_cameras.check(folder, sets, lists)
    lines = exported_pictures.faults(folder, sets, exports)
    return [line.replace(f"{folder}/", "") for line in lines]


@pytest.mark.parametrize("name", SETS)
def test_correct_exports_agree_with_their_views(name, dataset):
    assert oracles.faults(dataset, [name]) == []


def test_the_exports_of_a_build_agree_with_their_views(smoke):
    datasets = [path.parent for path in (smoke / "results/smoke").glob("*/lightfield.json")]
    assert datasets
    for dataset in datasets:
        reprojections = [path.parent.name for path in dataset.glob("*/lightfield.json")]
        assert oracles.faults(dataset, reprojections) == []


def other_digit(text, place=0):
    """Return a number of the same length that differs in one digit.

    ``place`` counts the significant digits. If it is too large, the last digit changes.
    """
    digits = [index for index, letter in enumerate(text.partition("e")[0]) if letter.isdigit()]
    while text[digits[0]] == "0" and len(digits) > 1:
        digits.pop(0)
    index = digits[min(place, len(digits) - 1)]
    return f"{text[:index]}{(int(text[index]) + 3) % 10}{text[index + 1 :]}"


@contextmanager
def changed(path, content):
    """Replace a file's content for a while, by one of the same length."""
    right = path.read_bytes()
    assert len(content) == len(right)
    assert content != right
    path.write_bytes(content)
    try:
        yield
    finally:
        path.write_bytes(right)


def in_json(path, keys, place):
    """Return a JSON file's bytes with a changed digit in the number at ``keys``."""
    content = read_json(path)
    *parents, last = keys
    parent = content
    for key in parents:
        parent = parent[key]
    parent[last] = f"@{other_digit(json.dumps(parent[last]), place)}@"
    return (json.dumps(content, indent=1) + "\n").replace('"@', "").replace('@"', "").encode()


def in_text(path, pattern, place):
    """Return a text's bytes with a changed digit in the number that the pattern's group matches."""
    text = path.read_text()
    match = re.search(pattern, text, re.M)
    start, end = match.span(1)
    return f"{text[:start]}{other_digit(match[1], place)}{text[end:]}".encode()


FRAME = ("frames", 3, "transform_matrix")
OF_FRAME = "transforms.json: frames[3] (view_0003f): its"
OF_POSITION, OF_ROTATION = f"{OF_FRAME} position", f"{OF_FRAME} rotation"
OF_LENS = "transforms.json: its camera"
CAMERA = ("cameras", 4)
OF_CAMERA = "cameras[4] (view_0003f)"

# The set, the export, the number's keys in the JSON, and the message of validation.
IN_JSON = [
    ("perspective", "instant_ngp", "", (*FRAME, 0, 3), OF_POSITION),
    ("perspective", "instant_ngp", "", (*FRAME, 2, 1), OF_ROTATION),
    ("perspective", "instant_ngp", "", (*FRAME, 3, 0), "the last row of its matrix"),
    ("perspective", "instant_ngp", "", ("fl_x",), OF_LENS),
    ("perspective", "instant_ngp", "", ("fl_y",), OF_LENS),
    ("perspective", "instant_ngp", "", ("cx",), OF_LENS),
    ("perspective", "instant_ngp", "", ("cy",), OF_LENS),
    ("perspective", "instant_ngp", "", ("camera_angle_x",), "camera_angle_x"),
    ("perspective", "instant_ngp", "", ("camera_angle_y",), "camera_angle_y"),
    ("perspective", "instant_ngp", "", ("w",), "its image has"),
    ("perspective", "instant_ngp", "", ("h",), "its image has"),
    ("perspective", "instant_ngp", "", ("integer_depth_scale",), "integer_depth_scale"),
    ("perspective", "instant_ngp", "", ("aabb_scale",), "aabb_scale"),
    ("perspective", "instant_ngp", "", ("options", "aabb_scale"), "aabb_scale"),
    ("perspective", "instant_ngp", "", ("scale",), "scale, offset"),
    ("perspective", "instant_ngp", "", ("offset", 1), "scale, offset"),
    ("views", "instant_ngp", "", ("ftheta_p1",), OF_LENS),
    ("views", "instant_ngp", "", ("ftheta_p2",), OF_LENS),
    ("views", "instant_ngp", "", ("fl_x",), "fl_x"),
    ("views", "instant_ngp", "", ("scale",), "scale, offset"),
    ("opencv", "instant_ngp", "", ("ftheta_p1",), "fl_x"),
    ("opencv", "instant_ngp", "", ("ftheta_p3",), OF_LENS),
    ("opencv", "instant_ngp", "", ("ftheta_p4",), OF_LENS),
    ("opencv", "instant_ngp", "", (*FRAME, 0, 1), OF_ROTATION),
    ("wide", "instant_ngp", "", ("cx",), OF_LENS),
    ("wide", "instant_ngp", "", ("scale",), "scale, offset"),
    ("wide", "instant_ngp", "", ("offset", 0), "scale, offset"),
    ("panorama", "instant_ngp", "", ("cx",), "cx"),
    ("panorama", "instant_ngp", "", ("fl_y",), "fl_y"),
    ("panorama", "instant_ngp", "", (*FRAME, 1, 3), OF_POSITION),
    ("shifted", "instant_ngp", "", ("scale",), "scale: is 0."),
    ("shifted", "instant_ngp", "", ("offset", 2), "offset: puts the mean camera"),
    ("shifted", "instant_ngp", "", ("render_aabb", 1, 0), "render_aabb"),
    ("shifted", "instant_ngp", "", ("options", "offset", 1), "offset: puts the mean camera"),
    ("perspective", "nerfstudio", "transforms.json", (*FRAME, 2, 3), OF_POSITION),
    ("perspective", "nerfstudio", "transforms.json", (*FRAME, 0, 0), OF_ROTATION),
    ("perspective", "nerfstudio", "transforms.json", ("fl_y",), OF_LENS),
    ("perspective", "nerfstudio", "transforms.json", ("cx",), OF_LENS),
    ("perspective", "nerfstudio", "transforms.json", ("h",), "its image has"),
    ("perspective", "nerfstudio", "transforms.json", ("applied_transform", 1, 2), "view_0003f"),
    ("wide", "nerfstudio", "transforms.json", ("fl_x",), OF_LENS),
    ("wide", "nerfstudio", "transforms.json", ("k1",), OF_LENS),
    ("wide", "nerfstudio", "transforms.json", ("k4",), OF_LENS),
    ("panorama", "nerfstudio", "transforms.json", ("fl_x",), OF_LENS),
    ("panorama", "nerfstudio", "transforms.json", ("cy",), OF_LENS),
    ("perspective", "lichtfeld", "transforms.json", (*FRAME, 1, 3), OF_POSITION),
    ("perspective", "lichtfeld", "transforms.json", (*FRAME, 2, 0), OF_ROTATION),
    ("perspective", "lichtfeld", "transforms.json", ("fl_x",), OF_LENS),
    ("perspective", "lichtfeld", "transforms.json", ("cy",), OF_LENS),
    ("perspective", "lichtfeld", "transforms.json", ("w",), "its image has"),
    ("fisheye", "lichtfeld", "transforms.json", ("fl_y",), OF_LENS),
    ("fisheye", "lichtfeld", "transforms.json", ("k2",), OF_LENS),
    ("fisheye", "lichtfeld", "transforms.json", ("k3",), OF_LENS),
    ("panorama", "lichtfeld", "transforms.json", ("h",), "its image has"),
    ("panorama", "lichtfeld", "transforms.json", (*FRAME, 0, 3), OF_POSITION),
    *(
        ("perspective", "nerf_synthetic", f"transforms_{part}.json", keys, said)
        for part in ("train", "val", "test")
        for keys, said in (
            (("camera_angle_x",), f"transforms_{part}.json: camera_angle_x"),
            (("frames", 1, "transform_matrix", 1, 3), f"transforms_{part}.json: frames[1] (view_0"),
        )
    ),
    ("perspective", "opendibr", "cameras.json", (*CAMERA, "Position", 0), OF_CAMERA),
    ("perspective", "opendibr", "cameras.json", (*CAMERA, "Rotation", 2), OF_CAMERA),
    ("perspective", "opendibr", "cameras.json", (*CAMERA, "Focal", 1), OF_CAMERA),
    ("perspective", "opendibr", "cameras.json", (*CAMERA, "Principle_point", 0), OF_CAMERA),
    ("perspective", "opendibr", "cameras.json", (*CAMERA, "Resolution", 0), OF_CAMERA),
    ("perspective", "opendibr", "cameras.json", (*CAMERA, "Depth_range", 0), OF_CAMERA),
    ("perspective", "opendibr", "cameras.json", (*CAMERA, "Depth_range", 1), OF_CAMERA),
    ("perspective", "opendibr", "cameras.json", (*CAMERA, "BitDepthDepth"), OF_CAMERA),
    ("perspective", "opendibr", "cameras.json", (*CAMERA, "BitDepthColor"), OF_CAMERA),
    ("perspective", "opendibr", "cameras.json", ("cameras", 0, "Position", 1), "cameras[0]"),
    ("perspective", "opendibr", "cameras.json", ("cameras", 0, "Focal", 0), "cameras[0]: Focal"),
    ("fisheye", "opendibr", "cameras.json", (*CAMERA, "Fov"), OF_CAMERA),
    ("views", "opendibr", "cameras.json", (*CAMERA, "Depth_range", 1), OF_CAMERA),
    ("half", "opendibr", "cameras.json", (*CAMERA, "Hor_range", 0), OF_CAMERA),
    ("panorama", "opendibr", "cameras.json", (*CAMERA, "Ver_range", 1), OF_CAMERA),
    ("perspective", "miv", "sequence.json", ("cameras", 3, "Position", 2), "view_0003f"),
    ("perspective", "miv", "sequence.json", ("cameras", 3, "Rotation", 0), "view_0003f"),
    ("perspective", "miv", "sequence.json", ("cameras", 3, "Focal", 0), "view_0003f"),
    ("perspective", "miv", "sequence.json", ("cameras", 3, "Principle_point", 1), "view_0003f"),
    ("perspective", "miv", "sequence.json", ("cameras", 3, "Resolution", 1), "view_0003f"),
    ("perspective", "miv", "sequence.json", ("cameras", 3, "Depth_range", 0), "view_0003f"),
    ("perspective", "miv", "sequence.json", ("cameras", 3, "BitDepthColor"), "view_0003f"),
    ("perspective", "miv", "sequence.json", ("Frames_number",), "view_0003f_depth"),
    ("perspective", "miv", "sequence.json", ("BoundingBox_center", 0), "BoundingBox_center"),
    ("half", "miv", "sequence.json", ("cameras", 3, "Hor_range", 1), "view_0003f"),
    ("half", "miv", "sequence.json", ("cameras", 3, "Ver_range", 0), "view_0003f"),
    ("half", "miv", "sequence.json", ("cameras", 3, "Depth_range", 1), "view_0003f"),
]


@pytest.mark.parametrize("place", [0, 2], ids=["first digit", "third digit"])
@pytest.mark.parametrize(("name", "kind", "file", "keys", "said"), IN_JSON)
def test_a_changed_digit_in_json_is_found(name, kind, file, keys, said, place, dataset):
    path = home(dataset, name) / (f"exports/{kind}/{file}" if file else "transforms.json")
    with changed(path, in_json(path, keys, place)):
        problem_lines = problems(dataset, name, kind)
    assert any(said in line for line in problem_lines), problem_lines
    shown = path.relative_to(dataset).as_posix().removesuffix(".json")
    assert all(shown in line or f"exports/{kind}/" in line for line in problem_lines)


NUMBER = r"(-?\d+\.\d+(?:e-\d+)?)"


def image_number(place):
    """Return the pattern of a number of the fourth image in images.txt: quaternion, translation."""
    return rf"^4 (?:\S+ ){{{place}}}{NUMBER} .*view_0003f"


def point_number(place):
    """Return the pattern of a number of the tenth point in points3D.txt."""
    return rf"^10 (?:\S+ ){{{place}}}(\S+)"


MODEL = "colmap/sparse/0"
# The same for texts. The number is the group of a pattern.
IN_TEXT = [
    *(
        (name, kind, f"{folder}/{file}", pattern, said)
        for name, kind, folder in (
            ("perspective", "colmap", MODEL),
            ("opencv", "colmap", MODEL),
            ("panorama", "colmap", MODEL),
            ("fisheye", "scannetpp", "scannetpp/colmap"),
        )
        for file, pattern, said in (
            *(("images.txt", image_number(k), "image 4 (view_0003f): its") for k in range(7)),
            *(("points3D.txt", point_number(axis), "point 10: ") for axis in range(3)),
            ("points3D.txt", point_number(6), "point 10: its error"),
            ("points3D.txt", point_number(7), "point 10: its track"),
            ("points3D.txt", point_number(8), "point 10: its track"),
            ("images.txt", rf"view_0003f.png\n{NUMBER} ", "view_0003f.png: POINTS2D 0: "),
            (
                "images.txt",
                rf"view_0003f.png\n(?:\S+ ){{4}}{NUMBER} ",
                "view_0003f.png: POINTS2D 1",
            ),
            ("images.txt", r"view_0003f.png\n\S+ \S+ (\d+) ", "point"),
            ("images.txt", r"^(4) .*view_0003f", "images.txt"),
            ("images.txt", r"^4 .* (1) view_0003f", "image 4: has no camera 4"),
            *(
                ("cameras.txt", rf"^1 \w+ \d+ \d+ (?:\S+ ){{{k}}}(\S+)", "camera 1")
                for k in range(2 if name == "panorama" else 4)
            ),
            ("cameras.txt", r"^1 \w+ (\d+)", "camera 1: its image has"),
            ("cameras.txt", r"^1 \w+ \d+ (\d+)", "camera 1: its image has"),
        )
    ),
    *(
        ("opencv", "colmap", f"{MODEL}/cameras.txt", rf"^1 (?:\S+ ){{{k}}}(\S+)", "camera 1")
        for k in range(7, 11)
    ),
    ("fisheye", "scannetpp", "scannetpp/colmap/cameras.txt", r"(0)\.0$", "camera 1"),
    *(
        ("perspective", "poses_csv", "poses_csv/poses.csv", pattern, "row 5 (view_0003f): its")
        for pattern in (rf"view_0003f(?:,[^,]+){{{k}}},{NUMBER}" for k in range(6))
    ),
    *(
        ("perspective", "hci", "hci/parameters.cfg", rf"{key} = (\S+)", said)
        for key, said in (
            ("focal_length_mm", "intrinsics: its camera"),
            ("sensor_size_mm", "intrinsics: its camera"),
            ("image_resolution_x_px", "intrinsics: its image has"),
            ("image_resolution_y_px", "intrinsics: its image has"),
            ("num_cams_x", "num_cams_x"),
            ("num_cams_y", "num_cams_x"),
            ("baseline_mm", "Cam000 (view_0000f): its position"),
            ("focus_distance_m", "focus_distance_m"),
            ("offset", "offset"),
            ("disp_min", "disp_min"),
            ("disp_max", "disp_max"),
            ("depth_map_scale", "depth_map_scale"),
            *((f"center_cam_{axis}_m", "(view_0003f): its position") for axis in "xyz"),
            *((f"center_cam_r{axis}_rad", "its rotation differs by") for axis in "xyz"),
        )
    ),
]


@pytest.mark.parametrize("place", [0, 2], ids=["first digit", "third digit"])
@pytest.mark.parametrize(("name", "kind", "file", "pattern", "said"), IN_TEXT)
def test_a_changed_digit_in_text_is_found(name, kind, file, pattern, said, place, dataset):
    path = home(dataset, name) / "exports" / file
    with changed(path, in_text(path, pattern, place)):
        problem_lines = problems(dataset, name, kind)
    assert any(said in line for line in problem_lines), problem_lines
    assert all(f"{name}/exports/{kind}/" in line for line in problem_lines)


def binary_places(folder):
    """Yield file, byte, type and message of numbers in the binary model of a folder."""
    for index in range(4):
        yield "cameras.bin", 32 + 8 * index, "d", "camera 1: its camera"
    yield "cameras.bin", 16, "Q", "camera 1: its image has"
    yield "cameras.bin", 12, "i", "its model is"
    for index in range(7):
        yield "images.bin", 12 + 8 * index, "d", "image 1 (view_0000f): its"
    content = (folder / "images.bin").read_bytes()
    first = content.index(b"\0", 8 + 4 + 56 + 4) + 9
    for place, kind in ((0, "d"), (8, "d"), (16, "Q"), (24, "d")):
        yield "images.bin", first + place, kind, "point"
    for index in range(3):
        yield "points3D.bin", 16 + 8 * index, "d", "point 1: "
    yield "points3D.bin", 43, "d", "point 1: its error"
    yield "points3D.bin", 59, "i", "point 1: its track"
    yield "points3D.bin", 63, "i", "point 1: its track"


@pytest.mark.parametrize("name", ["shifted", "fisheye"])
def test_a_changed_number_in_a_binary_model_is_found(name, dataset):
    folder = dataset / name / "exports" / MODEL
    for file, start, kind, said in binary_places(folder):
        content = bytearray((folder / file).read_bytes())
        (value,) = struct.unpack_from(f"<{kind}", content, start)
        struct.pack_into(
            f"<{kind}", content, start, 1.001 * value + 0.001 if kind == "d" else value + 1
        )
        with changed(folder / file, content):
            problem_lines = problems(dataset, name, "colmap")
        assert any(said in line for line in problem_lines), (file, start, problem_lines)
        assert all(f"{name}/exports/colmap/sparse/0/" in line for line in problem_lines)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("perspective", "nerfstudio"),
        ("wide", "nerfstudio"),
        ("panorama", "lichtfeld"),
        ("views", "point_cloud"),
    ],
)
def test_every_changed_coordinate_of_a_point_cloud_is_found(name, kind, dataset):
    path = home(dataset, name) / "exports" / kind / "points.ply"
    right = path.read_bytes()
    start = right.index(b"end_header\n") + len(b"end_header\n")
    size = 27
    count = (len(right) - start) // size
    content = bytearray(right)
    moved = [*range(0, count, 4)]
    for vertex in moved:
        place = start + size * vertex + 4 * (vertex % 3)
        (value,) = struct.unpack_from("<f", content, place)
        struct.pack_into("<f", content, place, value + 1e-4)
    with changed(path, content):
        problem_lines = problems(dataset, name, kind)
    expected = [
        f"points.ply: vertex {vertex}: is not a point of a view's depth" for vertex in moved
    ]
    shown = [line.split("exports/")[1].split("/", 1)[1].split(";")[0] for line in problem_lines]
    if len(moved) > 100:
        assert f": {len(moved)} points are" in problem_lines[-1]
        shown, expected = shown[:-1], expected[:100]
    assert shown == expected
    content = bytearray(right)
    (value,) = struct.unpack_from("<f", content, start + 12)
    struct.pack_into("<f", content, start + 12, value + 0.5)
    with changed(path, content):
        assert "vertex 0: its normal is not a unit vector" in problems(dataset, name, kind)[0]


@pytest.mark.parametrize(
    ("name", "kind", "file"),
    [
        ("perspective", "colmap", f"{MODEL}/images.txt"),
        ("perspective", "colmap", f"{MODEL}/points3D.txt"),
        ("fisheye", "colmap", f"{MODEL}/cameras.bin"),
        ("fisheye", "colmap", f"{MODEL}/images.bin"),
        ("fisheye", "colmap", f"{MODEL}/points3D.bin"),
        ("wide", "nerfstudio", "nerfstudio/transforms.json"),
        ("wide", "nerfstudio", "nerfstudio/points.ply"),
        ("perspective", "nerf_synthetic", "nerf_synthetic/transforms_val.json"),
        ("half", "opendibr", "opendibr/cameras.json"),
        ("half", "miv", "miv/sequence.json"),
        ("perspective", "hci", "hci/parameters.cfg"),
        ("perspective", "hci", "hci/gt_depth_lowres_Cam003.pfm"),
        ("perspective", "poses_csv", "poses_csv/poses.csv"),
        ("fisheye", "scannetpp", "scannetpp/train_test_lists.json"),
        ("half", "miv", "miv/export.json"),
        ("fisheye", "lichtfeld", "lichtfeld/transforms.json"),
        ("fisheye", "lichtfeld", "lichtfeld/points.ply"),
        ("wide", "ncore", "ncore/views.json"),
        ("wide", "ncore", "ncore/views.ncore4.zarr/.zmetadata.cbor.xz"),
        (
            "wide",
            "ncore",
            "ncore/views.ncore4.zarr/lidars/points/frames/0/ray_bundle/direction/0.0",
        ),
    ],
)
def test_a_file_that_its_consumer_cannot_open_is_named(name, kind, file, dataset, tmp_path):
    path = home(dataset, name) / "exports" / file
    right = path.read_bytes()
    for content in (b"", right[: len(right) // 2], b"\xff" * 64, b"{}", b"[1]"):
        path.write_bytes(content)
        try:
            problem_lines = problems(dataset, name, kind)
        finally:
            path.write_bytes(right)
        assert any(line.startswith(f"{name}/exports/{file}: ") for line in problem_lines), content[
            :9
        ]
    if path.name != "export.json":
        path.rename(tmp_path / "away")
        try:
            assert problems(dataset, name, kind)
        finally:
            (tmp_path / "away").rename(path)


@pytest.mark.parametrize(
    ("name", "kind", "file", "keys", "said"),
    [
        ("wide", "nerfstudio", "transforms.json", FRAME, "transforms.json: frames[3]: "),
        ("split", "nerfstudio", "transforms.json", (*FRAME, 1, 1), "transforms.json: frames[3]: "),
        ("half", "opendibr", "cameras.json", (*CAMERA, "Position"), "cameras.json: cameras[4]: "),
        ("half", "miv", "sequence.json", (*CAMERA, "Rotation"), "sequence.json: cameras[4]: "),
    ],
)
def test_a_view_with_missing_numbers_is_named(name, kind, file, keys, said, dataset):
    path = home(dataset, name) / "exports" / kind / file
    right = path.read_bytes()
    content = json.loads(right)
    *parents, last = keys
    parent = content
    for key in parents:
        parent = parent[key]
    for value in ([1, 2], None, "many", float("nan")):
        parent[last] = value
        path.write_text(json.dumps(content))
        try:
            problem_lines = problems(dataset, name, kind)
        finally:
            path.write_bytes(right)
        assert any(said in line for line in problem_lines), problem_lines


@pytest.mark.parametrize("value", ["nan", "1e999", "a few"])
@pytest.mark.parametrize("key", ["focal_length_mm", "baseline_mm", "center_cam_rx_rad", "disp_max"])
def test_parameters_that_are_not_numbers_are_named(key, value, dataset):
    path = dataset / "perspective" / "exports" / "hci" / "parameters.cfg"
    right = path.read_text()
    path.write_text(re.sub(rf"{key} = .*", f"{key} = {value}", right))
    try:
        problem_lines = problems(dataset, "perspective", "hci")
    finally:
        path.write_text(right)
    assert f"parameters.cfg: {key}: " in problem_lines[0]


@pytest.mark.parametrize(
    ("name", "kind", "file"),
    [
        ("perspective", "instant_ngp", "transforms.json"),
        ("perspective", "nerfstudio", "transforms.json"),
        ("fisheye", "lichtfeld", "transforms.json"),
        ("perspective", "poses_csv", "poses.csv"),
    ],
)
def test_an_export_without_views_is_named(name, kind, file, dataset):
    path = home(dataset, name) / ("" if kind == "instant_ngp" else f"exports/{kind}") / file
    right = path.read_bytes()
    if path.suffix == ".csv":
        path.write_bytes(right.partition(b"\n")[0] + b"\n")
    else:
        write_json(path, read_json(path) | {"frames": []})
    try:
        assert any(
            f"this export for {kind} has no view" in line for line in problems(dataset, name, kind)
        )
    finally:
        path.write_bytes(right)


@pytest.mark.parametrize(
    ("name", "kind", "file", "old", "new", "said"),
    [
        ("perspective", "instant_ngp", "", "view_0003f.exr", "view_0002f.exr", "lacks view_0003f"),
        ("perspective", "instant_ngp", "", "view_0003f.exr", "view_9003f.exr", "has view_9003f"),
        ("perspective", "instant_ngp", "", "th/view_0003f", "th/view_0002f", "depth_path"),
        ("split", "instant_ngp", "_test", "view_0001f.exr", "view_0002f.exr", "lacks view_0001f"),
        (
            "split",
            "nerfstudio",
            "transforms.json",
            '_filenames": [\n  "images/view_0000f',
            '_filenames": [\n  "images/view_0002f',
            "train_filenames: lacks view_0000f",
        ),
        (
            "perspective",
            "nerfstudio",
            "transforms.json",
            "depths/view_0003f",
            "depths/view_0002f",
            "frames[3]: depth_file_path",
        ),
        ("split", "colmap", f"{MODEL}/test.txt", "view_0001f", "view_0002f", "test.txt: lacks"),
        (
            "fisheye",
            "scannetpp",
            "scannetpp/train_test_lists.json",
            '"has_masks": true',
            '"has_masks": null',
            "has_masks",
        ),
        (
            "perspective",
            "opendibr",
            "cameras.json",
            "view_0003f_depth",
            "view_0002f_depth",
            "cameras[4]: NameDepth",
        ),
        ("split", "lichtfeld", "test.txt", "view_0001f", "view_0002f", "test.txt: lacks"),
        ("perspective", "miv", "sequence.json", '  "view_0003f"', '  "view_0002f"', "sourceCamera"),
        ("perspective", "opendibr", "cameras.json", "OPENGL", "COLMAP", "Axial_system"),
        (
            "wide",
            "nerfstudio",
            "transforms.json",
            "OPENCV_FISHEYE",
            "OPENCV_FISHEYA",
            "camera_model",
        ),
    ],
)
def test_a_changed_name_is_found(name, kind, file, old, new, said, dataset):
    if kind == "instant_ngp":
        path = dataset / name / f"transforms{file}.json"
    else:
        path = home(dataset, name) / "exports" / (file if "/" in file else f"{kind}/{file}")
    text = path.read_text()
    assert old in text
    with changed(path, text.replace(old, new, 1).encode()):
        problem_lines = problems(dataset, name, kind)
    assert any(said in line for line in problem_lines), problem_lines


NCORE = "ncore/views.ncore4.zarr"
NCORE_LENS = f"{NCORE}/intrinsics/default/cameras/camera/.zattrs"
NCORE_POSES = f"{NCORE}/poses/default/dynamic_poses/.zattrs"
NCORE_TRAJECTORY = "('camera', 'world')"


@contextmanager
def consolidated(folder):
    """Write a store's compressed metadata anew for a while, from its other files."""
    summary = folder / zarr_store.METADATA
    right = summary.read_bytes()
    files = [file for file in folder.rglob(".z*") if file != summary]
    metadata = {file.relative_to(folder).as_posix(): read_json(file) for file in files}
    summary.write_bytes(zarr_store.consolidated(metadata))
    try:
        yield
    finally:
        summary.write_bytes(right)


@pytest.mark.parametrize("place", [0, 2], ids=["first digit", "third digit"])
@pytest.mark.parametrize(
    ("name", "file", "keys", "said"),
    [
        *(
            ("wide", NCORE_LENS, ("camera_model_parameters", *keys), said)
            for keys, said in (
                (("angle_to_pixeldist_poly", 1), "its camera"),
                (("angle_to_pixeldist_poly", 3), "its camera"),
                (("pixeldist_to_angle_poly", 1), "pixeldist_to_angle_poly"),
                (("max_angle",), "max_angle"),
                (("principal_point", 0), "its camera"),
                (("linear_cde", 0), "its camera"),
                (("linear_cde", 1), "its camera"),
                (("linear_cde", 2), "its camera"),
                (("resolution", 1), "its image has"),
            )
        ),
        *(
            ("perspective", NCORE_LENS, ("camera_model_parameters", *keys), said)
            for keys, said in (
                (("focal_length", 0), "its camera"),
                (("focal_length", 1), "its camera"),
                (("principal_point", 1), "its camera"),
                (("radial_coeffs", 5), "radial_coeffs"),
                (("tangential_coeffs", 0), "tangential_coeffs"),
                (("thin_prism_coeffs", 2), "thin_prism_coeffs"),
                (("resolution", 0), "its image has"),
            )
        ),
        *(
            ("wide", NCORE_POSES, (NCORE_TRAJECTORY, *keys), said)
            for keys, said in (
                (("poses", 3, 0, 3), "poses[3] (view_0003f): its position"),
                (("poses", 3, 1, 2), "poses[3] (view_0003f): its rotation"),
                (("poses", 3, 3, 0), "poses[3] (view_0003f): the last row"),
                (("timestamps_us", 2), "times"),
            )
        ),
        (
            "wide",
            f"{NCORE}/poses/default/static_poses/.zattrs",
            ("('points', 'world')", "pose", 2, 3),
            "is not a point of a view's depth",
        ),
        (
            "wide",
            f"{NCORE}/cameras/camera/frames/.zattrs",
            ("frames_timestamps_us", 4, 0),
            "times",
        ),
    ],
)
def test_a_changed_digit_of_an_ncore_store_is_found(name, file, keys, said, place, dataset):
    path = dataset / name / "exports" / file
    content = in_json(path, keys, place)
    with changed(path, content), consolidated(dataset / name / "exports" / NCORE):
        problem_lines = problems(dataset, name, "ncore")
    assert any(said in line for line in problem_lines), problem_lines
    assert all(f"{name}/exports/ncore/" in line for line in problem_lines)
    with changed(path, content):
        problem_lines = problems(dataset, name, "ncore")
    assert any("differs from .zmetadata.cbor.xz" in line for line in problem_lines)


@pytest.fixture(scope="module")
def moving(tmp_path_factory):
    """Return a dataset of a moving camera with a rolling shutter, and its export for NCore."""
    folder = tmp_path_factory.mktemp("moving") / "dataset"
    write_views(folder, LENSES["wide"], {"type": "plane", "cameras": [2, 1], "size": 0.4})
    path = folder / "lightfield.json"
    motion = {"travel": [0.2, 0, 0], "turn": [0, 20, 0], "rolling": 0.2}
    LightField.read(path).changed(render={"camera_motion": motion}).with_exposure().write(path)
    settings = settings_of("ncore").model_validate({"sources": ["views"], "points": 50})
    export.run("ncore", SourceDataset(folder, "", ".exr"), settings, folder / "exports/ncore")
    return folder


@pytest.mark.parametrize(
    ("file", "keys", "said"),
    [
        (None, (), None),
        (NCORE_POSES, (NCORE_TRAJECTORY, "poses", 0, 0, 3), "at the start of the exposure"),
        (NCORE_POSES, (NCORE_TRAJECTORY, "poses", 4, 0, 3), "at the end of the exposure"),
        (NCORE_POSES, (NCORE_TRAJECTORY, "poses", 2, 0, 3), "its position"),
        (NCORE_POSES, (NCORE_TRAJECTORY, "poses", 1, 0, 3), "poses[1] (view_0000f): is"),
        (f"{NCORE}/cameras/camera/frames/.zattrs", ("frames_timestamps_us", 0, 0), "times"),
    ],
)
def test_a_changed_digit_of_a_moving_camera_is_found(file, keys, said, moving):
    if file is None:
        assert problems(moving, "views", "ncore") == []
        return
    path = moving / "exports" / file
    with changed(path, in_json(path, keys, 0)), consolidated(moving / "exports" / NCORE):
        problem_lines = problems(moving, "views", "ncore")
    assert any(said in line for line in problem_lines), problem_lines


@pytest.mark.parametrize(("array", "item"), [("_returns/distance_m", 5), ("/direction", 7)])
def test_a_changed_point_of_an_ncore_store_is_found(array, item, dataset):
    folder = dataset / "wide/exports" / NCORE / f"lidars/points/frames/0/ray_bundle{array}"
    path = folder / "0.0"
    right = path.read_bytes()
    values = np.frombuffer(zlib.decompress(right), "<f4").copy()
    values[item] += 1e-4
    path.write_bytes(zlib.compress(values.tobytes()))
    try:
        problem_lines = problems(dataset, "wide", "ncore")
    finally:
        path.write_bytes(right)
    point = item if array.endswith("distance_m") else item // 3
    assert any(f"point {point}: " in line for line in problem_lines), problem_lines


def test_points_are_found_in_any_order(dataset):
    path = dataset / "exports" / "point_cloud" / "points.ply"
    head, end, body = path.read_bytes().partition(b"end_header\n")
    vertices = np.frombuffer(body, "V27")
    order = np.random.default_rng(1).permutation(len(vertices))
    with changed(path, head + end + vertices[order].tobytes()):
        assert problems(dataset, "views", "point_cloud") == []


def test_without_a_split_a_parts_list_has_all_views(tmp_path):
    folder = tmp_path / "dataset"
    write_views(folder, LENSES["perspective"], RIG, see=look_at_ball)
    write_instant_ngp(folder, "views", [])
    (folder / "transforms.json").rename(folder / "transforms_test.json")
    assert problems(folder, "views", "instant_ngp") == []


# Exports that hold the views of other rigs, too.
OF_RIGS = ("colmap", "nerfstudio", "nerf_synthetic", "lichtfeld", "ncore")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A scene of a rig to train on, exported with a rig that tests it."""
    folder = tmp_path_factory.mktemp("rigs") / "scene"
    for name, split in (("around", "train"), ("along", "test")):
        rig = RIG | {"split": split, "center": [0.1 * len(name), 0, 0]}
        write_views(folder / name / "dataset", LENSES["perspective"], rig, see=look_at_ball)
        for path in (folder / name / "dataset").iterdir():
            path.rename(folder / name / path.name)
        (folder / name / "dataset").rmdir()
    beside = {"along": folder / "along"}
    for kind in OF_RIGS:
        options = {} if kind == "nerf_synthetic" else {"points": 60}
        write_export(folder / "around", "views", kind, options, beside)
    write_instant_ngp(folder / "around", "views", [])
    trained = folder / "around" / "transforms.json"
    write_instant_ngp(folder / "along", "views", ["--placed-as", str(trained)])
    lightfields = {n: LightField.read(folder / n / "lightfield.json") for n in ("around", "along")}
    write_json(folder / "splits.json", splits_content(lightfields))
    return folder


def test_views_of_a_rig_that_tests_are_compared_with_its_own_lightfield(scene):
    for rig in ("around", "along"):
        for kind in (*OF_RIGS, "instant_ngp"):
            if rig == "around" or kind == "instant_ngp":
                assert problems(scene / rig, "views", kind) == []
    path = scene / "around" / "exports" / "nerf_synthetic" / "transforms_test.json"
    keys = ("frames", 2, "transform_matrix", 1, 3)
    with changed(path, in_json(path, keys, 2)):
        problem_lines = problems(scene / "around", "views", "nerf_synthetic")
    assert "transforms_test.json: frames[2] (along_view_0002f): its position" in problem_lines[0]
    path = scene / "along" / "transforms.json"
    for keys in (("scale",), ("offset", 1)):
        with changed(path, in_json(path, keys, 2)):
            assert "scale, offset" in problems(scene / "along", "views", "instant_ngp")[0]


def test_views_of_rigs_with_splits_of_their_own_are_not_expected(tmp_path):
    for name in ("near", "far"):
        write_views(tmp_path / "dataset", LENSES["perspective"], RIG | {"split": "odd"})
        (tmp_path / "dataset").rename(tmp_path / name)
    for kind in ("nerfstudio", "nerf_synthetic"):
        write_export(tmp_path / "near", "views", kind, {})
    lightfields = {n: LightField.read(tmp_path / n / "lightfield.json") for n in ("near", "far")}
    write_json(tmp_path / "splits.json", splits_content(lightfields))
    for kind in ("nerfstudio", "nerf_synthetic"):
        assert problems(tmp_path / "near", "views", kind) == []


@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_a_rig_of_another_size_in_the_middle_of_the_unit_cube_is_found(factor, tmp_path):
    folder = tmp_path / "dataset"
    write_views(folder, LENSES["perspective"], RIG, see=look_at_ball)
    write_instant_ngp(folder, "views", [])
    content = read_json(folder / "transforms.json")
    content["scale"] *= factor
    content["offset"] = [0.5 - factor * (0.5 - value) for value in content["offset"]]
    write_json(folder / "transforms.json", content)
    assert "scale, offset" in problems(folder, "views", "instant_ngp")[0]


def test_a_rig_that_looks_inward_fills_the_unit_cube(tmp_path):
    rig = {"type": "sphere", "subdivisions": 1, "size": 1.7, "face_inside": True}
    write_views(tmp_path / "dataset", LENSES["perspective"], rig, see=look_at_ball)
    write_instant_ngp(tmp_path / "dataset", "views", [])
    assert problems(tmp_path / "dataset", "views", "instant_ngp") == []
    path = tmp_path / "dataset" / "transforms.json"
    for keys in (("scale",), ("offset", 1)):
        with changed(path, in_json(path, keys, 2)):
            assert "scale, offset" in problems(tmp_path / "dataset", "views", "instant_ngp")[0]


def test_a_lightfield_may_have_a_pose_in_two_roundings(tmp_path):
    folder = tmp_path / "dataset"
    write_views(folder, LENSES["perspective"], RIG, see=look_at_ball)
    content = read_json(folder / "lightfield.json")
    for frame in content["frames"]:
        frame["position"] = [round(value, 6) for value in frame["position"]]
        frame["rotation"] = [round(value, 6) for value in frame["rotation"]]
    write_json(folder / "lightfield.json", content)
    # One export follows from the angles, the other from the matrices.
    write_instant_ngp(folder, "views", [])
    write_export(folder, "views", "nerfstudio", {"points": 60})
    for kind in ("instant_ngp", "nerfstudio"):
        assert problems(folder, "views", kind) == []


# ---- pictures -------------------------------------------------------------------------------


def each_pixel(change):
    """Return a change of a PNG's pixels."""

    def changed_png(path):
        channels = images.read_image(path).channels
        pixels = np.stack([*channels.values()], axis=-1)
        images.write_png(path, np.ascontiguousarray(change(pixels)).astype(pixels.dtype))

    return changed_png


def each_float(change):
    """Return a change of the numbers after a header."""

    def changed_floats(path):
        content = path.read_bytes()
        size = 4 * 64 * 48
        numbers = change(np.frombuffer(content[-size:], "<f4").reshape(48, 64))
        path.write_bytes(content[:-size] + np.ascontiguousarray(numbers, "<f4").tobytes())

    return changed_floats


def neighbours(path):
    """Put the picture of the next view in the place of this one."""
    path.write_bytes(sorted(path.parent.glob(f"*{path.suffix}"))[5].read_bytes())


VIEW = "view_0003f"
MIRRORED = each_pixel(np.fliplr)
SHIFTED = each_pixel(lambda pixels: np.roll(pixels, 1, axis=1))
INVERTED = each_pixel(lambda pixels: 255 - pixels)
OTHER_CHANNELS = each_pixel(lambda pixels: pixels[..., ::-1])
DARKER = each_pixel(lambda pixels: pixels - (pixels > 1) * 2)
DOUBLED = each_pixel(lambda pixels: 2 * pixels)
SCALED = each_pixel(lambda pixels: np.rint(pixels * 1.02))
# The set, the export, a picture, and what is wrong with it.
WRONG_PICTURES = [
    ("perspective", "colmap", f"images/{VIEW}.png", MIRRORED, "colour"),
    ("perspective", "colmap", f"images/{VIEW}.png", OTHER_CHANNELS, "colour"),
    ("perspective", "colmap", f"images/{VIEW}.png", DARKER, "colour"),
    (
        "perspective",
        "colmap",
        f"stereo/depth_maps/{VIEW}.png.geometric.bin",
        each_float(lambda depth: 1.02 * depth),
        "depth",
    ),
    (
        "perspective",
        "colmap",
        f"stereo/depth_maps/{VIEW}.png.geometric.bin",
        each_float(np.flipud),
        "depth",
    ),
    ("fisheye", "colmap", f"masks/{VIEW}.png.png", INVERTED, "mask"),
    ("fisheye", "colmap", f"masks/{VIEW}.png.png", SHIFTED, "mask"),
    ("panorama", "nerfstudio", f"images/{VIEW}.png", SHIFTED, "colour"),
    ("perspective", "nerfstudio", f"images/{VIEW}.png", neighbours, "colour"),
    ("perspective", "nerfstudio", f"depths/{VIEW}.png", neighbours, "depth"),
    ("perspective", "nerfstudio", f"depths/{VIEW}.png", DOUBLED, "depth"),
    ("perspective", "nerfstudio", f"depths/{VIEW}.png", SCALED, "depth"),
    ("wide", "nerfstudio", f"masks/{VIEW}.png", INVERTED, "mask"),
    ("perspective", "nerf_synthetic", f"train/{VIEW}.png", MIRRORED, "colour"),
    ("perspective", "opendibr", f"{VIEW}_texture.png", SHIFTED, "colour"),
    ("perspective", "opendibr", f"{VIEW}_depth.png", SCALED, "depth"),
    ("fisheye", "opendibr", f"{VIEW}_depth.png", MIRRORED, "depth"),
    ("perspective", "hci", "input_Cam003.png", MIRRORED, "colour"),
    ("perspective", "hci", "gt_depth_lowres_Cam003.pfm", each_float(np.flipud), "depth"),
    ("perspective", "hci", "gt_disp_lowres_Cam003.pfm", each_float(lambda d: -d), "depth"),
    ("perspective", "hci", "gt_disp_lowres.pfm", each_float(np.flipud), "depth"),
    ("fisheye", "lichtfeld", f"images/{VIEW}.png", OTHER_CHANNELS, "colour"),
    ("fisheye", "lichtfeld", f"masks/{VIEW}.png", INVERTED, "mask"),
    ("fisheye", "lichtfeld", f"depth/{VIEW}.png", MIRRORED, "depth"),
    ("fisheye", "scannetpp", f"image_undistorted_fisheye/{VIEW}.png", MIRRORED, "colour"),
    ("fisheye", "scannetpp", f"image_undistorted_fisheye/{VIEW}_mask.png", INVERTED, "mask"),
    ("perspective", "instant_ngp", f"instant_ngp/depth/{VIEW}.png", neighbours, "depth"),
    ("perspective", "miv", f"{VIEW}_texture_64x48_yuv420p10le.yuv", neighbours, "luma"),
    ("perspective", "miv", f"{VIEW}_depth_64x48_yuv420p16le.yuv", neighbours, "depth"),
]


@pytest.mark.parametrize(("name", "kind", "file", "change", "what"), WRONG_PICTURES)
def test_a_picture_that_does_not_show_its_view_is_named(name, kind, file, change, what, dataset):
    path = home(dataset, name) / ("" if kind == "instant_ngp" else f"exports/{kind}") / file
    right = path.read_bytes()
    assert picture_problems(dataset, name, kind) == []
    change(path)
    try:
        (problem,) = picture_problems(dataset, name, kind)
    finally:
        path.write_bytes(right)
    assert problem.startswith(f"{path.relative_to(dataset)}: has another {what} than its view in ")


@pytest.mark.parametrize(
    ("kind", "file"),
    [
        ("colmap", f"masks/{VIEW}.png.png"),
        ("lichtfeld", f"masks/{VIEW}.png"),
        ("scannetpp", f"image_undistorted_fisheye/{VIEW}_mask.png"),
    ],
)
def test_a_mask_that_is_missing_is_named(kind, file, dataset):
    path = dataset / "fisheye" / "exports" / kind / file
    right = path.read_bytes()
    path.unlink()
    try:
        (problem,) = picture_problems(dataset, "fisheye", kind)
    finally:
        path.write_bytes(right)
    assert problem.startswith(f"{path.relative_to(dataset)}: has no mask, but ")


def test_a_missing_list_of_a_part_is_named(dataset):
    path = dataset / "split" / "transforms_test.json"
    right = path.read_bytes()
    path.unlink()
    try:
        (problem,) = problems(dataset, "split", "instant_ngp")
    finally:
        path.write_bytes(right)
    assert problem.startswith("split/transforms_test.json: is missing, but ")


def test_depth_is_compared_where_a_set_has_its_views_as_png_too(dataset, tmp_path):
    folder = tmp_path / "scene" / "dataset"
    shutil.copytree(dataset / "exr", folder / "exr")
    shutil.copyfile(dataset / "lightfield.json", folder / "lightfield.json")
    shutil.copytree(dataset / "perspective", folder / "perspective")
    for view in LightField.read(folder / "perspective/lightfield.json").views:
        picture = folder / "perspective/exports/colmap/images" / f"{view.name}.png"
        shutil.copyfile(picture, folder / "perspective" / f"{view.name}.png")
    assert picture_problems(folder, "perspective", "nerfstudio") == []
    DOUBLED(folder / "perspective/exports/nerfstudio/depths" / f"{VIEW}.png")
    assert len(picture_problems(folder, "perspective", "nerfstudio")) == 1


@pytest.mark.parametrize(
    "kind", ["colmap", "nerfstudio", "nerf_synthetic", "opendibr", "miv", "lichtfeld", "hci"]
)
@pytest.mark.parametrize("transparent", [False, True])
def test_developed_and_transparent_pictures_show_their_views(transparent, kind, tmp_path):
    folder = tmp_path / "scene" / "dataset"
    write_views(folder, VIEWS, RIG, see=look_at_ball)
    write_views(folder / "flat", LENSES["perspective"], RIG, see=look_at_ball)
    lightfield = LightField.read(folder / "flat/lightfield.json")
    if transparent:
        lightfield = lightfield.changed(render={"transparent": True})
        lightfield.write(folder / "flat/lightfield.json")
    rng = np.random.default_rng(0)
    for view in lightfield.views:
        path = folder / "flat" / f"{view.name}.exr"
        channels = dict(images.read_image(path).channels)
        alpha = np.clip(1.5 * rng.random((48, 64)) - 0.25, 0, 1).astype(np.float16)
        for name in "RGB":
            light = channels[name] * 2.0 ** rng.integers(-12, 9, (48, 64))
            channels[name] = (light * (alpha if transparent else 1)).astype(np.float16)
        if transparent:
            channels["A"] = alpha
        images.write_exr(path, channels, {images.DEPTH_ATTRIBUTE: lightfield.depth})
    options = {"exposure": -2.5, "reinhard": 3}
    settings = TypeAdapter(settings_of(kind)).validate_python({"sources": ["flat"], **options})
    source = SourceDataset(folder, "flat", ".exr", **options)
    export.run(kind, source, settings, folder / "flat" / "exports" / kind)
    assert picture_problems(folder, "flat", kind) == []


# ---- boxes ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def boxed(tmp_path_factory):
    """Three views with a pass of two objects each, and their boxes."""
    folder = tmp_path_factory.mktemp("boxed") / "scene" / "dataset"
    write_views(folder, LENSES["perspective"], {"type": "lattice", "cameras": [3, 1, 1], "size": 1})
    lightfield = LightField.read(folder / "lightfield.json").changed(passes=["object"])
    lightfield.write(folder / "lightfield.json")
    for index, view in enumerate(lightfield.views):
        numbers = np.ones((48, 64), np.uint32)
        numbers[10 : 20 + index, 30:35] = 2
        images.write_exr(folder / "object" / f"{view.name}.exr", {"Y": numbers})
    write_json(folder / "object" / "names.json", {"Wall": 1, "Ball": 2})
    write_export(folder, "views", "coco", {})
    return folder


def swap_images(content):
    first, second, _ = content["images"]
    first["file_name"], second["file_name"] = second["file_name"], first["file_name"]


WRONG_BOXES = {
    "two images swapped": (swap_images, "is not the box of its object"),
    "last image missing": (lambda content: content["images"].pop(), "view_0002f 0 times"),
    "an image twice": (
        lambda content: content["images"].append(content["images"][0] | {"id": 9}),
        "view_0000f 2 times",
    ),
    "a box missing": (lambda content: content["annotations"].pop(), "lacks 1"),
    "a box twice": (
        lambda content: content["annotations"].append(content["annotations"][-1] | {"id": 99}),
        "has 3 boxes of 2 objects",
    ),
    "a pixel wider": (
        lambda content: content["annotations"][1]["bbox"].__setitem__(2, 6),
        "annotations: 2: is not the box of its object",
    ),
    "rows for columns": (
        lambda content: content["annotations"][1].update(bbox=[10, 30, 10, 5]),
        "annotations: 2: is not the box of its object",
    ),
    "another object": (
        lambda content: content["annotations"][1].update(category_id=1),
        "annotations: 2: is not the box of its object",
    ),
    "another area": (
        lambda content: content["annotations"][1].update(area=49),
        "annotations: 2: is not the box of its object",
    ),
}


@pytest.mark.parametrize("case", WRONG_BOXES)
def test_boxes_that_the_passes_do_not_show_are_named(case, boxed):
    assert problems(boxed, "views", "coco") == []
    path = boxed / "exports/coco/instances.json"
    right = path.read_bytes()
    content = read_json(path)
    change, said = WRONG_BOXES[case]
    change(content)
    write_json(path, content)
    try:
        assert any(said in problem for problem in problems(boxed, "views", "coco"))
    finally:
        path.write_bytes(right)
