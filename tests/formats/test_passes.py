"""The passes, compared with known surfaces, ray casts, and the colour that they add up to."""

import filecmp
import json
import re
import shutil
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import BLENDER, SCRIPTS
from pass_views import LENSES, RENDER, SIZE, WALL
from scipy.ndimage import binary_dilation, binary_erosion

from lightfield.configuration.scene_yaml import Scene
from lightfield.core.errors import UserError
from lightfield.core.files import read_json, sha256
from lightfield.engine import receipts
from lightfield.engine.receipts import made_in
from lightfield.export.source import SourceDataset
from lightfield.formats.lightfield import LightField
from lightfield.formats.passes import PARTS_OF_LIGHT, PASSES
from lightfield.formats.render_block import RenderBlock
from lightfield.geometry import lenses
from lightfield.imaging import images
from lightfield.rendering.views import shard
from lightfield.validation.validate import validate


@pytest.fixture(scope="module")
def made(tmp_path_factory, run_program):
    folder = tmp_path_factory.mktemp("passes")
    run_program(BLENDER / "pass_views.py", folder)
    return folder


def noted(made, name):
    """Return the files in the receipt of a dataset, by their paths in it."""
    return made_in(made / name, [made / f"receipts/{name}.jsonl"], None)


def read(folder, name, view="view_0000f"):
    """Return the pixels (h, w, channels) of a pass, or of the colour."""
    if name == "exr":
        return images.read_image(folder / "exr" / f"{view}.exr").colour
    channels = images.read_image(PASSES[name].path(folder, view)).channels
    assert {key: str(plane.dtype) for key, plane in channels.items()} == dict.fromkeys(
        PASSES[name].channels, PASSES[name].dtype
    )
    return np.stack([channels[key] for key in PASSES[name].channels], axis=-1)


@pytest.mark.parametrize("lens", LENSES)
def test_objects_are_those_of_ray_casts_with_common_numbers(lens, made):
    numbers = read_json(made / lens / "object" / "names.json")
    assert list(numbers.values()) == list(range(1, len(numbers) + 1))
    assert list(numbers) == sorted(numbers) and "a hidden one" not in numbers
    assert numbers == read_json(made / "perspective" / "object" / "names.json")
    cast = np.load(made / "objects.npz")[lens]
    assert {"floor", "wall", "ball", "metal", "glow", "twin"} <= set(cast.ravel())
    expected = np.vectorize(lambda name: numbers.get(name, 0))(cast)
    np.testing.assert_array_equal(read(made / lens, "object")[..., 0], expected)
    materials = read_json(made / lens / "material" / "names.json")
    material_numbers = read(made / lens, "material")[..., 0]
    painted = {"floor": "grey", "wall": "red", "ball": "glass", "twin": "glow"}
    for object_name, surface in painted.items():
        assert set(material_numbers[cast == object_name]) == {materials[surface]}


@pytest.mark.parametrize("lens", LENSES)
def test_normals_are_those_of_the_planes_in_world_space(lens, made):
    cast, normal = np.load(made / "objects.npz")[lens], read(made / lens, "normal")
    for object_name, expected_normal in {"floor": (0, 0, 1), "wall": (0, -1, 0)}.items():
        angle = np.linalg.norm(normal[cast == object_name] - expected_normal, axis=-1)
        assert angle.max() < 1e-5
    lengths = np.linalg.norm(normal, axis=-1)
    np.testing.assert_allclose(lengths[cast != ""], 1, atol=1e-5)
    assert not lengths[read(made / lens, "object")[..., 0] == 0].any()


@pytest.mark.parametrize("lens", LENSES)
def test_motion_is_the_walls_movement_through_the_lens(lens, made):
    content = LightField.read(made / lens / "lightfield.json")
    cast, motion = np.load(made / "objects.npz")[lens], read(made / lens, "motion")
    view, on_wall = content.views[0], cast == "wall"
    rays = content.lens.pixel_rays()[on_wall] @ view.world_from_camera[:3, :3].T
    points = rays * ((WALL[1][1] - view.position[1]) / rays[:, 1:2])
    for frame, wall_motion in ((0, motion[on_wall][:, :2]), (2, motion[on_wall][:, 2:])):
        moved = points + np.subtract(WALL[frame], WALL[1])
        truth = content.lens.pixels(moved @ view.world_from_camera[:3, :3])
        truth -= content.lens.pixels(points @ view.world_from_camera[:3, :3])
        if lens == "panorama":
            truth[:, 0] -= 2 * SIZE * np.rint(truth[:, 0] / (2 * SIZE))
        assert np.abs(truth).max() > 0.3
        np.testing.assert_allclose(wall_motion, truth, atol=1e-3)
    assert not motion[~on_wall].any()


