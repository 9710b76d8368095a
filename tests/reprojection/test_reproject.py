"""The reprojection program as a user runs it, compared with Cycles through the same lenses."""

import csv
import json
import math
import os
import shutil
import subprocess
from pathlib import Path

import bookkeeping
import cv2
import forks
import numpy as np
import OpenEXR
import pytest
from conftest import BLENDER, SCRIPTS

from lightfield.core.errors import OutsideError, UserError
from lightfield.core.files import sha256
from lightfield.engine import receipts
from lightfield.engine.flags import parsed
from lightfield.geometry.lenses.cube_map import CUBE_FACES, CubeMap
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.imaging.halves import widen
from lightfield.imaging.images import read_header, read_image, write_exr, write_png
from lightfield.imaging.tonemap import decode_srgb
from lightfield.reprojection import kernels, lens_map
from lightfield.reprojection.colour import resample_colour
from lightfield.reprojection.depth import resample_depth
from lightfield.reprojection.filters import FILTERS
from lightfield.stages.lenses import Reproject

SIZE = 48
FISHEYE = Equidistant(width=SIZE, height=SIZE, fov=math.pi)


def scene_color(rays):
    return 0.5 + 0.4 * np.stack(
        [np.sin(3 * rays[..., 0]), np.cos(4 * rays[..., 1]), rays[..., 2]], axis=-1
    )


def view_channels(lens, shift=0.0):
    """Return colour, and Z-depth (or distance), of a sphere of 2 m around the camera."""
    rays = lens.pixel_rays()
    color = np.nan_to_num(scene_color(rays) + shift)
    depth = np.where(np.isnan(rays[..., 2]), np.inf, 2 * -rays[..., 2] if lens.has_z_depth else 2)
    channels = {name: color[..., i].astype("f2") for i, name in enumerate("RGB")}
    return channels | {"Z": depth.astype("f4")}


@pytest.fixture
def dataset(tmp_path):
    """Three fisheye views and their lightfield.json."""
    frames = []
    for index in range(3):
        name = f"view_{index:04d}f"
        write_exr(
            tmp_path / "exr" / f"{name}.exr",
            view_channels(FISHEYE, 0.1 * index),
            {"plenoforge:depth": "z", "plenoforge:key": f"key {index}"},
        )
        matrix = np.eye(4)
        matrix[:3, 3] = index, 0, 1
        frames.append(
            {
                "name": name,
                "position": [index, 0, 1],
                "rotation": [0.0, 0.0, 0.0],
                "world_matrix": matrix.tolist(),
            }
        )
    config = FISHEYE.to_lightfield() | {"lf_type": "PLANE", "note": "kept", "frames": frames}
    (tmp_path / "lightfield.json").write_text(json.dumps(config))
    return tmp_path


def reproject(words):
    parsed(Reproject, None, words).run()


@pytest.fixture
def run(dataset):
    """Return a function that runs the program on the dataset. Its output folder is `out`."""

    def go(*flags, configs=True, source=True):
        command = [*flags, "--output-dir", str(dataset / "out")]
        if source:
            command += ["--input-dir", str(dataset / "exr")]
        if configs:
            command += ["--input-cfg", str(dataset / "lightfield.json")]
            command += ["--output-cfg", str(dataset / "out" / "lightfield.json")]
        reproject(command)

    return go


CAMERA = {"lens": "rectilinear", "fov": 90, "resolution": [24, 16]}
FOCAL_LENGTH = {"lens": "rectilinear", "focal_length": 18, "resolution": [24, 16]}
PERSPECTIVE = ("--rectilinear", "18,36", "--scale", "0.5")


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_the_papers_command(dataset, run):
    run("--parallel", "4", *PERSPECTIVE, "--png", "--exposure", "-1", "--reinhard", "5")
    out = dataset / "out"
    assert names(out) == ["lightfield.json", *(f"view_{i:04d}f.png" for i in range(3))]
    pixels = read_image(out / "view_0000f.png").channels
    assert pixels["R"].shape == (24, 24) and pixels["R"].dtype == np.uint8
    # The centre looks ahead. Its colour is halved, compressed, and encoded.
    light = scene_color(np.array([1 / 24, -1 / 24, -1.0])) / 2
    light = light * (1 + light / 25) / (1 + light)
    expected = 255 * (1.055 * light ** (1 / 2.4) - 0.055)
    colour = [int(pixels[name][12, 12]) for name in "RGB"]
    assert np.abs(colour - expected).max() < 2
    config = json.loads((out / "lightfield.json").read_text())
    assert config["resolution"] == [24, 24] and config["sensor_size"] == [36, 36]
    assert config["camera"]["type"] == "PERSP" and config["camera"]["focal_length"] == 18
    assert config["depth"] is None and config["note"] == "kept" and len(config["frames"]) == 3


@pytest.mark.parametrize("precision", ["float", "rounded"])
def test_exr_has_depth_along_its_own_axis(dataset, run, precision):
    config = json.loads((dataset / "lightfield.json").read_text())
    config["render"] = {"depth_precision": precision}
    (dataset / "lightfield.json").write_text(json.dumps(config))
    run(*PERSPECTIVE, "--exr", "--rotation", "20,-10,30")
    image = read_image(dataset / "out" / "view_0001f.exr")
    assert image.attributes["plenoforge:depth"] == "z"
    assert [image.channels[name].dtype.name for name in "RGBZ"] == ["float16"] * 3 + ["float32"]
    x, y = np.meshgrid(np.arange(24) + 0.5, np.arange(24) + 0.5)
    z = 2 / np.sqrt(1 + ((x - 12) ** 2 + (y - 12) ** 2) / 144)
    assert np.abs(image.channels["Z"] / z - 1).max() < 1e-4
    digits = np.ascontiguousarray(image.channels["Z"]).view("u4") & 0x7F
    assert digits.any() == (precision == "float")
    config = json.loads((dataset / "out" / "lightfield.json").read_text())
    assert config["depth"] == "z"
    matrix = np.array(config["frames"][1]["world_matrix"])
    assert np.allclose(matrix[:3, :3], lens_map.rotation_matrix(20, -10, 30))
    assert matrix[:3, 3].tolist() == [1, 0, 1]
    # The turned camera's centre shows the point of the world in its direction.
    light = scene_color(matrix[:3, :3] @ [0, 0, -1]) + 0.1
    colour = np.mean([[image.channels[c][11:13, 11:13].mean()] for c in "RGB"], axis=1)
    assert np.abs(colour - light).max() < 0.02


