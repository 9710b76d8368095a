"""Rendered views: where each pixel looks, its depth, and which views are kept or rendered again."""

import json
from importlib.metadata import version
from operator import itemgetter
from pathlib import Path

import bookkeeping
import numpy as np
import OpenEXR
import pytest
from conftest import BLENDER

from lightfield import open_dataset
from lightfield.core.files import sha256
from lightfield.engine import receipts
from lightfield.formats.lightfield import LightField
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.rendering.views import shard as shards
from lightfield.workflow import history

RENDER = {
    "samples": 1,
    "adaptive_threshold": 0,
    "denoise": False,
    "seed": 0,
    "max_bounces": 0,
    "depth_precision": "float",
}
CAMERAS = {
    "perspective": {"lens": "rectilinear", "focal_length": 18, "resolution": [96, 96]},
    "perspective_wide_shifted": {
        "lens": "rectilinear",
        "fov": 80,
        "resolution": [96, 64],
        "principal_point": [40, 35],
    },
    "perspective_tall": {"lens": "rectilinear", "focal_length": 24, "resolution": [48, 96]},
    "equidistant": {"lens": "equidistant", "fov": 180, "resolution": [96, 96]},
    "equidistant_220": {"lens": "equidistant", "fov": 220, "resolution": [96, 96]},
    "equidistant_shifted": {
        "lens": "equidistant",
        "fov": 160,
        "resolution": [96, 64],
        "principal_point": [52, 30],
    },
    "equisolid": {
        "lens": "equisolid",
        "fov": 180,
        "focal_length": 10.5,
        "sensor_size": 36,
        "resolution": [96, 96],
    },
    "polynomial": {
        "lens": "polynomial",
        "fov": 170,
        "coefficients": [0, -0.09, 0.0005, 0, 0],
        "sensor_size": 36,
        "resolution": [96, 96],
    },
    "equirectangular": {"lens": "equirectangular", "resolution": [128, 64]},
}
# One camera, off the centre of the room and turned about every axis.
RIG = {
    "type": "lattice",
    "cameras": [1, 1, 1],
    "center": [0.4, -0.3, 1.3],
    "rotation": [20, -35, 50],
}


def lightfield(camera, render, rig=RIG):
    lens = lenses.from_camera(camera)
    depth = "z" if lens.has_z_depth else "distance"
    return LightField.from_rig(rig, lens, depth=depth, frame=1, render=render, scene={})


@pytest.fixture(scope="module")
def rendered(tmp_path_factory, run_program, room):
    folder = tmp_path_factory.mktemp("positions")
    cases = folder / "cases.json"
    narrow = RENDER | {"filter_width": 0.01}
    cases.write_text(
        json.dumps({name: lightfield(camera, narrow).to_json() for name, camera in CAMERAS.items()})
    )
    program = BLENDER / "render_positions.py"
    run_program(program, room, folder / "out.npz", cases)
    return dict(np.load(folder / "out.npz"))


@pytest.mark.parametrize("name", CAMERAS)
def test_pixels_look_where_cycles_looked(name, rendered):
    """Compares our pose and lens with the points that Cycles reports as hit."""
    lens = lenses.from_camera(CAMERAS[name])
    content = lightfield(CAMERAS[name], RENDER)
    world = content.views[0].world_from_camera
    rays = lens.pixel_rays()
    offset = rendered[f"{name}.points"] - world[:3, 3]
    distance = np.linalg.norm(offset, axis=-1)
    hit = (offset / distance[..., None]) @ world[:3, :3]
    seen = np.isfinite(rays).all(axis=-1)
    np.testing.assert_array_equal(seen, np.isfinite(distance))

    angle = 2 * np.arcsin(np.linalg.norm(rays - hit, axis=-1) / 2)
    assert np.median(angle[seen]) < 1e-4
    # Leave out the rim of a 180 degree lens, where Z-depth has no digits left.
    usable = seen & (-hit[..., 2] > 0.01) if content.depth == "z" else seen
    truth = -hit[..., 2] * distance if content.depth == "z" else distance
    error = np.abs(rendered[f"{name}.z"] / truth - 1)[usable]
    assert np.median(error) < 1e-6
    assert np.quantile(error, 0.99) < 1e-4
    assert np.all(np.isposinf(rendered[f"{name}.z"][~seen]))