def test_motion_across_the_seam_of_a_panorama_is_the_short_one():
    lens = lenses.from_camera(LENSES["panorama"])
    motion = np.array([[[60, 1, -61.5, 2]]], np.float32)
    geometry = SimpleNamespace(passes={"motion": motion})
    channels, _ = shard.pass_channels(PASSES["motion"], geometry, None, lens)
    assert [plane.item() for plane in channels.values()] == [-4, 1, 2.5, 2]


def test_light_beyond_the_half_limit_is_clamped_and_counted():
    colour = np.array([[[70_000, -70_000, 65_504], [1, -1, 0]]], np.float32)
    channels, attributes = shard.colour_channels(colour)
    assert attributes[images.CLAMPED_ATTRIBUTE] == 2
    assert [channels[name][0, 0] for name in "RGB"] == [65_504, -65_504, 65_504]


def test_values_that_are_not_numbers_are_counted_and_become_0():
    wrong = np.array([[[np.nan, np.nan, np.nan], [0, 0, 1]]], np.float32)
    lens = lenses.from_camera(LENSES["panorama"])
    for name in ("normal", "diffuse_light"):
        view = SimpleNamespace(passes={name: wrong})
        channels, attributes = shard.pass_channels(PASSES[name], view, view, lens)
        assert attributes[images.NAN_ATTRIBUTE] == 3
        assert [plane[0].tolist() for plane in channels.values()] == [[0, 0], [0, 0], [0, 1]]


# They are the same on any process, machine and version of Blender.
INSTANCES = {
    "bare": 2,
    "floor": 4,
    "place 0 > ball 0": 3259591936,
    "place 0 > card 1": 1834902912,
    "place 1 > ball 0": 4012807424,
    "place 1 > card 1": 1077517824,
    "place 2 > ball 0": 3691149568,
    "place 2 > card 1": 1930785280,
    "row": 5,
    "row > ball 0 0": 3292252672,
    "row > ball 0 1": 3466653184,
    "row > ball 0 2": 1478244096,
}


@pytest.mark.parametrize("lens", ["fisheye", "perspective"])
def test_instances_are_told_apart_behind_invisible_surfaces(lens, made):
    folder = made / f"instances_{lens}"
    assert read_json(folder / "instance" / "names.json") == INSTANCES
    cast = np.load(made / f"instances_{lens}.npy")
    balls = {name for name in INSTANCES if "ball" in name}
    assert {"bare", "floor", *balls} <= set(cast.ravel())
    expected = np.vectorize(lambda name: INSTANCES.get(str(name), 0))(cast)
    np.testing.assert_array_equal(read(folder, "instance")[..., 0], expected)


def test_instances_do_not_change_the_colour(made):
    colour, plain = (read(made / f"instances_{name}", "exr") for name in ("perspective", "plain"))
    np.testing.assert_array_equal(colour, plain)


@pytest.mark.parametrize("lens", ["fisheye", "perspective"])
def test_bumps_have_no_normal_at_the_rim_and_validation_warns(lens, made):
    """Cycles computes bumps from neighbouring pixels' rays, and some of these see nothing there."""
    folder = made / f"instances_{lens}"
    hit = read(folder, "instance")[..., 0] > 0
    lost = hit & ~read(folder, "normal").any(axis=-1)
    seen = np.isfinite(LightField.read(folder / "lightfield.json").lens.pixel_rays()[..., 0])
    assert not lost[binary_erosion(seen, iterations=2, border_value=1)].any()
    count = images.attribute(folder / "normal/view_0000f.exr", images.NAN_ATTRIBUTE)
    assert count == 3 * lost.sum() and lost.any() == (lens == "fisheye")
    (check,) = (check for check in validate(folder).checks if check.name == "passes")
    (warning,) = check.warnings or [None]
    assert check.passed and (warning is None) == (lens == "perspective")
    assert warning is None or "in normal were not numbers" in warning