def test_the_rotation_is_also_in_the_frames_euler_angles(dataset, run):
    mathutils_order = np.array(
        json.loads((dataset / "lightfield.json").read_text())["frames"][0]["rotation"]
    )
    assert not mathutils_order.any()
    run(*PERSPECTIVE, "--png", "--rotation=-30,0,0", "--dry-run")
    frame = json.loads((dataset / "out" / "lightfield.json").read_text())["frames"][0]
    # A camera that looks along -Z and turns right by 30 degrees turns about Y by -30.
    assert np.allclose(frame["rotation"], [0, -math.radians(30), 0])
    assert names(dataset / "out") == ["lightfield.json"]


def test_pixels_without_a_source_are_marked(dataset, run):
    run(*PERSPECTIVE, "--exr", "--png", "--depth-png", "1000", "--mask", "--rotation", "80,0,0")
    out = dataset / "out"
    rgba, depth = read_image(out / "view_0000f.png").channels, read_image(out / "view_0000f.exr")
    missing = rgba["A"] == 0
    assert 0.3 < missing.mean() < 0.5
    assert set(np.unique(rgba["A"])) == {0, 255}
    assert not any(rgba[c][missing].any() for c in "RGB")
    assert np.array_equal(np.isnan(depth.channels["Z"]), missing)
    # Depth marks it, so there is no second mark.
    assert depth.channels.keys() == {*"RGBZ"}
    assert not depth.channels["G"][missing].any()
    mask = read_image(out / "dynamic_mask_view_0000f.png").channels["Y"]
    assert np.array_equal(mask, np.where(missing, 255, 0))
    integers = read_image(out / "view_0000f_depth.png").channels["Y"]
    assert integers.dtype == np.uint16 and not integers[missing].any()
    z = depth.channels["Z"][~missing].astype(float)
    assert np.abs(integers[~missing] - z * 1000).max() <= 0.5


def test_depth_beyond_the_range_of_a_png_is_missing_there(dataset, run, capsys):
    run(*PERSPECTIVE, "--exr", "--depth-png", "40000")
    z = read_image(dataset / "out" / "view_0000f.exr").channels["Z"].astype(float)
    integers = read_image(dataset / "out" / "view_0000f_depth.png").channels["Y"]
    # 16 bits end at 1.638 m.
    assert 0.1 < (z < 1.638).mean() < 0.9
    assert np.abs(integers - z * 40000)[z < 1.638].max() <= 0.5
    assert not integers[z > 1.639].any()
    lost = 0
    for path in (dataset / "out").glob("*_depth.png"):
        depth = read_image(path.with_name(path.name.replace("_depth.png", ".exr"))).channels["Z"]
        lost += int((np.isfinite(depth) & (read_image(path).channels["Y"] == 0)).sum())
    note = (
        f"{lost} depths are 0, unknown, in 16-bit depth maps, which hold only 2.5e-05 to 1.63837 m"
    )
    assert f"note: {dataset / 'out'}: {note}\n" in capsys.readouterr().out


