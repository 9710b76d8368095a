"""Files that damage or another program has changed: each is read, or refused in one line.

A seed decides how each kind of file is spoiled. Each file is read, or a `UserError` of one line
names it. In two of three files, checksums of the file itself are corrected. Otherwise these would
hide all other faults.
"""

import contextlib
import copy
import functools
import itertools
import json
import os
import random
import re
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest
import yaml
from oracles import readers
from pydantic import TypeAdapter
from sphere import write_views

from lightfield.configuration import blend_lock, scene_yaml
from lightfield.configuration.config_file import Energy, load_config
from lightfield.core.errors import UserError
from lightfield.engine import receipts
from lightfield.export.source import SourceDataset
from lightfield.exporters import EXPORTERS, MANIFESTS
from lightfield.formats import published
from lightfield.formats.inventory import read_inventory
from lightfield.formats.lightfield import LightField
from lightfield.formats.render_block import RenderBlock
from lightfield.formats.splits_file import splits_content
from lightfield.geometry import lenses
from lightfield.geometry.rigs import from_settings
from lightfield.imaging import images
from lightfield.measurement import plan
from lightfield.planning import cost as planning
from lightfield.planning.cost import rendering
from lightfield.planning.estimate import Known
from lightfield.planning.loading import scene_datasets
from lightfield.planning.sampling import calibrated
from lightfield.products import exports
from lightfield.reprojection import lens_map
from lightfield.stages.registry import VERSIONS
from lightfield.validation import splits_check
from lightfield.workflow import history
from lightfield.workflow.check import JobCheck
from lightfield.workflow.presence import check_external_files

TIMES = itertools.count(10**18, 10**6)
# The number of files of each kind. "few" takes seconds, and runs in each run of the tests.
COUNTS = [pytest.param(40, id="few"), pytest.param(600, id="many", marks=pytest.mark.slow)]

HOSTILE = [
    None,
    True,
    False,
    0,
    -1,
    1,
    2**31,
    10**30,
    -(10**400),
    0.5,
    -0.0,
    1e308,
    5e-324,
    float("nan"),
    float("inf"),
    -float("inf"),
    "",
    "a",
    "0",
    "nan",
    "\0",
    "../..",
    "/dev/zero",
    "x" * 5000,
    "ä\ud800",
    "f:/\\",
    [],
    {},
    [[]],
    [None],
    {"": None},
    [0] * 1000,
    [[0] * 4] * 4,
    {"a": {"a": {"a": 1}}},
]

WORDS = [
    b"",
    b"0",
    b"-1",
    b"1e400",
    b"nan",
    b"inf",
    b"9" * 5000,
    b"1" * 20,
    b"18446744073709551615",
    b"x",
    b'"',
    b"\0",
    b"\n",
    b"\xff",
    b"\xed\xa0\x80",
    b"[" * 5000,
    b"a b c d e f g h i j",
]


def places(content, path=()):
    """Yield the path to each part of a JSON, first that of the whole JSON."""
    yield path
    items = content.items() if isinstance(content, dict) else ()
    items = enumerate(content) if isinstance(content, list) else items
    for key, value in items:
        yield from places(value, (*path, key))


def spoiled(content, rng):
    """Return a JSON in which one to three parts are replaced, removed, added, or swapped."""
    content = copy.deepcopy(content)
    for _ in range(rng.randint(1, 3)):
        path = rng.choice(list(places(content)))
        if not path:
            # The whole JSON rarely: such files are refused at once.
            if rng.random() < 0.1:
                content = copy.deepcopy(rng.choice(HOSTILE))
            continue
        above = content
        for key in path[:-1]:
            above = above[key]
        fault = rng.randrange(5)
        if fault == 0:
            del above[path[-1]]
        elif fault == 1 and isinstance(above, dict):
            above[rng.choice(["", "a", "frames", "files", str(path[-1]) + "x"])] = above[path[-1]]
        elif fault == 2:
            other = list(places(content))
            value = content
            for key in rng.choice(other):
                value = value[key]
            above[path[-1]] = copy.deepcopy(value)
        else:
            above[path[-1]] = copy.deepcopy(rng.choice(HOSTILE))
    return content