@pytest.mark.parametrize("eye", [0, 1])
def test_the_eyes_of_an_omnidirectional_pair_circle_their_centre(eye, made):
    """The rays start on a circle that they touch, as in Ishiguro et al. 1992."""
    view = f"view_0000f_{('left', 'right')[eye]}"
    numbers, casts = read_json(made / "eyes/object/names.json"), np.load(made / "objects.npz")
    expected = np.vectorize(lambda name: numbers.get(name, 0))(casts[f"eye {eye}"])
    numbers_in_pass = read(made / "eyes", "object", view)[..., 0]
    assert (numbers_in_pass == expected).mean() > 0.998
    centre = np.vectorize(lambda name: numbers.get(name, 0))(casts[f"eye {1 - eye}"])
    assert (numbers_in_pass == centre).mean() < 0.97
    assert "Z" not in images.read_header(made / f"eyes/exr/{view}.exr").channels


def test_views_without_a_centre_are_not_reprojected_nor_exported(made, tmp_path, run_program):
    source = made / "eyes"
    arguments = ("--input-cfg", source / "lightfield.json")
    folders = ("--input-dir", source / "exr", "--output-dir", tmp_path)
    for program in (
        ("reproject.py", *arguments, *folders, "--png", "--rectilinear", "18,36"),
        ("export_instant_ngp.py", *arguments, "--output", tmp_path / "transforms.json"),
    ):
        refused = run_program(*program, check=False)
        assert refused.returncode == 1
        assert "omnidirectional_stereo: its views have no centre" in refused.stderr
    assert not list(tmp_path.iterdir())
    with pytest.raises(UserError, match="its views have no centre"):
        _ = SourceDataset(source, "", ".exr").lightfield


def mattes(folder):
    """Return the part (h, w) of each pixel that each object covers, by the object's name."""
    channels = read(folder, "cryptomatte")
    header = images.read_header(PASSES["cryptomatte"].path(folder, "view_0000f")).attributes
    manifest = json.loads(header["cryptomatte/3ae39a5/manifest"])
    hashes = {name: np.array(int(text, 16), np.uint32) for name, text in manifest.items()}
    return {
        name: (channels[..., 1::2] * (channels[..., ::2].view(np.uint32) == number)).sum(axis=-1)
        for name, number in hashes.items()
    }


def seen_by_fisheye(made):
    lens = LightField.read(made / "fisheye/lightfield.json").lens
    return np.isfinite(lens.pixel_rays()[..., 0])


def in_fog(folder):
    """Return the pixels (h, w) in which a path may have met the fog."""
    return binary_dilation(read(folder, "volume_light").any(axis=-1), iterations=2)


@pytest.mark.parametrize("lens", LENSES)
def test_a_matte_is_the_part_of_samples_that_hit_the_object(lens, made):
    part_of, cast = mattes(made / lens), np.load(made / "objects.npz")[lens]
    clear = ~in_fog(made / lens)
    for name in ("floor", "wall", "ball", "metal"):
        samples = part_of[name][clear] * RENDER["samples"]
        np.testing.assert_allclose(samples, np.rint(samples), atol=1e-5)
        # Inside the object, the pixel shows nothing else.
        inside = clear & binary_erosion(cast == name, np.ones((5, 5)))
        assert (part_of[name][inside] == 1).all()
        assert part_of[name][cast == name].mean() > 0.7
    covered = sum(part_of.values())
    np.testing.assert_array_less(covered[clear], 1 + 1e-6)
    edges = (part_of["wall"] > 0) & (part_of["wall"] < 1) & clear
    assert edges.sum() > 20


def test_alpha_is_the_sum_of_the_mattes_and_other_programs_read_them(made):
    alpha = images.read_image(made / "transparent/exr/view_0000f.exr").channels["A"]
    part_of = mattes(made / "transparent")
    # Glass has less alpha. Outside the image circle, Cycles' alpha is opaque.
    solid = binary_erosion(seen_by_fisheye(made), iterations=2) & (part_of["ball"] == 0)
    solid &= ~in_fog(made / "transparent")
    np.testing.assert_allclose(sum(part_of.values())[solid], alpha[solid], atol=1e-3)
    # Blender's compositor finds the object by the hash of its name.
    read_there = images.read_image(made / "matte.exr", ["R"]).channels["R"]
    wall = mattes(made / "perspective")["wall"]
    np.testing.assert_array_equal(read_there, wall)
    assert 0.3 < wall.mean() < 0.9