def test_a_copy_as_png_has_no_negative_depth_and_no_nan(dataset, run):
    ones = np.ones((SIZE, SIZE), np.float32)
    channels = {**dict.fromkeys("RGB", ones), "G": ones.copy(), "Z": -ones}
    channels["G"][20, 20] = np.nan
    write_exr(dataset / "a.exr", channels)
    arguments = ["--no-reproject", "--png", "--exr", "--depth-png", "1000", "--single"]
    run(*arguments, str(dataset / "a.exr"), source=False)
    channels_of = {
        name: read_image(dataset / "out" / name).channels for name in names(dataset / "out")[:3]
    }
    assert not channels_of["a_depth.png"]["Y"].any()
    assert [channels_of["a.png"][c][20, 20] for c in "RGBA"] == [0] * 4
    assert [channels_of["a.exr"][c][20, 20] for c in "RGB"] == [0] * 3


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_8_bit_images_are_read_as_srgb(dataset, run, suffix):
    code = np.full((SIZE, SIZE, 3), 128, np.uint8)
    code[:, : SIZE // 2] = 40
    path = dataset / f"gray{suffix}"
    assert cv2.imwrite(str(path), code)
    run("--nn", "--png", *PERSPECTIVE, "--exr", "--single", str(path), source=False)
    green = read_image(dataset / "out" / "gray.png").channels["G"]
    assert np.abs(green[:, [2, -3]].astype(int) - [40, 128]).max() <= 1
    linear = read_image(dataset / "out" / "gray.exr").channels
    assert abs(float(linear["G"][12, 20]) - ((128 / 255 + 0.055) / 1.055) ** 2.4) < 5e-3
    assert "Z" not in linear


def test_transparent_pixels_of_a_png_give_no_colour(dataset, run):
    pixels = np.full((SIZE, SIZE, 4), 200, np.uint8)
    pixels[:, : SIZE // 2, :3], pixels[:, : SIZE // 2, 3] = 90, 0
    pixels[:, SIZE // 2 :, 3] = 255
    write_png(dataset / "half.png", pixels)
    run("--png", *PERSPECTIVE, "--single", str(dataset / "half.png"), source=False)
    channels = read_image(dataset / "out" / "half.png").channels
    assert not channels["A"][:, :11].any() and (channels["A"][:, 13:] == 255).all()
    assert (channels["R"][:, 13:] == 200).all()


def test_an_unreadable_file_is_named_and_the_others_are_done(dataset, run, capsys):
    (dataset / "exr" / "broken.exr").write_bytes(b"no image")
    content = (dataset / "exr" / "view_0001f.exr").read_bytes()
    (dataset / "exr" / "view_0001f.exr").write_bytes(content[: len(content) // 2])
    receipt = dataset / "receipts/0-3.jsonl"
    with pytest.raises(
        UserError, match=r"2 of 4 views could not be reprojected, such as .*broken\.exr"
    ) as caught:
        run(*PERSPECTIVE, "--png", "--receipt", str(receipt))
    assert not isinstance(caught.value, OutsideError)
    message = capsys.readouterr().err
    assert "broken.exr" in message and "view_0001f.exr" in message
    out = dataset / "out"
    assert names(out) == ["lightfield.json", "view_0000f.png", "view_0002f.png"]
    assert not receipt.exists()


def test_a_wrong_size_is_refused(dataset, run, capsys):
    write_png(dataset / "exr" / "small.png", np.zeros((5, 7, 3), np.uint8))
    with pytest.raises(UserError, match="1 of 4"):
        run(*PERSPECTIVE, "--png")
    assert "small.png: has 7 × 5 pixels; the lens expects 48 × 48" in capsys.readouterr().err


def test_views_of_one_shard_and_their_receipt(dataset, run):
    receipt = dataset / "receipts/1-3.jsonl"
    run(*PERSPECTIVE, "--png", "--exr", "--views", "1:3", "--receipt", str(receipt))
    files = ["view_0001f.exr", "view_0001f.png", "view_0002f.exr", "view_0002f.png"]
    out = dataset / "out"
    assert names(out) == ["lightfield.json", *files]
    stamps = {path: made.stamp for path, made in receipts.read(receipt).outputs.items()}
    assert {path: (stamp.bytes, stamp.sha256) for path, stamp in stamps.items()} == {
        str(out / name): ((out / name).stat().st_size, sha256(out / name))
        for name in ("lightfield.json", *files)
    }
    first = receipt.read_bytes()
    run(*PERSPECTIVE, "--png", "--exr", "--views", "1:3", "--receipt", str(receipt))
    assert receipt.read_bytes() == first


def test_a_damaged_source_is_not_used(dataset, run):
    sources = sorted((dataset / "exr").iterdir())
    receipt = dataset / "receipts/0-3.jsonl"
    bookkeeping.note_shard(receipt, {path: f"key {i}" for i, path in enumerate(sources)})
    write_exr(sources[1], view_channels(FISHEYE, 0.5), {"plenoforge:key": "key 1"})
    # Nobody may take it for a fault of the scene.
    receipts = ["--source-receipt", str(receipt), "--receipt", str(dataset / "receipts/out.jsonl")]
    with pytest.raises(OutsideError, match=f"{sources[1].name}: is not as its job made it"):
        run(*PERSPECTIVE, "--png", *receipts)
    assert names(dataset / "out") == ["lightfield.json", "view_0000f.png", "view_0002f.png"]


@pytest.mark.parametrize("views", ["3:4", "1:1", "x", "-1:2", "1"])
def test_missing_views_are_refused(run, views):
    with pytest.raises(UserError, match="--views"):
        run(*PERSPECTIVE, "--png", f"--views={views}")


def test_only_missing_or_outdated_files_are_made_again(dataset, run):
    def stamps():
        return {p.name: p.stat().st_mtime_ns for p in out.glob("view*")}

    def changed(before):
        return {name for name, stamp in stamps().items() if before.get(name) != stamp}

    out = dataset / "out"
    flags = (*PERSPECTIVE, "--png")
    run(*flags)
    content = (out / "view_0001f.png").read_bytes()
    before = stamps()
    run(*flags)
    assert changed(before) == set()
    (out / "view_0000f.png").unlink()
    (out / "view_0001f.png").write_bytes(content[: len(content) // 2])
    run(*flags)
    assert changed(before) == {"view_0000f.png", "view_0001f.png"}
    assert (out / "view_0001f.png").read_bytes() == content
    before = stamps()
    write_exr(
        dataset / "exr" / "view_0002f.exr", view_channels(FISHEYE), {"plenoforge:key": "another"}
    )
    run(*flags)
    assert changed(before) == {"view_0002f.png"}
    before = stamps()
    run(*flags, "--exposure", "1")
    assert len(changed(before)) == 3
    before = stamps()
    run(*flags, "--skip-if-exists")
    assert changed(before) == set()


def test_damaged_outputs_are_made_again(dataset, run):
    out, receipt = dataset / "out", dataset / "receipts/0-3.jsonl"
    flags = (*PERSPECTIVE, "--png", "--exr", "--receipt", str(receipt))
    run(*flags)
    made = {path.name: path.read_bytes() for path in out.glob("view*")}
    first = receipts.read(receipt)
    before = {path.name: path.stat().st_mtime_ns for path in out.glob("view*")}
    turned = out / "view_0000f.png"
    pixels = read_image(turned).channels
    key = read_header(turned).attributes["plenoforge:key"]
    write_png(turned, np.dstack([pixels[c] for c in "RGB"])[::-1].copy(), {"plenoforge:key": key})
    assert turned.read_bytes() != made[turned.name]
    flipped = bytearray(made["view_0001f.exr"])
    flipped[-5] ^= 1
    (out / "view_0001f.exr").write_bytes(flipped)
    run(*flags)
    assert {path.name: path.read_bytes() for path in out.glob("view*")} == made
    second = receipts.read(receipt)
    assert (second.settings, second.inputs, second.sum) == (
        first.settings,
        first.inputs,
        first.sum,
    )
    kept = {name for name, stamp in before.items() if (out / name).stat().st_mtime_ns == stamp}
    assert kept == {"view_0002f.png", "view_0002f.exr"}


def test_a_saved_lens_map_gives_the_same_bytes(dataset, run, run_program):
    run(*PERSPECTIVE, "--png", "--exr")
    out = dataset / "out"
    made = {path.name: path.read_bytes() for path in out.glob("view*")}
    for path in out.glob("view*"):
        path.unlink()
    file = dataset / "map.npy"
    config = dataset / "lightfield.json"
    message = run_program("lens_map.py", file, *PERSPECTIVE, "--input-cfg", config).stderr
    assert "magnification: 0.7" in message and "100.0% of the image" in message
    run(*PERSPECTIVE, "--png", "--exr", "--lens-map", str(file))
    assert {path.name: path.read_bytes() for path in out.glob("view*")} == made
    with pytest.raises(UserError, match=r"is a lens map for filter \"adaptive\""):
        run(*PERSPECTIVE, "--png", "--bl", "--lens-map", str(file))


def test_prefix_suffix_and_no_configs(dataset, run):
    write_png(dataset / "exr" / "other.png", np.zeros((SIZE, SIZE, 3), np.uint8))
    run(
        "--no-configs",
        f"{SIZE},{SIZE}",
        "--i-equidistant",
        str(math.pi),
        *PERSPECTIVE,
        "--png",
        "--filter-prefix",
        "view",
        "--filter-suffix",
        "2f.exr",
        configs=False,
    )
    assert names(dataset / "out") == ["view_0002f.png"]
    run(*PERSPECTIVE, "--png", "--filter-suffix", "1f")
    config = json.loads((dataset / "out" / "lightfield.json").read_text())
    assert [frame["name"] for frame in config["frames"]] == ["view_0001f"]


def test_two_images_of_one_name_are_not_confused(dataset, run):
    write_png(dataset / "exr" / "view_0001f.png", np.zeros((SIZE, SIZE, 3), np.uint8))
    with pytest.raises(UserError, match=r"view_0001f\.exr and .*view_0001f\.png"):
        run(*PERSPECTIVE, "--png")


def test_no_reproject_keeps_the_pixels(dataset, run):
    run("--no-reproject", "--exr")
    for index in range(3):
        name = f"view_{index:04d}f.exr"
        before = read_image(dataset / "exr" / name).channels
        after = read_image(dataset / "out" / name).channels
        inside = np.isfinite(before["Z"])
        assert all(np.array_equal(before[c][inside], after[c][inside]) for c in "RGBZ")
        assert np.isnan(after["Z"][~inside]).all()
    run("--no-reproject", "--scale", "0.5", "--exr")
    assert read_image(dataset / "out" / "view_0000f.exr").channels["R"].shape == (24, 24)


@pytest.mark.parametrize("config_says", [None, "z"])
def test_file_and_configuration_agree_on_the_kind_of_depth(dataset, run, config_says):
    # The file's own kind counts.
    name = "view_0000f.exr"
    channels = view_channels(FISHEYE)
    channels["Z"] = np.where(np.isinf(channels["Z"]), channels["Z"], np.float32(2))
    write_exr(dataset / "exr" / name, channels, {"plenoforge:depth": "distance"})
    config = json.loads((dataset / "lightfield.json").read_text())
    if config_says:
        (dataset / "lightfield.json").write_text(json.dumps(config | {"depth": config_says}))
    run("--no-reproject", "--exr")
    after = read_image(dataset / "out" / name)
    written = json.loads((dataset / "out" / "lightfield.json").read_text())
    assert after.attributes["plenoforge:depth"] == written["depth"] == "z"
    expected = view_channels(FISHEYE)["Z"]
    inside = np.isfinite(expected)
    assert np.allclose(after.channels["Z"][inside], expected[inside], rtol=1e-6)


def test_a_cube_map_and_back(dataset, run):
    run("--cubemap", "64", "--exr")
    out = dataset / "out"
    config = json.loads((out / "lightfield.json").read_text())
    assert [frame["name"] for frame in config["frames"][:5]] == [
        f"view_0000f_{face}" for face in CUBE_FACES if face != "b"
    ]
    assert config["resolution"] == [64, 64] and config["depth"] == "z"
    # The left face looks along -X of a camera that looks along -Z.
    assert np.allclose(np.array(config["frames"][1]["world_matrix"])[:3, 2], [1, 0, 0])
    front = read_image(out / "view_0000f_f.exr").channels
    assert np.isfinite(front["Z"]).all()
    # A fisheye of 180° sees nothing behind it.
    assert not (out / "view_0000f_b.exr").exists()
    cube = CubeMap(width=384, height=64)
    (dataset / "cube.json").write_text(json.dumps(cube.to_lightfield()))
    for face in "blrud":
        # The fisheye saw only the front half. Fill the rest, so that the cube is complete.
        path = out / f"view_0000f_{face}.exr"
        x, y = np.meshgrid(
            np.arange(64) + 0.5 + 64 * list(CUBE_FACES).index(face), np.arange(64) + 0.5
        )
        color = scene_color(cube.rays(x, y))
        write_exr(path, {c: color[..., i].astype("f2") for i, c in enumerate("RGB")})
    command = ["--input-dir", str(out), "--input-cfg", str(dataset / "cube.json")]
    command += ["--filter-prefix", "view_0000f", "--equirectangular", "full"]
    command += ["--output-resolution", "64,32", "--png", "--output-dir", str(dataset / "pano")]
    reproject(command)
    assert names(dataset / "pano") == ["view_0000f.png"]
    channels = read_image(dataset / "pano" / "view_0000f.png").channels
    assert "A" not in channels
    light = np.clip(scene_color(Equirectangular(width=64, height=32).pixel_rays()), 0, 1)
    expected = 255 * np.where(light < 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    for i, name in enumerate("RGB"):
        difference = np.abs(channels[name] - expected[..., i])
        assert difference[light[..., i] > 0.05].max() < 5


def test_a_pngs_header_leads_back_to_its_light(dataset, run):
    optics = ("--rectilinear", "18,36", "--scale", "0.5", "--rotation", "10deg,0,5")
    run(*optics, "--png", "--exr", "--exposure", "-1", "--reinhard", "5")
    written = json.loads((dataset / "out/lightfield.json").read_text())["reprojection"]
    assert written == {
        "rotation": [10.0, 0.0, 5.0],
        "filter": "adaptive",
        "samples": 1,
        "exposure": -1.0,
        "reinhard": 5.0,
    }
    image = read_image(dataset / "out/view_0000f.png")
    said = {name: image.attributes[f"plenoforge:{name}"] for name in written}
    assert said == {name: str(value) for name, value in written.items()}
    light = read_image(dataset / "out/view_0000f.exr").colour
    # The formula of docs/reference/files.md, for the sRGB value y and the maximum m.
    y, m = decode_srgb(image.colour / 255), float(said["reinhard"])
    v = m**2 / 2 * (y - 1 + np.sqrt((1 - y) ** 2 + 4 * y / m**2))
    run(*optics, "--exr")
    plain = read_image(dataset / "out/view_0000f.exr").colour
    clear = (light > 0.02) & (light < 0.98)
    assert clear.sum() > 100
    assert np.allclose((v / 2 ** float(said["exposure"]))[clear], plain[clear], rtol=0.05)


def test_angles_may_be_given_in_degrees(dataset, run):
    run("--equidistant", "120deg", "--png", "--dry-run")
    written = json.loads((dataset / "out/lightfield.json").read_text())
    assert written["camera"]["fisheye_fov"] == pytest.approx(math.radians(120))
    for flags in (("--rectilinear", "18deg,36"), ("--equidistant", "deg"), ("--scale", "90deg")):
        with pytest.raises((UserError, SystemExit)):
            run(*flags, "--png", "--dry-run")


def test_a_cube_map_of_a_narrow_lens_has_the_front_face_alone(dataset, run):
    lens = ["--no-configs", f"{SIZE},{SIZE}", "--i-equidistant", "1deg"]
    run(*lens, "--cubemap", "8", "--png", "--filter-prefix", "view_0000f", configs=False)
    assert names(dataset / "out") == ["view_0000f_f.png"]
    cube = ["--no-configs", "48,8", "--i-cubemap", "--equirectangular", "full", "--png"]
    with pytest.raises(UserError, match="--single: is one face of a cube map"):
        run(*cube, "--single", str(dataset / "out/view_0000f_f.png"), configs=False, source=False)


@pytest.mark.parametrize(
    ("lens", "faces"),
    [
        (("--i-rectilinear", "18,36"), "f"),  # 90 degrees
        (("--i-rectilinear", "17.9,36"), "flrud"),  # a little more
        (("--i-equirectangular=-45deg,45deg,-30deg,30deg",), "f"),
        (("--i-equirectangular=-46deg,45deg,-30deg,30deg",), "fl"),
        (("--i-equidistant", "180deg"), "flrud"),
    ],
)
def test_a_cube_map_has_only_faces_that_the_image_shows(dataset, run, lens, faces):
    size = ["--no-configs", f"{SIZE},{SIZE}"]
    run(*size, *lens, "--cubemap", "8", "--png", "--filter-prefix", "view_0000f", configs=False)
    assert names(dataset / "out") == sorted(f"view_0000f_{face}.png" for face in faces)


def test_each_face_of_a_cube_map_has_a_file_for_its_lens_map(dataset, run, run_program):
    # The workflow expects all six, and cannot tell which faces a fisheye sees.
    flags = ["--no-configs", f"{SIZE},{SIZE}", "--i-equidistant", "180deg", "--cubemap", "8"]
    maps = dataset / "maps"
    maps.mkdir()
    run_program("lens_map.py", maps / "lens.npy", *flags)
    assert names(maps) == sorted(f"lens_{face}.npy" for face in CUBE_FACES)
    use = ["--lens-map", str(maps / "lens.npy"), "--png", "--filter-prefix", "view_0000f"]
    receipt = dataset / "receipts/cube.jsonl"
    run(*flags, *use, "--receipt", str(receipt), configs=False)
    assert names(dataset / "out") == sorted(f"view_0000f_{face}.png" for face in "flrud")
    assert {str(file) for file in maps.iterdir()} <= receipts.read(receipt).inputs.keys()


def test_a_warning_is_printed_once(dataset, run, capsys):
    run("--cubemap", "256", "--png")
    assert capsys.readouterr().err.count("warning: upsampling") == 1


@pytest.mark.parametrize(
    ("fov", "warnings"), [("", 1), (",360deg", 1), (",250deg", 0)], ids=["none", "360", "250"]
)
def test_a_lens_that_ends_inside_its_image_is_a_warning(dataset, run, capsys, fov, warnings):
    run("--double-sphere", f"6,36,-0.172,0.593{fov}", "--png", "--views", "0:1")
    lines = capsys.readouterr().err.splitlines()
    found = [line for line in lines if line.startswith("warning: the double-sphere fisheye ends")]
    assert len(found) == warnings
    assert all("fov" in line for line in found)


@pytest.mark.parametrize(
    "flags",
    [
        ("--equisolid", "10,36,3.0"),
        ("--equidistant", "4.5"),
        ("--stereographic", "4"),
        ("--orthographic", "3"),
        ("--equirectangular", "full"),
        ("--equirectangular=-1,1,-0.5,0.5",),
        ("--polynomial", "0,-0.07,0,0,0,36,3"),
        ("--kannala-brandt", "9,36,0.01,0,0,0"),
        ("--brown-conrady", "22,36,-0.2,0.05,0.003,-0.002,0,0,0,0"),
        ("--thin-prism-fisheye", "9,36,-0.01,0.01,0.003,-0.002,0,0,0.004,-0.003"),
        ("--fisheye624", "9,36,-0.01,0.01,0,0,0,0,0.003,-0.002,0.004,0,-0.003,0"),
        ("--division", "12,36,-0.2"),
        ("--fov-model", "12,36,0.9"),
        ("--unified", "20,36,0.9"),
        ("--extended-unified", "11,36,0.6,1.1"),
        ("--double-sphere", "11,36,-0.2,0.6"),
        ("--f-theta", "9,36,-0.01,0.02,0,-0.001"),
    ],
)
def test_every_lens_is_a_target_and_a_source(dataset, run, flags):
    run(*flags, "--scale", "1.5", "--exr", "--views", "0:1")
    out = dataset / "out"
    config = json.loads((out / "lightfield.json").read_text())
    first = read_image(out / "view_0000f.exr").channels
    seen = np.isfinite(first["Z"])
    assert seen.mean() > 0.2
    # And back, according to the configuration, where the scene was visible both times.
    (out / "exr").mkdir()
    (out / "view_0000f.exr").rename(out / "exr" / "view_0000f.exr")
    config["frames"] = config["frames"][:1]
    (dataset / "lightfield.json").write_text(json.dumps(config))
    command = [
        "--rectilinear",
        "40,36",
        "--output-resolution",
        "21,21",
        "--exr",
        "--input-dir",
        str(out / "exr"),
        "--input-cfg",
        str(dataset / "lightfield.json"),
        "--output-dir",
        str(dataset / "back"),
    ]
    reproject(command)
    back = read_image(dataset / "back" / "view_0000f.exr").channels
    rays = Rectilinear(width=21, height=21, focal_length=40, sensor_size=(36, 36)).pixel_rays()
    assert np.abs(back["R"] - scene_color(rays)[..., 0]).max() < 0.01
    assert np.abs(back["Z"] / (2 * -rays[..., 2]) - 1).max() < 1e-4


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (("--rectilinear", "18", "--png"), "--rectilinear 18: must have the form FOCAL_LENGTH"),
        (("--equidistant", "180", "--png"), "--equidistant 180: fov"),
        (("--png",), "give the output lens"),
        (PERSPECTIVE, "--exr, --png"),
        ((*PERSPECTIVE, "--png", "--rotation", "5"), "--rotation 5: must have the form PAN"),
        (
            (*PERSPECTIVE, "--png", "--samples", "0"),
            "--samples: is 0; must be a whole number at least 1",
        ),
        (
            (*PERSPECTIVE, "--png", "--samples", "999999999"),
            "--samples: is 999999999",
        ),
        (
            ("--cubemap", "9999999999", "--png"),
            "--cubemap: is 9999999999",
        ),
        (("--rectilinear", "18,36", "--png", "--scale", "0.001"), "leaves no pixel"),
        (("--rectilinear", "18,36", "--png", "--scale", "1e9"), "makes a side of over"),
        ((*PERSPECTIVE, "--png", "--output-resolution", "1e9,4"), "must be two whole numbers"),
        ((*PERSPECTIVE, "--png", "--no-reproject"), "--no-reproject: excludes"),
        (("--cubemap", "16", "--png", "--no-reproject"), "--no-reproject: excludes"),
        ((*PERSPECTIVE, "--png", "--i-equidistant", "3"), "the input lens comes from --input-cfg"),
        ((*PERSPECTIVE, "--png", "--filter-prefix", "zebra"), "no image passes the filters"),
        (
            (*PERSPECTIVE, "--png", "--views", "0:2", "--filter-prefix", "zebra"),
            "no image passes the filters",
        ),
        (
            (*PERSPECTIVE, "--png", "--lens-map", "none.npy"),
            "none.npy: cannot be read: No such",
        ),
    ],
)
def test_mistakes_are_named(run, flags, message):
    with pytest.raises(UserError) as error:
        run(*flags)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("flags", "settings"),
    [
        (
            ["--rectilinear", "18,36", "--output-resolution", "24,16", "--png", "--exr"],
            {"camera": FOCAL_LENGTH, "formats": ["png", "exr"]},
        ),
        (
            ["--cubemap", "12", "--rotation", "20,-10,30", "--exr", "--bl", "-s", "2", "--mask"],
            {
                "camera": CAMERA | {"resolution": [12, 12]},
                "cube_map": True,
                "rotation": [20, -10, 30],
                "filter": "bilinear",
                "samples": 2,
                "formats": ["exr"],
                "mask": True,
            },
        ),
        (
            ["--no-reproject", "--png", "--bits", "16", "--exposure", "-1", "--reinhard", "5"],
            {"formats": ["png"], "bits": 16, "exposure": -1, "reinhard": 5},
        ),
    ],
)
def test_a_settings_file_gives_the_bytes_of_the_flags(dataset, run, tmp_path, flags, settings):
    run(*flags, "--depth-png", "1000")
    by_flags = {path.name: path.read_bytes() for path in (dataset / "out").iterdir()}
    shutil.rmtree(dataset / "out")
    (tmp_path / "settings.json").write_text(json.dumps({**settings, "depth_png": 1000}))
    run("--settings", str(tmp_path / "settings.json"))
    assert {path.name: path.read_bytes() for path in (dataset / "out").iterdir()} == by_flags


def deflate_effort(path, rows=24):
    """Return the effort that the first zlib stream of an EXR notes: 0 fastest, 1 fast, 2 usual."""
    content = path.read_bytes()
    table = 8 * math.ceil(rows / 16)
    # The table of blocks lies before the first block, whose place is its first entry.
    place = next(
        place
        for place in range(table, len(content))
        if int.from_bytes(content[place - table : place - table + 8], "little") == place
    )
    return content[place + 9] >> 6


def test_exr_files_are_zip_at_its_fastest_level(dataset, run):
    run(*PERSPECTIVE, "--exr")
    path = dataset / "out" / "view_0000f.exr"
    header = OpenEXR.File(str(path), header_only=True).header()
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert deflate_effort(path) == 0
    # Other files are as small as before.
    write_exr(dataset / "other.exr", read_image(path).channels)
    assert deflate_effort(dataset / "other.exr") == 1


def test_the_compression_of_a_reprojection_keeps_every_pixel(dataset, run, tmp_path):
    out = dataset / "out" / "view_0000f.exr"
    settings = {"camera": CAMERA, "formats": ["exr"]}
    (tmp_path / "settings.json").write_text(json.dumps(settings))
    run("--settings", str(tmp_path / "settings.json"))
    zipped = read_image(out)
    (tmp_path / "settings.json").write_text(json.dumps(settings | {"compression": "htj2k"}))
    # The files of another compression are outdated.
    run("--settings", str(tmp_path / "settings.json"))
    file = OpenEXR.File(str(out), separate_channels=True)
    assert file.header()["compression"] == OpenEXR.HTJ2K256_COMPRESSION
    pixels = {name: channel.pixels for name, channel in file.channels().items()}
    assert pixels.keys() == zipped.channels.keys() == set("RGBZ")
    assert all(np.array_equal(pixels[name], zipped.channels[name]) for name in pixels)


def test_a_compression_that_openexr_lacks_is_refused(dataset, run, tmp_path, monkeypatch):
    monkeypatch.delattr(OpenEXR, "ZSTD_COMPRESSION")
    settings = {"camera": CAMERA, "formats": ["exr"], "compression": "zstd"}
    (tmp_path / "settings.json").write_text(json.dumps(settings))
    with pytest.raises(UserError, match=r"^compression: is 'zstd', which OpenEXR .* cannot write"):
        run("--settings", str(tmp_path / "settings.json"))
    assert not (dataset / "out").exists()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"bits": 16}, "formats: must be a list of exr, png, or both"),
        ({"formats": ["png"], "passes": ["normal"]}, "passes: is normal; "),
    ],
)
def test_settings_that_fit_no_run_are_refused(dataset, run, tmp_path, settings, message):
    (tmp_path / "settings.json").write_text(json.dumps(settings))
    with pytest.raises(UserError) as error:
        run("--settings", str(tmp_path / "settings.json"))
    assert message in str(error.value)
    assert not (dataset / "out").exists()


def test_a_settings_file_excludes_the_flags(run, tmp_path):
    (tmp_path / "settings.json").write_text('{"formats": ["png"]}')
    with pytest.raises(UserError, match="--settings: excludes --exposure"):
        run("--settings", str(tmp_path / "settings.json"), "--exposure", "1")


def test_two_images_of_one_name_are_named(dataset, run):
    for name in ("view.exr", "view.f.exr", "view.png"):
        shutil.copy(dataset / "exr" / "view_0000f.exr", dataset / "exr" / name)
    with pytest.raises(UserError, match=r"view\.exr and .*view\.png: would have one output"):
        run(*PERSPECTIVE, "--png")


def test_an_error_is_one_line_and_an_exit_status(dataset, run_program):
    result = run_program("reproject.py", "--png", "-i", dataset / "exr", "-o", "x", check=False)
    assert result.returncode == 1
    assert result.stderr == (
        "error: --input-cfg: is missing; without one, give --no-configs and --i-…\n"
    )


def test_samples_have_the_published_tools_default_filter(dataset, run):
    run(*PERSPECTIVE, "--png", "--samples", "2", "--views", "0:1")
    key = read_header(dataset / "out" / "view_0000f.png").attributes["plenoforge:key"]
    run(*PERSPECTIVE, "--png", "--samples", "2", "--bc", "--views", "0:1")
    assert read_header(dataset / "out" / "view_0000f.png").attributes["plenoforge:key"] == key


# Compared with Cycles


PLACE, HALF = np.array([1.0, 2.0, -1.5]), 10.0
AHEAD = np.array([[0.8, -0.36, 0.48], [0.6, 0.48, -0.64], [0.0, 0.8, 0.6]])
LENSES = {
    "fisheye": (
        Equidistant(width=256, height=256, fov=math.pi),
        {"type": "PANO", "panorama_type": "FISHEYE_EQUIDISTANT", "fisheye_fov": math.pi},
        (0, 0, 0),
    ),
    "perspective": (
        Rectilinear(width=96, height=96, focal_length=18, sensor_size=(36, 36)),
        {"type": "PERSP", "lens": 18, "sensor_width": 36},
        (12, -8, 20),
    ),
    "tall": (
        Rectilinear(width=60, height=90, focal_length=30, sensor_size=(36, 54)),
        {"type": "PERSP", "lens": 30, "sensor_width": 36, "sensor_fit": "HORIZONTAL"},
        (-15, 20, 0),
    ),
    "narrow fisheye": (
        Equidistant(width=96, height=96, fov=2.0),
        {"type": "PANO", "panorama_type": "FISHEYE_EQUIDISTANT", "fisheye_fov": 2.0},
        (0, 25, -40),
    ),
    "panorama": (
        Equirectangular(width=160, height=80, longitude=(-1, 1), latitude=(-0.5, 0.5)),
        {
            "type": "PANO",
            "panorama_type": "EQUIRECTANGULAR",
            "longitude_min": -1,
            "longitude_max": 1,
            "latitude_min": -0.5,
            "latitude_max": 0.5,
        },
        (5, 5, 5),
    ),
}


@pytest.fixture(scope="module")
def renders(tmp_path_factory):
    """Cycles' views of one room from one place through every lens, twice with different seeds."""
    path = tmp_path_factory.mktemp("lenses") / "renders.npz"
    cases = [
        {
            "name": f"{name}.{seed}",
            "resolution": [lens.width, lens.height],
            "camera": camera,
            "rotation": (AHEAD @ lens_map.rotation_matrix(*angles)).tolist(),
            "seed": seed,
            "samples": 16,
        }
        for name, (lens, camera, angles) in LENSES.items()
        for seed in ((1,) if name == "fisheye" else (2, 3))
    ]
    program = BLENDER / "render_lenses.py"
    result = subprocess.run(
        [forks.python(), program, path],
        input=json.dumps(cases),
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(SCRIPTS)},
    )
    assert result.returncode == 0, result.stderr
    return np.load(path)