@pytest.mark.parametrize("name", CAMERAS)
def test_a_dataset_that_is_opened_leads_to_the_points_that_cycles_hit(name, rendered, tmp_path):
    content = lightfield(CAMERAS[name], RENDER)
    content.write(tmp_path / "lightfield.json")
    z = rendered[f"{name}.z"].astype(np.float32)
    images.write_exr(tmp_path / f"exr/{content.views[0].name}.exr", {"Z": z})
    view = open_dataset(tmp_path).views[0]
    origins, directions = view.rays()
    truth = rendered[f"{name}.points"]
    seen = np.isfinite(truth).all(axis=-1)
    np.testing.assert_array_equal(seen, np.isfinite(directions).all(axis=-1))
    # Leave out the rim of a 180 degree lens, where Z-depth has no digits left.
    axis = -view.world_from_camera[:3, 2]
    usable = seen & (directions @ axis > 0.01) if content.depth == "z" else seen
    points = origins + directions * view.distance[..., None]
    distance = np.linalg.norm(truth - origins, axis=-1)
    error = np.linalg.norm(points - truth, axis=-1)[usable] / distance[usable]
    assert np.median(error) < 1e-4
    pixels, visible = view.project(truth[seen])
    row, column = np.nonzero(seen)
    offset = np.abs(pixels - np.stack([column, row], axis=-1) - 0.5)
    # The ray of a sample begins within 0.005 pixels of the centre.
    assert visible.all()
    assert offset.max() < 0.02


@pytest.fixture
def shard(tmp_path, run_program, room):
    """A rig of four views, and functions that render it."""
    camera = {"lens": "equidistant", "fov": 180, "resolution": [32, 32]}
    rig = RIG | {"type": "plane", "cameras": [2, 2], "size": 0.5}
    content = lightfield(camera, RENDER | {"samples": 2}, rig).to_json()
    file = tmp_path / "lightfield.json"
    file.write_text(json.dumps(content))
    folder = tmp_path / "receipts"

    def receipt(views=":"):
        first, end = views.split(":")
        return folder / f"{first or 0}-{end or 4}.jsonl"

    def render(*extra, views=":", program=("render_shard.py",), **options):
        return run_program(
            *program,
            "--blend",
            room,
            "--lightfield",
            file,
            "--output",
            tmp_path / "exr",
            "--device",
            "cpu",
            "--threads",
            "1",
            "--views",
            views,
            "--receipt",
            receipt(views),
            *extra,
            **options,
        )

    def rendered():
        """Return the names of the views in the order in which they were rendered."""
        lines = [line for path in history.shards(folder) for line in receipts.history(path)]
        renderings = [line for line in lines if "view" in line]
        return [line["view"] for line in sorted(renderings, key=itemgetter("finished"))]

    def noted(views=":"):
        """Return the SHA-256 of each file in the receipt of a shard, by its name."""
        made = receipts.read(receipt(views))
        return {Path(path).name: output.stamp.sha256 for path, output in made.outputs.items()}

    render.content, render.file, render.views = content, file, tmp_path / "exr"
    render.rendered, render.receipt, render.noted = rendered, receipt, noted
    return render