@pytest.mark.parametrize("lens", LENSES)
def test_the_parts_of_light_add_up_to_the_colour(lens, made):
    parts = {name: read(made / lens, name).astype(np.float64) for name in PARTS_OF_LIGHT}
    cast = np.load(made / "objects.npz")[lens]
    assert parts["diffuse_light"][cast == "floor"].mean() > 0.1
    assert parts["transmission_light"][cast == "ball"].mean() > 0.1
    assert parts["volume_light"].max() > 0.01
    assert parts["emission"][cast == "twin"].mean() > 0.3
    assert np.median(parts["environment"][cast == "wall"]) == 0
    # Seven values are rounded to a half's 11 bits. No part is greater than the colour.
    colour = read(made / lens, "exr")
    np.testing.assert_allclose(sum(parts.values()), colour, rtol=2**-10, atol=1e-6)
    red = read(made / lens, "albedo")[cast == "wall"]
    assert np.median(red[:, 0]) > 3 * np.median(red[:, 1])


@pytest.mark.parametrize("view", ["view_0000f", "view_0001f"])
def test_geometry_is_the_same_beside_a_denoised_colour(view, made):
    for name in ("normal", "object", "material"):
        denoised = read(made / "denoised", name, view)
        np.testing.assert_array_equal(denoised, read(made / "perspective", name, view))


def test_colour_and_depth_are_the_same_without_passes(made):
    plain, with_passes = (
        images.read_image(made / name / "exr" / "view_0000f.exr").channels
        for name in ("without_variance", "plain")
    )
    for channel in "RGBZ":
        np.testing.assert_array_equal(plain[channel], with_passes[channel])
    assert {path.name for path in (made / "plain").iterdir()} == {"exr", "lightfield.json"}


def test_transparent_views_have_alpha_in_place_of_the_world(made):
    image = images.read_image(made / "transparent" / "exr" / "view_0000f.exr")
    alpha, opaque = image.channels["A"], read(made / "fisheye", "exr")
    assert alpha.dtype == np.float16
    cast = np.load(made / "objects.npz")["fisheye"]
    seen = seen_by_fisheye(made)
    assert not alpha[~seen].any() and np.median(alpha[cast == "wall"]) == 1
    assert np.median(alpha[seen & (cast == "")]) == 0
    assert ((alpha > 0) & (alpha < 1)).sum() > 20
    # Alpha is associated: composited over the world, it is the opaque view.
    parts = {name: read(made / "transparent", name).astype(np.float64) for name in PARTS_OF_LIGHT}
    world = parts.pop("environment")
    np.testing.assert_allclose(image.colour + world, opaque, rtol=2**-9, atol=1e-6)
    np.testing.assert_allclose(sum(parts.values()), image.colour, rtol=2**-10, atol=1e-6)


def test_a_view_without_one_of_its_files_is_rendered_again(made):
    receipt = receipts.read(made / "receipts/perspective.jsonl")
    rendered = [line["view"] for line in receipt.history if "view" in line]
    assert rendered == ["view_0000f", "view_0001f", "view_0001f"]
    assert set(read_json(made / "again.json").values()) == {True}
    files = noted(made, "perspective")
    assert len(files) == len(receipt.outputs) == 2 * (1 + len(PASSES)) + 3
    for name, output in files.items():
        assert output.stamp.sha256 == sha256(made / "perspective" / name)


def shard_arguments(made, folder, views, threads):
    """Return the arguments to render the views of the scene with everything, as a job does."""
    return [
        "--blend",
        made / "everything.blend",
        "--lightfield",
        made / "perspective/lightfield.json",
        "--views",
        views,
        "--device",
        "cpu",
        "--threads",
        str(threads),
        "--output",
        folder / "dataset/exr",
        "--receipt",
        folder / f"receipts/{views.replace(':', '-')}.jsonl",
    ]