@pytest.mark.parametrize("name", [name for name in LENSES if name != "fisheye"])
def test_a_reprojection_equals_cycles_render_through_that_lens(renders, name):
    lens, _, angles = LENSES[name]
    source = LENSES["fisheye"][0]
    made = lens_map.compute(source, lens, lens_map.rotation_matrix(*angles), "adaptive")
    # Leave out pixels on the rim of an image circle, which are partly dark.
    has_source = (~np.isnan(made.target_cos)).astype(np.uint8)
    all_have_source = cv2.erode(has_source, np.ones((3, 3)), borderValue=0) > 0
    seen = (made.flags == kernels.INSIDE) & all_have_source
    assert seen.mean() > 0.7
    row, end_row, column, end_column = made.window
    window = np.s_[row:end_row, column:end_column]
    color = renders["fisheye.1.color"][window]
    reprojected = resample_colour(widen(color, color, color), made)[..., 0]
    first, second = renders[f"{name}.2.color"], renders[f"{name}.3.color"]
    noise = np.sqrt(np.mean((first - second)[seen] ** 2) / 2)
    error = (reprojected - (first + second) / 2)[seen]
    assert noise < 0.02
    assert np.sqrt(np.mean(error**2)) < 1.5 * noise
    assert abs(error.mean()) < noise / 5

    depth = renders["fisheye.1.depth"][window]
    direct = renders[f"{name}.2.depth"]
    # Cycles' depth is along the axis for a perspective camera, else the distance.
    is_z = isinstance(lens, Rectilinear)
    ours = resample_depth(depth, False, is_z, made)
    # Leave out the room's edges, where two walls meet.
    rays = lens.pixel_rays()
    distance = direct / -rays[..., 2] if is_z else direct
    rotation = AHEAD @ lens_map.rotation_matrix(*angles)
    points = PLACE + distance[..., None] * (rays @ rotation.T)
    walls = np.sort(np.abs(points), axis=-1)[..., 1]
    flat = seen & (walls < HALF * 0.93)
    assert flat.mean() > 0.4
    assert np.abs(ours[flat] / direct[flat] - 1).max() < 1e-4


