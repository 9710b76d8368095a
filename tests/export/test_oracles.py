"""The oracles agree with every export, and name what is wrong in ten spoilt ones.

The scene is a ball in a sphere. It has every export that this project writes.
"""

import functools
import re
import shutil
import struct

import numpy as np
import oracles
import pytest
from oracles import exported_cameras, exported_depth, exported_pictures
from pydantic import TypeAdapter
from sphere import CALIBRATED, LENSES, look_at_ball, write_views

from lightfield.core.files import read_json, write_json
from lightfield.engine.flags import parsed
from lightfield.export.source import SourceDataset
from lightfield.exporters import EXPORTERS
from lightfield.exporters.instant_ngp import TransformsByHand
from lightfield.formats.lightfield import LightField
from lightfield.formats.splits_file import splits_content
from lightfield.imaging import images
from lightfield.products import exports
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
    "left": LENSES["left"],
    "split": LENSES["perspective"],
    "distorted": CALIBRATED["OPENCV"],
    "aria": CALIBRATED["RAD_TAN_THIN_PRISM_FISHEYE"],
}
# The exports of each set; "views" are the rendered ones.
EXPORTS = {
    "views": {"opendibr": {}, "point_cloud": {"voxel": 0.1}, "splat": {"gaussians": 500}},
    "perspective": {
        "colmap": {"format": "text", "points": 60, "depth": True},
        "nerfstudio": {"points": 60, "depth": True},
        "nerf_synthetic": {},
        "nerfbaselines": {"points": 60},
        "opendibr": {},
        "miv": {},
        "hci": {},
        "focal_stack": {"distances": [2, 3]},
        "quilt": {"focus": 3, "tiles": [2, 2], "aspect": 0.75},
        "epipolar_volumes": {"depth": True},
        "lichtfeld": {"points": 60, "depth": True, "format": "exr"},
        "ncore": {"points": 60},
        "poses_csv": {},
        "wai": {},
        "dust3r": {},
    },
    "shifted": {
        "colmap": {"points": 60},
        "nerfstudio": {"points": 60},
        "opendibr": {},
        "miv": {},
        "focal_stack": {"format": "exr", "aperture": 0.4},
        "quilt": {"focus": 3, "row": 1},
        "wai": {},
        "dust3r": {"overlap": 0.5},
    },
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
    "distorted": {
        "colmap": {"format": "text", "points": 60, "depth": True},
        "nerfstudio": {"points": 60, "depth": True},
        "ncore": {"points": 60},
        "nerfbaselines": {"points": 60},
    },
    "aria": {"colmap": {"points": 60}, "nerfstudio": {"points": 60, "depth": True}},
    "half": {"opendibr": {}, "miv": {}},
    "left": {"opendibr": {}, "miv": {}},
    "split": {
        "colmap": {"format": "text", "points": 60},
        "lichtfeld": {"points": 60},
        "nerfbaselines": {"points": 60},
        "nerf_synthetic": {"scale": 0.7},
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
    "distorted": [],
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
    settings = TypeAdapter(EXPORTERS[kind]).validate_python({"sources": [name], **options})
    source = SourceDataset(folder, "" if name == "views" else name, ".exr", beside or {})
    exports.run(source, settings, home(folder, name) / "exports" / kind)


def write_instant_ngp(folder, name, arguments):
    folder_of_set = home(folder, name)
    images = folder / "exr" if folder_of_set == folder else folder_of_set
    files = ["--input-cfg", folder_of_set / "lightfield.json"]
    files += ["--output", folder_of_set / "transforms.json"]
    files += ["--image-suffix", ".exr", "--image-dir", images]
    files += ["--depth-dir", folder_of_set / "instant_ngp" / "depth"]
    parsed(TransformsByHand, None, [*map(str, files), *arguments]).run()


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
    lines, exported = exported_cameras.check(folder, sets, lists)
    lines += exported_depth.faults(folder, sets, exported)
    return [line.replace(f"{folder}/", "") for line in lines]


def picture_problems(folder, name, kind):
    """Return what is wrong with the pictures of one export."""
    sets, lists = sets_and_lists(folder, name, kind)
    _, exported = exported_cameras.check(folder, sets, lists)
    lines = exported_pictures.faults(folder, sets, exported)
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


def digit_of(pattern):
    """Return a change of the first digit of the number that the pattern's group finds."""

    def change(path):
        text = path.read_text()
        match = re.search(pattern, text, re.M)
        start = match.start(1) + re.search(r"[1-9]", match[1]).start()
        path.write_text(f"{text[:start]}{(int(text[start]) + 3) % 10}{text[start + 1 :]}")

    return change


def key_of(*keys):
    """Return a change of the number at these keys of a JSON."""

    def change(path):
        content = read_json(path)
        *parents, last = keys
        parent = functools.reduce(lambda value, key: value[key], parents, content)
        parent[last] = 1.1 * parent[last] + 1
        write_json(path, content)

    return change


def pixels_of(change):
    """Return a change of a PNG's pixels."""

    def changed_png(path):
        pixels = np.stack([*images.read_image(path).channels.values()], axis=-1)
        images.write_png(path, np.ascontiguousarray(change(pixels)).astype(pixels.dtype))

    return changed_png


def move_a_point(path):
    content = bytearray(path.read_bytes())
    place = content.index(b"end_header\n") + len(b"end_header\n")
    (x,) = struct.unpack_from("<f", content, place)
    struct.pack_into("<f", content, place, x + 1e-4)
    path.write_bytes(content)


FRAME = ("frames", 3, "transform_matrix")
# The set, the export, a file of it, how it is spoilt, and what the oracles say of it.
SPOILT = {
    "pose": ("perspective", "nerfstudio", "transforms.json", key_of(*FRAME, 0, 3), "its position"),
    "lens": ("wide", "nerfstudio", "transforms.json", key_of("k1"), "its camera"),
    "range": (
        "left",
        "opendibr",
        "cameras.json",
        lambda path: write_json(path, reversed_range(read_json(path))),
        "cameras[4] (view_0003f)",
    ),
    "disparity": (
        "perspective",
        "hci",
        "parameters.cfg",
        digit_of(r"disp_min = (\S+)"),
        "disp_min",
    ),
    "quaternion": (
        "fisheye",
        "scannetpp",
        "colmap/images.txt",
        digit_of(r"^4 (\S+) .*view_0003f"),
        "image 4 (view_0003f): its",
    ),
    "half a file": (
        "wide",
        "ncore",
        "views.ncore4.zarr/.zmetadata.cbor.xz",
        lambda path: path.write_bytes(path.read_bytes()[:99]),
        "views.ncore4.zarr",
    ),
    "point": ("wide", "nerfstudio", "points.ply", move_a_point, "vertex 0: is not a point"),
    "picture": (
        "perspective",
        "colmap",
        "images/view_0003f.png",
        pixels_of(np.fliplr),
        "has another colour than its view",
    ),
    "depth": (
        "fisheye",
        "lichtfeld",
        "depth/view_0003f.png",
        pixels_of(lambda depth: np.rint(depth * 1.02)),
        "has another depth than its view",
    ),
    "mask": (
        "fisheye",
        "colmap",
        "masks/view_0003f.png.png",
        pixels_of(lambda mask: 255 - mask),
        "has another mask than its view",
    ),
}


def reversed_range(content):
    content["cameras"][4]["Hor_range"] = [-x for x in content["cameras"][4]["Hor_range"][::-1]]
    return content


@pytest.mark.parametrize("case", SPOILT)
def test_a_spoilt_export_is_named(case, dataset):
    name, kind, file, change, said = SPOILT[case]
    path = home(dataset, name) / "exports" / kind / file
    right = path.read_bytes()
    change(path)
    try:
        lines = [*problems(dataset, name, kind), *picture_problems(dataset, name, kind)]
    finally:
        path.write_bytes(right)
    assert any(said in line for line in lines), lines
    assert all(f"{name}/exports/{kind}/" in line for line in lines)


@pytest.fixture(scope="module")
def moving(tmp_path_factory):
    """Return a dataset of a moving camera with a rolling shutter, and its export for NCore."""
    folder = tmp_path_factory.mktemp("moving") / "dataset"
    write_views(folder, LENSES["wide"], {"type": "plane", "cameras": [2, 1], "size": 0.4})
    path = folder / "lightfield.json"
    motion = {"travel": [0.2, 0, 0], "turn": [0, 20, 0], "rolling": 0.2}
    LightField.read(path).changed(render={"camera_motion": motion}).with_exposure().write(path)
    settings = EXPORTERS["ncore"].model_validate({"sources": ["views"], "points": 50})
    exports.run(SourceDataset(folder, "", ".exr"), settings, folder / "exports/ncore")
    return folder


def test_the_export_of_a_moving_camera_agrees_with_its_views(moving):
    assert problems(moving, "views", "ncore") == []


def test_without_a_split_a_parts_list_has_all_views(tmp_path):
    folder = tmp_path / "dataset"
    write_views(folder, LENSES["perspective"], RIG, see=look_at_ball)
    write_instant_ngp(folder, "views", [])
    (folder / "transforms.json").rename(folder / "transforms_test.json")
    assert problems(folder, "views", "instant_ngp") == []


# Exports that hold the views of other rigs, too.
OF_RIGS = ("colmap", "nerfbaselines", "nerfstudio", "nerf_synthetic", "lichtfeld", "ncore")


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


def test_a_rig_that_looks_inward_fills_the_unit_cube(tmp_path):
    rig = {"type": "sphere", "subdivisions": 1, "size": 1.7, "face_inside": True}
    write_views(tmp_path / "dataset", LENSES["perspective"], rig, see=look_at_ball)
    write_instant_ngp(tmp_path / "dataset", "views", [])
    assert problems(tmp_path / "dataset", "views", "instant_ngp") == []


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


def test_depth_agrees_where_a_set_has_its_views_as_png_too(dataset, tmp_path):
    folder = tmp_path / "scene" / "dataset"
    shutil.copytree(dataset / "exr", folder / "exr")
    shutil.copyfile(dataset / "lightfield.json", folder / "lightfield.json")
    shutil.copytree(dataset / "perspective", folder / "perspective")
    for view in LightField.read(folder / "perspective/lightfield.json").views:
        picture = folder / "perspective/exports/colmap/images" / f"{view.name}.png"
        shutil.copyfile(picture, folder / "perspective" / f"{view.name}.png")
    assert picture_problems(folder, "perspective", "nerfstudio") == []


@pytest.mark.parametrize(
    "kind",
    ["colmap", "nerfstudio", "nerf_synthetic", "opendibr", "miv", "lichtfeld", "hci", "wai"],
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
    settings = TypeAdapter(EXPORTERS[kind]).validate_python({"sources": ["flat"], **options})
    source = SourceDataset(folder, "flat", ".exr", **options)
    exports.run(source, settings, folder / "flat" / "exports" / kind)
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


def test_boxes_are_those_of_the_passes(boxed):
    assert problems(boxed, "views", "coco") == []


def test_segmentations_are_those_of_the_passes(boxed, tmp_path):
    folder = shutil.copytree(boxed, tmp_path / "dataset")
    write_export(folder, "views", "coco", {"segmentation": True})
    assert problems(folder, "views", "coco") == []
    path = folder / "exports/coco/instances.json"
    content = read_json(path)
    wall, ball = (annotation["segmentation"] for annotation in content["annotations"][:2])
    # As pycocotools 2.0.11 encodes the masks of the first view.
    assert ball == {"size": [48, 64], "counts": "Z]1:V10000000V[1"}
    assert wall == {"size": [48, 64], "counts": "0Z]1:lcN0000000V[1"}
    ball["counts"] = wall["counts"]
    write_json(path, content)
    (problem,) = problems(folder, "views", "coco")
    assert "annotations: 2: is not the object's" in problem


def test_segmentation_changes_no_other_byte_of_a_list_of_boxes(boxed, tmp_path):
    folder = shutil.copytree(boxed, tmp_path / "dataset")
    write_export(folder, "views", "coco", {"segmentation": True})
    content = read_json(folder / "exports/coco/instances.json")
    for annotation in content["annotations"]:
        del annotation["segmentation"]
    write_json(folder / "exports/coco/instances.json", content)
    plain = (boxed / "exports/coco/instances.json").read_bytes()
    assert (folder / "exports/coco/instances.json").read_bytes() == plain
    assert "segmentation" not in read_json(boxed / "exports/coco/export.json")["options"]


def test_masks_of_chosen_objects_are_those_of_the_pass(boxed, tmp_path):
    folder = shutil.copytree(boxed, tmp_path / "dataset")
    write_export(folder, "views", "nerfstudio", {"points": 60, "objects": ["Ball"]})
    assert picture_problems(folder, "views", "nerfstudio") == []
    path = folder / "exports/nerfstudio/masks/view_0001f.png"
    images.write_png(path, images.read_image(path).channels["Y"] ^ 255)
    (problem,) = picture_problems(folder, "views", "nerfstudio")
    assert "view_0001f.png: has another mask than its view in 3072 of 3072 pixels" in problem