def reworded(data, rng):
    """Return a text's bytes with one to three of its words replaced."""
    words = re.split(rb"([\s,:]+)", data)
    for _ in range(rng.randint(1, 3)):
        words[rng.randrange(0, len(words), 2)] = rng.choice(WORDS)
    return b"".join(words)


def damaged(data, rng):
    """Return bytes that are cut short, flipped, repeated, or replaced."""
    data = bytearray(data)
    match rng.randrange(6):
        case 0:
            return bytes(data[: rng.randrange(len(data))])
        case 1:
            for _ in range(rng.randint(1, 8)):
                data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        case 2:
            at = rng.randrange(len(data))
            data[at:at] = rng.choice([b"[" * 5000, b"\0" * 20, b"9" * 5000, b"\xff\xfe", b'"'])
        case 3:
            at = rng.randrange(len(data))
            data[at : at + rng.randint(1, 200)] = b""
        case 4:
            data += data[: rng.randrange(len(data))]
        case _:
            return rng.choice([b"", b"\0" * len(data), b"null", b"[]", b"{}", b"\x93NUMPY"])
    return bytes(data)


CAMERAS = {
    "equidistant": {"fov": 180},
    "equisolid": {"fov": 120, "focal_length": 10},
    "stereographic": {"fov": 180},
    "equirectangular": {"longitude": [-90, 90], "latitude": [-45, 60]},
    "rectilinear": {"fov": 60, "principal_point": [7, 9]},
    "kannala_brandt": {"fov": 120, "focal_length": 10, "coefficients": [0.01, 0, 0, 0]},
    "polynomial": {"fov": 120, "coefficients": [0, -0.1, 0, 0, 0]},
    "division": {"focal_length": 10, "coefficients": [-0.3]},
    "fov_model": {"focal_length": 10, "coefficients": [0.9]},
    "unified": {"focal_length": 20, "coefficients": [0.9]},
    "extended_unified": {"focal_length": 10, "coefficients": [0.6, 1.1]},
    "double_sphere": {"focal_length": 10, "coefficients": [-0.2, 0.6]},
    "f_theta": {"focal_length": 10, "coefficients": [0.01, 0, 0, -0.01]},
    "brown_conrady": {"focal_length": 20, "coefficients": [-0.2, 0.1, 0.001, 0.002]},
}
PLANE = {"type": "plane", "cameras": [2, 2]}


def lightfield(rng):
    return lightfield_of(rng.choice(list(CAMERAS)))


# `spoiled` changes a copy.
@functools.cache
def lightfield_of(name):
    lens = lenses.from_camera({"lens": name, "resolution": [16, 16], **CAMERAS[name]})
    more = {
        "scene": {"name": "room", "fingerprint": "0"},
        "render": {"samples": 1, "passes": ["normal"], "transparent": False},
        "frame": 1,
        "depth": "distance",
    }
    return LightField.from_rig(PLANE, lens, **more).to_json()


def read_lightfield(path, _):
    lightfield = LightField.read(path)
    lightfield.world_from_cameras  # noqa: B018
    lightfield.with_flow()
    lightfield.lens.fitted(8).pixel_rays()
    lightfield.lens.pixels([[0.1, 0.2, -1.0]])
    json.dumps(lightfield.to_json())
    for key in ("passes", "transparent", "frame", "scene", "render"):
        getattr(lightfield, key)


def inventory(_):
    lens = {"type": "PERSP", "lens": 50.0, "sensor_fit": "AUTO", "sensor_width": 36.0}
    lens |= {"sensor_height": 24.0, "shift_x": 0.1, "shift_y": 0.0, "depth_of_field": False}
    camera = {"name": "Camera", "lens": lens, "clip": [0.1, 1000.0], "moves": True}
    camera["matrices"] = {"1": np.eye(4).tolist(), "3": np.eye(4).tolist()}
    blend = {"scene": "Scene", "frame": 3, "samples": 64, "camera": camera, "layers": ["a"]}
    blend |= {"motion_blur": True, "shutter": 0.5, "shutter_position": "START", "remapped": [1, 2]}
    blend |= {"shutter_curve": False, "rolling_shutter": False}
    blend |= {"followers": {"by_name": ["Sign"], "active": []}}
    return {
        "blend": blend,
        "external_files": [{"path": "a.png", "sha256": "0" * 64, "bytes": 7, "mtime_ns": 7}],
        "missing": [{"kind": "image", "name": "a", "path": "a.png", "problem": "missing"}],
        "volumes": ["fog"],
        "left_out": ["points"],
        "memory_bytes": 10**9,
    }