def test_a_view_is_rendered_again_only_if_necessary(shard):
    names = [frame["name"] for frame in shard.content["frames"]]
    shard()
    first = {path.name: sha256(path) for path in shard.views.iterdir()}
    assert sorted(first) == [f"{name}.exr" for name in names]
    assert shard.rendered() == names

    shard()
    assert shard.rendered() == names

    (shard.views / f"{names[1]}.exr").unlink()
    half = shard.views / f"{names[2]}.exr"
    half.write_bytes(half.read_bytes()[: half.stat().st_size // 2])
    shard()
    assert shard.rendered() == [*names, names[1], names[2]]
    assert {path.name: sha256(path) for path in shard.views.iterdir()} == first

    # Another number of samples makes another dataset.
    shard.content["render"]["samples"] = 3
    shard.file.write_text(json.dumps(shard.content))
    shard(views="0:1")
    assert shard.rendered()[-1] == names[0]
    assert sha256(shard.views / f"{names[0]}.exr") != first[f"{names[0]}.exr"]
    assert list(shard.noted("0:1")) == [f"{names[0]}.exr"]


def test_damaged_views_are_rendered_again(shard):
    names = [frame["name"] for frame in shard.content["frames"]]
    shard()
    made = {path.name: sha256(path) for path in shard.views.iterdir()}
    deleted, recoloured, flipped, _ = (shard.views / f"{name}.exr" for name in names)
    deleted.unlink()
    image = images.read_image(recoloured)
    ours = {k: value for k, value in image.attributes.items() if k.startswith("plenoforge:")}
    red = image.channels["R"] + np.float16(1)
    images.write_exr(recoloured, image.channels | {"R": red}, ours)
    assert images.read_image(recoloured).attributes == image.attributes
    content = bytearray(flipped.read_bytes())
    content[len(content) // 2] ^= 1
    flipped.write_bytes(content)
    shard()
    assert {path.name: sha256(path) for path in shard.views.iterdir()} == made
    assert shard.rendered() == [*names, *names[:3]]
    assert shard.noted() == made


def test_a_view_without_a_logged_checksum_is_rendered_again(shard):
    names = [frame["name"] for frame in shard.content["frames"]]
    shard()
    receipt = shard.receipt()
    _, *lines = receipt.read_text().splitlines(keepends=True)
    files = [line for line in lines if "file" in json.loads(line)]
    assert len(files) == len(names)
    history_lines = [line for line in lines if line not in files]
    # The kill came while the last line was being written.
    part = receipt.with_suffix(receipts.PART_SUFFIX)
    part.write_text("".join([*history_lines, *files])[:-20])
    receipt.unlink()
    shard()
    assert shard.rendered() == [*names, names[-1]]
    shard()
    assert shard.rendered() == [*names, names[-1]]


def test_a_view_is_written_while_the_next_is_rendered(shard):
    names = [frame["name"] for frame in shard.content["frames"]]
    shard(program=(BLENDER / "held_writing.py", "waits"))
    assert shard.rendered() == names
    shard()
    assert shard.rendered() == names


def test_a_view_that_cannot_be_written_ends_the_shard_and_keeps_the_views_before(shard):
    names = [frame["name"] for frame in shard.content["frames"]]
    failed = shard(program=(BLENDER / "held_writing.py", "fails"), check=False)
    assert failed.returncode == 1
    assert f"error: {shard.views / names[1]}.exr: no space" in failed.stderr
    assert shard.rendered() == names[:1]
    shard()
    assert shard.rendered() == names


def test_shards_with_other_bounds_keep_finished_views(shard):
    names = [frame["name"] for frame in shard.content["frames"]]
    shard()
    shard(views="1:3")
    assert shard.rendered() == names
    assert shard.noted("1:3").items() < shard.noted().items()
    assert len(shard.noted("1:3")) == 2


def test_bytes_do_not_depend_on_order_threads_or_neighbours(shard):
    shard()
    together = {path.name: sha256(path) for path in shard.views.iterdir()}
    for path in shard.views.iterdir():
        path.unlink()
    for views in ("3:4", "1:3", "0:1"):
        shard("--threads", "2", views=views)
    assert {path.name: sha256(path) for path in shard.views.iterdir()} == together


def test_views_of_another_bpy_are_rendered_again_and_reported(shard):
    shard(views="0:2")
    first, second = sorted(shard.views.iterdir())
    right = sha256(first)
    image = images.read_image(first)
    others = {images.KEY_ATTRIBUTE: "another", images.BPY_ATTRIBUTE: "4.2.0"}
    images.write_exr(first, image.channels, others)
    # Other settings alone are no reason for the report.
    image = images.read_image(second)
    others[images.BPY_ATTRIBUTE] = version("bpy")
    images.write_exr(second, image.channels, others)
    bookkeeping.note_shard(shard.receipt("0:2"), dict.fromkeys((first, second), "another"))
    lines = shard(views="0:2").stderr.splitlines()
    assert [line for line in lines if line.startswith("warning: ")] == [
        f"warning: views rendered by bpy 4.2.0, which bpy {version('bpy')} renders again: 1"
    ]
    assert sha256(first) == right


def test_views_have_the_documented_content(shard):
    render = shard.content["render"] | {"compression": "htj2k", "depth_precision": "rounded"}
    shard.file.write_text(json.dumps(shard.content | {"render": render}))
    shard(views="0:1")
    (path,) = shard.views.iterdir()
    image = images.read_image(path)
    header = OpenEXR.File(str(path), header_only=True).header()
    assert header["compression"] == OpenEXR.HTJ2K256_COMPRESSION
    assert not (np.ascontiguousarray(image.channels["Z"]).view("u4") & 0x7F).any()
    kinds = {name: str(channel.dtype) for name, channel in image.channels.items()}
    assert kinds == {"R": "float16", "G": "float16", "B": "float16", "Z": "float32"}
    assert image.attributes[images.DEPTH_ATTRIBUTE] == "z"
    assert image.attributes[images.NAN_ATTRIBUTE] == 0
    assert image.attributes[images.CLAMPED_ATTRIBUTE] == 0
    assert len(str(image.attributes[images.KEY_ATTRIBUTE])) == 64
    assert image.attributes[images.BPY_ATTRIBUTE] == version("bpy")
    assert not image.attributes.get("DateTime")


def test_colour_beyond_half_is_clamped_and_counted():
    colour = np.array([[[1e6, 2.0, -1e6], [np.nan, np.inf, 0.5]]], dtype=np.float32)
    channels, attributes = shards.colour_channels(colour)
    assert attributes[images.CLAMPED_ATTRIBUTE] == 3
    assert attributes[images.NAN_ATTRIBUTE] == 1
    assert channels["R"][0, 0] == 65504
    assert channels["B"][0, 0] == -65504
    assert np.isnan(channels["R"][0, 1])


def test_depth_in_half_keeps_its_misses():
    camera = {"lens": "equirectangular", "resolution": [2, 1]}
    content = lightfield(camera, {"depth_precision": "half"})
    z = shards.depth_channel(np.array([[3.0, np.inf]], dtype=np.float32), content, None)
    assert z.dtype == np.float16
    assert z[0, 0] == 3
    assert np.isposinf(z[0, 1])


def test_a_missing_device_is_an_error(shard):
    # No machine has both Apple's Metal and the Debian libraries that the tests need.
    device = "metal"
    result = shard("--device", device, check=False)
    assert result.returncode == 1
    errors = [line for line in result.stderr.splitlines() if line.startswith("error: ")]
    assert errors == [
        f"error: device: this machine has no {device} device that Cycles can use; "
        "use device=cpu, or device=auto to use the best device here"
    ]
    assert not shard.views.exists()


WORLDS = """
import bpy, sys
for name, colour in (("ACEScg", (0.4, 0.2, 0.1)), ("Linear Rec.709", sys.argv[2:])):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.set_working_color_space(working_space=name, convert_colors=False)
    bpy.context.scene.world = world = bpy.data.worlds.new("world")
    (background,) = [n for n in world.node_tree.nodes if n.bl_idname == "ShaderNodeBackground"]
    background.inputs["Color"].default_value = (*map(float, colour), 1)
    bpy.ops.wm.save_as_mainfile(filepath=f"{sys.argv[1]}/{name}.blend")
"""
# From AP1 with the white of ACES, adapted with Bradford's matrix.
ACES_TO_REC_709 = [
    [1.70505, -0.62179, -0.08326],
    [-0.13026, 1.14080, -0.01055],
    [-0.02400, -0.12897, 1.15297],
]


def test_colours_are_rec_709_whatever_space_a_blend_works_in(run_program, tmp_path):
    (tmp_path / "make.py").write_text(WORLDS)
    expected = np.array(ACES_TO_REC_709) @ (0.4, 0.2, 0.1)
    run_program(tmp_path / "make.py", tmp_path, *expected)
    camera = {"lens": "rectilinear", "fov": 60, "resolution": [16, 16]}
    content = lightfield(camera, RENDER | {"passes": ["environment"]})
    content.write(tmp_path / "lightfield.json")
    colours = []
    for name in ("ACEScg", "Linear Rec.709"):
        arguments = ("--blend", tmp_path / f"{name}.blend", "--output", tmp_path / name / "exr")
        run_program("render_shard.py", *arguments, "--lightfield", tmp_path / "lightfield.json")
        for folder in ("exr", "environment"):
            (path,) = (tmp_path / name / folder).iterdir()
            colours.append(images.read_image(path, "RGB").colour)
    for colour in colours:
        parts = colour / colour.sum(axis=-1, keepdims=True)
        assert np.abs(parts - expected / expected.sum()).max() < 1e-3
        np.testing.assert_allclose(colour, colours[-1], rtol=2e-3)