# The benchmark


def test_the_benchmark_measures_every_method(tmp_path, run_program):
    program = Path(__file__).parents[2] / "benchmarks" / "reprojection.py"
    output = run_program(program, tmp_path, "--size", 128, "--repeats", 1).stdout
    assert "default filter adaptive: " in output
    with (tmp_path / "reprojection.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["scenario"] for row in rows} == {"minify by 8", "unity", "magnify by 3"}
    assert {row["method"] for row in rows} >= set(FILTERS) | {"OpenCV"}
    error = {(r["scenario"], r["method"], r["samples"]): float(r["rms_error"]) for r in rows}
    # Facts about the methods that hold without measuring.
    assert error["minify by 8", "adaptive", "1"] < error["minify by 8", "bicubic", "1"] / 5
    assert error["minify by 8", "bicubic", "8"] < error["minify by 8", "bicubic", "2"] / 5
    for scenario in ("unity", "magnify by 3"):
        assert error[scenario, "bicubic", "1"] < error[scenario, "bilinear", "1"]
        assert error[scenario, "bilinear", "1"] < error[scenario, "nearest", "1"]
        assert error[scenario, "adaptive", "1"] <= error[scenario, "bicubic", "1"] * 1.001
    assert all(float(row["view_cpu_s"]) > 0 for row in rows)
    front = [row for row in rows if row["on_front"] == "True"]
    assert {row["scenario"] for row in front} == {row["scenario"] for row in rows}
    assert (tmp_path / "reprojection.svg").stat().st_size > 10000
    assert cv2.imread(str(tmp_path / "reprojection.png")).shape[1] > 1000