def read_scene_inventory(path, dataset):
    rendering(dataset)
    check_external_files(dataset)
    for key in ("left_out", "external_files", "memory_bytes", "volumes", "missing"):
        read_inventory(path, key)
    resolved = dataset.resolved(path)
    resolved.rig.poses()
    resolved.rig.camera.make()


def receipt_lines(_):
    view = {"view": "a", "finished": 3.0}
    view |= dict.fromkeys(("wall_seconds", "cpu_seconds", "render_seconds"), 1.0)
    header = {"job": "own/View/render/0-2", "stage": "render_shard", "version": 1}
    made = {
        "file": "results/exr/a.exr",
        "sha256": "0" * 64,
        "bytes": 7,
        "modified_ns": 7,
        "key": "k",
    }
    inputs = {"a.json": "0" * 64, "work/receipts/b.jsonl": "0" * 64}
    return [
        header | {"settings": {"a": 1}, "inputs": inputs},
        made,
        {**made, "file": "results/exr/b.exr"},
        {"started": 1.0, "host": "here", "pid": 7},
        {"start_up_seconds": 1.0, "device": "CPU", "threads": 1},
        view,
        {"ended": 4.0, "cpu_seconds": 2.0, "peak_memory_bytes": 7},
    ]


def read_receipt(path, _):
    check = JobCheck(Path("work"), Path("results"), lambda _: None, VERSIONS)
    check.verdict(str(path), {})
    check.will_run(str(path))
    if receipt := receipts.read(path):
        receipt.sum  # noqa: B018
    # The same lines in the receipt of a job that was killed.
    path.with_suffix(".part").write_bytes(path.read_bytes())
    with receipts.opened(path, {}, []) as job:
        job.is_finished(Path("results/exr/a.exr"), "k")
        job.add_input("a.json")
    for run in history.read(path):
        for key in ("later_views", "last_heard", "wall_seconds", "cpu_seconds"):
            getattr(run, key)
    path.with_suffix(".part").unlink()


def transforms(_):
    frame = {"file_path": "view_0000f.png", "transform_matrix": np.eye(4).tolist()}
    frame["depth_path"] = "depth/view_0000f.png"
    options = {"scale": 1.0, "offset": [0, 0, 0], "bounds": "rig", "depth": True}
    options |= {"aabb_scale": 1, "render_aabb": None}
    fisheye = {f"ftheta_p{power}": 0.1 for power in range(5)}
    return {
        "w": 16,
        "h": 16,
        "fl_x": 10.0,
        "fl_y": 10.0,
        "cx": 8.0,
        "cy": 8.0,
        **fisheye,
        "scale": 1.0,
        "offset": [0.5, 0.5, 0.5],
        "aabb_scale": 1,
        "render_aabb": None,
        "frames": [frame],
        "options": options,
        "integer_depth_scale": 0.001,
    }


def read_transforms(path, _):
    readers.read(path, (16, 16))
    MANIFESTS[0].pictures(path)


def export_list(rng):
    formats = ["nerfstudio", "nerf_synthetic", "opendibr", "miv", "scannetpp", "colmap"]
    formats += ["ncore", "lichtfeld", "wai"]
    return {
        "format": rng.choice([*formats, "hci", "point_cloud", "poses_csv"]),
        "options": {"depth": True},
        "files": {"transforms.json": "0" * 64, "a.png": "0" * 64},
    }


def read_export_list(path, _):
    for take in (MANIFESTS[1].pictures, MANIFESTS[1].files):
        take(path)
    readers.read(path, (16, 16))


@functools.cache
def training_views():
    camera = lenses.from_camera({"lens": "equidistant", "fov": 180, "resolution": [4, 4]})
    return LightField.from_rig({**PLANE, "split": "train"}, camera)