def test_kills_threads_and_shards_change_no_byte(made, tmp_path, run_program):
    killed, parts = tmp_path / "killed", tmp_path / "parts"
    whole = shard_arguments(made, killed, "0:2", 1)
    # A fork would live on for a moment after its client is killed.
    command = [sys.executable, SCRIPTS / "render_shard.py", *whole]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    while not (killed / "dataset/environment/view_0000f.exr").exists():
        assert process.poll() is None
        time.sleep(0.01)
    process.kill()
    process.wait()
    assert not (killed / "dataset/environment/view_0001f.exr").exists()
    run_program("render_shard.py", *whole)
    for views in ("0:1", "1:2"):
        run_program("render_shard.py", *shard_arguments(made, parts, views, 2))
    names = [*noted(made, "perspective")]
    for folder in (killed, parts):
        _, wrong, errors = filecmp.cmpfiles(made / "perspective", folder / "dataset", names, False)
        assert (wrong, errors) == ([], [])


def spoil_ids(folder):
    path = folder / "object" / "view_0000f.exr"
    images.write_exr(path, {"Y": np.full((SIZE, SIZE), 99, np.uint32)})


def spoil_normals(folder):
    planes = dict.fromkeys("RGB", np.full((SIZE, SIZE), 0.7, np.float32))
    images.write_exr(folder / "normal" / "view_0001f.exr", planes)


def spoil_light(folder):
    planes = dict.fromkeys("RGB", np.full((SIZE, SIZE), np.nan, np.float16))
    images.write_exr(folder / "emission" / "view_0001f.exr", planes)


def spoil_matte(folder):
    path = folder / "cryptomatte" / "view_0001f.exr"
    image = images.read_image(path)
    planes = image.channels | {"CryptoObject00.R": np.ones((SIZE, SIZE), np.float32)}
    header = {name: text for name, text in image.attributes.items() if "cryptomatte" in name}
    images.write_exr(path, planes, header)


SPOILED = {
    "nothing": (lambda folder: None, None),
    "missing": (
        lambda folder: (folder / "albedo" / "view_0001f.exr").unlink(),
        "albedo/view_0001f.exr: is missing",
    ),
    "ids": (spoil_ids, "object/view_0000f.exr: has [99], which object/names.json does not have"),
    "normals": (spoil_normals, "normal/view_0001f.exr: 1024 normals are not unit vectors"),
    "light": (spoil_light, "emission/view_0001f.exr: 3072 values are not finite"),
    "matte": (
        spoil_matte,
        "cryptomatte/view_0001f.exr: has 1 objects that its manifest does not have",
    ),
    "kind": (
        lambda folder: shutil.copy(folder / "normal/view_0000f.exr", folder / "object"),
        "object/view_0000f.exr: has the channels B:float32 G:float32 R:float32; must have Y:uint32",
    ),
}


@pytest.mark.parametrize("what", SPOILED)
def test_validation_checks_each_pass(what, made, tmp_path):
    folder = tmp_path / "perspective"
    shutil.copytree(made / "perspective", folder)
    spoil, problem = SPOILED[what]
    spoil(folder)
    result = validate(folder, made=noted(made, "perspective"))
    checks = {check.name: check for check in result.checks}
    assert checks["passes"].problems == ([problem] if problem else [])
    assert checks["checksums"].passed is (problem is None)
    assert checks["files"].passed
    if not problem:
        assert result.valid and set(result.checksums) == {
            *noted(made, "perspective"),
            "lightfield.json",
        }