def splits_of(_):
    return splits_content({"LFPlane": training_views()})


def read_splits(path, _):
    folder = path.parent / "LFPlane"
    if not folder.exists():
        folder.mkdir()
        training_views().write(folder / "lightfield.json")
    splits_check.check(path, folder, [])


def calibration(_):
    choice = {"samples": 16, "adaptive_threshold": 0, "denoise": False}
    return {"target_error": 0.01, "choice": choice, "cost_samples": 16.0}


def read_calibration(path, dataset):
    calibrated(RenderBlock(target_error=0.01, seed=0), path)
    rendering(dataset)


def probe(_):
    return {
        "views": 2,
        "view_seconds": [1.0, 2.0],
        "view_bytes": [10, 12],
        "samples": 64,
        "resolution": [16, 16],
        "device": "CPU",
    }


def read_probe(path, dataset):
    rendering(dataset)
    dataset.shards  # noqa: B018
    plan.table([("a/b", 1, planning.read_probe(path))], {}, Energy(), {"a/b": Known()})


def saved_lens_map(path):
    source = lenses.from_camera({"lens": "equidistant", "fov": 180, "resolution": [8, 8]})
    target = lenses.from_camera({"lens": "rectilinear", "fov": 60, "resolution": [4, 4]})
    lens_map.save(path, lens_map.compute(source, target, np.eye(3)))


def read_lens_map(path, _):
    lens_map.warnings(lens_map.load(path))


def scene(_):
    camera = {"lens": "equidistant", "fov": 180, "resolution": [16, 16]}
    flat = {"lens": "rectilinear", "focal_length": 18, "resolution": [16, 16]}
    return {
        "scene": {"builder": "room", "parameters": {"seed": 1}, "frame": 3},
        "render": {"samples": 4, "passes": ["normal"], "denoise": True},
        "rigs": {"LFPlane": {**PLANE, "size": 0.5, "camera": camera}},
        "reprojections": {"flat": {"rigs": ["LFPlane"], "camera": flat, "format": "exr"}},
        "flow": {"pairs": "neighbours"},
        "exports": {"colmap": {"sources": ["flat"], "points": 100}},
    }


def read_scene(path, _):
    scene_yaml.read_scene(path)
    scene_datasets(path.stem)


def configuration(_):
    return {
        "scenes": ["room"],
        "rigs": "all",
        "preset": "full",
        "presets": {"full": {}, "small": {"samples": 4, "views": 3}},
        "results": "results",
        "work": "work",
        "device": "cpu",
        "views_per_shard": 8,
        "energy": {"watts": 65, "cores": "auto"},
    }


def read_configuration(path, _):
    # Snakemake reads the YAML itself.
    with contextlib.suppress(yaml.YAMLError, UnicodeDecodeError, RecursionError, ValueError):
        content = yaml.safe_load(path.read_bytes())
        load_config(content if isinstance(content, dict) else {})


def lock(_):
    return {"blend": "own.blend", "sha256": "0" * 64}


def read_lock(_, dataset):
    scene_datasets("own")
    source = dataset.written.scene
    blend_lock.expected_blend(dataset.scene_name, source, Path(source.blend), "0" * 64)


def read_published(path, _):
    published.rigs(str(path.parent))


def poses(rng):
    if rng.random() < 0.5:
        return transforms(rng)
    return lightfield(rng)


def read_poses(path, _):
    from_settings({"type": "poses", "file": str(path)}).poses()


# For each kind: the file's path in work/own, a sample's content, and the function that reads it.
KINDS = {
    "lightfield": ("View/lightfield.json", lightfield, read_lightfield),
    "inventory": ("inventory.json", inventory, read_scene_inventory),
    "receipt": ("../receipts/own/View/render/0-2.jsonl", receipt_lines, read_receipt),
    "transforms": ("View/transforms.json", transforms, read_transforms),
    "export": ("View/exports/export.json", export_list, read_export_list),
    "splits": ("splits.json", splits_of, read_splits),
    "calibration": ("calibration.json", calibration, read_calibration),
    "probe": ("View/probe.json", probe, read_probe),
    "scene": ("../../other.yaml", scene, read_scene),
    "configuration": ("../../config.yaml", configuration, read_configuration),
    "lock": ("../../own.lock.json", lock, read_lock),
    "published": ("../../published/lightfield.json", lightfield, read_published),
    "poses": ("../../poses.json", poses, read_poses),
}

# The kinds whose functions read through a dataset.
OF_DATASETS = {"inventory", "calibration", "probe", "lock"}
# The kinds that are YAML.
OF_YAML = {"scene", "configuration"}

OWN = """
scene: {blend: own.blend, frame: file}
render: {target_error: 0.01}
rigs:
  View: {type: blend_camera, camera: {lens: file, resolution: [16, 16]}}
"""


def text_of(kind, content):
    """Return the bytes of a file with this content."""
    # Without checksums NaN is possible: Python writes and reads it.
    text = json.dumps(content)
    if kind == "receipt" and isinstance(content, list):
        return b"".join(json.dumps(line).encode() + b"\n" for line in content)
    return text.encode("utf-8", "surrogatepass")


@pytest.fixture
def home(tmp_path, monkeypatch):
    """The folder of a user's own .blend. Only its files tell its rig and its samples."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.yaml").write_text(OWN)
    (tmp_path / "own.blend").write_bytes(b"a scene")
    (tmp_path / "a.png").write_bytes(b"a texture")
    monkeypatch.setattr(scene_yaml, "SCENES", tmp_path)
    return tmp_path


# Some spoiled files are valid lists of missing files, or valid inventories of other .blends.
LISTED = {
    "export": "exports/",
    "transforms": "View/",
    "inventory": ".blend",
}


def assert_read_or_refused(read, path, dataset, data, listed=None):
    """Read a file of ``data``. ``listed`` is a listed name that the message may have instead."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    # Programs cache a file's content until its time changes.
    changed = next(TIMES)
    os.utime(path, ns=(changed, changed))
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            read(path, dataset)
        except UserError as error:
            assert all(line.isprintable() for line in str(error).splitlines())
            assert path.name in str(error) or (listed and listed in str(error))
        except Exception as error:
            pytest.fail(f"{type(error).__name__}: {error}: {data[:2000]!r}")


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_spoiled_file_is_read_or_refused(kind, count, home):
    name, sample, read = KINDS[kind]
    rng = random.Random(f"{kind} 7")
    for number in range(count):
        content = sample(rng)
        data = text_of(kind, spoiled(content, rng))
        if number % 3 == 2:
            data = damaged(text_of(kind, content), rng)
        if kind in OF_YAML:
            # PyYAML refuses 1000 open lists, too. It takes seconds for 5000.
            data = data.replace(b"[" * 5000, b"[" * 1000)
        (dataset,) = scene_datasets("own") if kind in OF_DATASETS else [None]
        path = home / "work/own" / name
        assert_read_or_refused(read, path, dataset, data, LISTED.get(kind))
        # The next sample's dataset follows from the settings alone.
        path.unlink()


@pytest.mark.parametrize("kind", KINDS)
def test_an_intact_file_is_read(kind, home):
    """Otherwise the spoiled files might be refused for a fault that all samples share."""
    name, sample, read = KINDS[kind]
    path = home / "work/own" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text_of(kind, sample(random.Random(1))))
    (dataset,) = scene_datasets("own")
    if kind == "export":
        # The listed files do not exist.
        with pytest.raises(UserError, match=r"cannot be read|no such file|No such file|is no"):
            read(path, dataset)
        return
    read(path, dataset)


@pytest.mark.parametrize("count", COUNTS)
def test_a_spoiled_lens_map_is_read_or_refused(count, tmp_path):
    rng = random.Random("lens map 7")
    path = tmp_path / "lens_map.npy"
    saved_lens_map(path)
    read_lens_map(path, None)
    sound = path.read_bytes()
    header = sound.index(b"\n") + 1
    for number in range(count):
        data = damaged(sound, rng)
        if number % 3 == 0:
            # Damage the header, which says how to read the rest.
            data = damaged(sound[:header], rng) + sound[header:]
        elif number % 3 == 1:
            description = sound.index(b"{", header)
            end = sound.index(b"}\0" if b"}\0" in sound[description:] else b"}", description)
            data = sound[:description] + damaged(sound[description:end], rng) + sound[end:]
        assert_read_or_refused(read_lens_map, path, None, data)