def test_reprojected_passes_keep_their_meaning(made, tmp_path, reproject_dataset):
    """A perspective view reprojected from the fisheye's, compared with the rendered one."""
    names = [name for name in PASSES if name != "motion"]
    source, target = made / "fisheye", tmp_path / "perspective"
    settings = {"camera": LENSES["perspective"], "filter": "bilinear"}
    settings |= {"formats": ["exr"], "passes": names}
    receipt = tmp_path / "receipts/0-2.jsonl"
    sources = ("--source-receipt", made / "receipts/fisheye.jsonl")
    reproject_dataset(source, target, settings, *sources, "--receipt", receipt)
    content = LightField.read(target / "lightfield.json")
    assert [render_pass.name for render_pass in content.passes] == names
    files = made_in(target, [receipt], None)
    assert len(files) == 2 * (1 + len(names)) + 1
    assert {"normal/view_0000f.exr", "lightfield.json"} < set(files)
    numbers = read_json(source / "object" / "names.json")
    ids, truth = (read(folder, "object")[..., 0] for folder in (target, made / "perspective"))
    assert set(np.unique(ids)) <= set(np.unique(read(source, "object")))
    # A source pixel is three of these wide. At its edges they differ.
    assert (ids == truth).mean() > 0.85
    matte, original = (read(folder, "cryptomatte") for folder in (target, source))
    pairs = {tuple(pair) for pair in original.reshape(-1, 12)[:, :2].tolist()}
    assert {tuple(pair) for pair in matte.reshape(-1, 12)[:, :2].tolist()} - pairs == set()
    assert mattes(target)["wall"][truth == numbers["wall"]].mean() > 0.9
    normal, expected_normal = read(target, "normal"), read(made / "perspective", "normal")
    np.testing.assert_allclose(np.linalg.norm(normal, axis=-1)[truth > 0], 1, atol=1e-5)
    cosine = np.sum(normal * expected_normal, axis=-1)
    assert np.median(cosine[truth > 0]) > 1 - 1e-6
    total = sum(read(target, name).astype(np.float64) for name in PARTS_OF_LIGHT)
    # The bilinear filter has no negative lobes, which would change the sum of clamped parts. All
    # values are rounded before and after.
    colour = images.read_image(target / "view_0000f.exr").colour
    np.testing.assert_allclose(total, colour, rtol=2**-9, atol=1e-6)


EYES = {"stereo": {"distance": 0.06, "omnidirectional": True}}


@pytest.mark.parametrize(
    ("lens", "more", "problem"),
    [
        ("fisheye", {}, "rigs.one.stereo.omnidirectional: needs the lens equirectangular"),
        ("panorama", {"flow": {"pairs": "neighbours"}}, "flow: does not go with rigs.one.stereo"),
        (
            "panorama",
            {"render": {"samples": 1, "passes": ["motion"]}},
            "render.passes: motion does not go with rigs.one.stereo",
        ),
        (
            "panorama",
            {"reprojections": {"flat": {"camera": LENSES["perspective"]}}},
            "reprojections.flat: does not go with rigs.one.stereo",
        ),
        (
            "panorama",
            {"exports": {"poses_csv": {"sources": ["views"]}}},
            "views: the rig one has views without a centre",
        ),
    ],
)
def test_omnidirectional_pairs_refuse_settings_that_need_a_centre(lens, more, problem):
    rig = {"type": "lattice", "cameras": [1, 1, 1], "camera": LENSES[lens], **EYES}
    content = {"scene": {"builder": "room"}, "render": {"samples": 1}, "rigs": {"one": rig}}
    with pytest.raises(ValueError, match=re.escape(problem)):
        Scene.model_validate(content | more)
    Scene.model_validate(content | {"rigs": {"one": rig | {"camera": LENSES["panorama"]}}})


def scene(**render):
    rig = {"type": "lattice", "cameras": [1, 1, 1], "camera": LENSES["fisheye"]}
    again = {"passes": render.pop("again")} if "again" in render else {}
    reprojection = {"camera": LENSES["perspective"], **again}
    return {
        "scene": {"builder": "room"},
        "render": {"samples": 1, **render},
        "rigs": {"one": rig},
        "reprojections": {render.pop("folder", "other"): reprojection},
    }


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        ({"passes": ["normals"]}, "each once, of normal, object"),
        ({"passes": []}, "each once, of normal, object"),
        ({"passes": ["normal", "normal"]}, "each once, of normal, object"),
        ({"passes": ["normal"], "again": ["object"]}, "other.passes: object is not in render."),
        ({"passes": ["motion"], "again": ["motion"]}, "other.passes: motion is in pixels of"),
    ],
)
def test_impossible_passes_are_refused(wrong, problem):
    with pytest.raises(ValueError, match=problem):
        Scene.model_validate(scene(**wrong))


def test_passes_keep_the_tables_order_and_their_absence_changes_nothing():
    content = Scene.model_validate(scene(passes=["emission", "normal"], again=["normal"]))
    assert content.render.passes == ["normal", "emission"]
    assert content.developments["other"].passes == ["normal"]
    bare = Scene.model_validate(scene())
    assert "passes" not in bare.render.model_dump(exclude_none=True)
    assert bare.developments["other"].passes == []
    bare = RenderBlock(**RENDER).without_passes
    assert bare.to_json().keys() == RENDER.keys() - {"passes"}