def pose_table(path):
    rows = [f"view_{number},{number},0,1,0.1,0,0.2" for number in range(5)]
    path.write_text("\n".join(["name,x,y,z,rx,ry,rz", *rows]) + "\n")


def image_list(path):
    lines = [f"{number} 1 0 0 0 0 {number} 0 1 view_{number}.png\n\n" for number in range(5)]
    path.write_text("# images\n" + "".join(lines))


def binary_image_list(path):
    image = struct.pack("<i7di", 1, 1, 0, 0, 0, 0, 2, 0, 1) + b"view.png\0" + struct.pack("<Q", 0)
    path.write_bytes(struct.pack("<Q", 2) + image + image.replace(b"view", b"look"))


def view(path):
    pixels = np.random.default_rng(1).random((16, 24), np.float32)
    channels = {"R": pixels, "G": pixels, "B": pixels.astype(np.float16), "Z": pixels}
    images.write_exr(path, channels, {"plenoforge:key": "a"})


def read_view(path, _):
    images.read_header(path)
    images.is_finished(path, "a")
    images.read_image(path, ["R", "Z"], (2, 5))
    images.read_image(path)


def picture(path):
    images.write_png(path, np.arange(24 * 16 * 3, dtype=np.uint8).reshape(24, 16, 3))


def read_picture(path, _):
    images.read_header(path)
    images.read_image(path).srgb  # noqa: B018


# For each file's name: the functions that write and read it.
FILES = {
    "poses.csv": (pose_table, read_poses),
    "images.txt": (image_list, read_poses),
    "images.bin": (binary_image_list, read_poses),
    "view.exr": (view, read_view),
    "view.png": (picture, read_picture),
}


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("name", FILES)
def test_a_damaged_file_is_read_or_refused(name, count, tmp_path):
    write, read = FILES[name]
    path = tmp_path / name
    write(path)
    read(path, None)
    sound = path.read_bytes()
    rng = random.Random(f"{name} 7")
    for number in range(count):
        is_reworded = path.suffix in (".csv", ".txt") and number % 2
        data = (reworded if is_reworded else damaged)(sound, rng)
        assert_read_or_refused(read, path, None, data)


EXPORTS = {
    "colmap": {"points": 20, "depth": True},
    "nerfstudio": {"points": 20, "depth": True},
    "nerf_synthetic": {},
    "opendibr": {},
    "miv": {},
    "hci": {},
    "lichtfeld": {"points": 20, "depth": True},
    "ncore": {"points": 20},
    "poses_csv": {},
    "point_cloud": {"voxel": 0.1},
    "wai": {},
    "focal_stack": {},
    "epipolar_volumes": {"depth": True},
}
PICTURES = {".png", ".exr", ".yuv", ".mp4"}


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("kind", EXPORTS)
def test_a_damaged_export_is_read_or_refused(kind, count, tmp_path):
    source = tmp_path / "dataset"
    camera = {"lens": "rectilinear", "fov": 60, "resolution": [16, 16]}
    write_views(source, camera, {"type": "plane", "cameras": [2, 2], "size": 0.2})
    settings = TypeAdapter(EXPORTERS[kind]).validate_python({"sources": ["views"]} | EXPORTS[kind])
    folder = tmp_path / "export"
    exports.run(SourceDataset(source, "", ".exr", {}), settings, folder)
    listed = folder / "export.json"

    def read(path, _):
        readers.read(listed, (16, 16))

    read(None, None)
    files = [path for path in folder.rglob("*") if path.is_file() and path.suffix not in PICTURES]
    rng = random.Random(f"{kind} 7")
    for _ in range(count):
        path = rng.choice(files)
        sound = path.read_bytes()
        data = (reworded if b"\0" not in sound and rng.random() < 0.5 else damaged)(sound, rng)
        assert_read_or_refused(read, path, None, data, str(folder))
        path.write_bytes(sound)
