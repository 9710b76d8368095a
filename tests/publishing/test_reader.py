"""read.py of a package and of shards: it reads them as `open_dataset` does, without Plenoforge."""

import json
import re
import subprocess
import sys

import exr_windows
import numpy as np
import pytest
from checkouts import ROOT
from geometry.test_lenses import EXAMPLES, grid
from reading.test_reading import CAMERA, CREDITS, RIG, finish, write_dataset, write_sequence
from sphere import LENSES, make_transparent, write_views

from lightfield import open_dataset
from lightfield.configuration.publication import Credits
from lightfield.formats.lightfield import LightField
from lightfield.geometry.lenses.cube_map import CubeMap
from lightfield.imaging import images
from lightfield.imaging.primaries import ACESCG, from_rec_709
from lightfield.publishing import package
from lightfield.publishing.publish import publish
from lightfield.publishing.read import PlainLens, open_views

READER = ROOT / "scripts/lightfield/publishing/read.py"


# Prints nothing. Writes all arrays of the views of each reprojection, and which views there are.
PROGRAM = """
import importlib.util
import sys

import numpy as np
from read import open_views

assert importlib.util.find_spec("lightfield") is None
arrays = {}
for name in NAMES:
    views = open_views(name)
    arrays[f"{name}/names"] = [view.name for view in views]
    arrays[f"{name}/splits"] = [view.split or "" for view in views]
    arrays[f"{name}/poses"] = [view.world_from_camera for view in views]
    for array in ("rgb", "alpha", "depth", "z", "distance", "normal"):
        try:
            arrays[f"{name}/{array}"] = [getattr(view, array) for view in views]
        except (FileNotFoundError, KeyError, RuntimeError, TypeError):
            pass
    arrays[f"{name}/rays"] = views[0].rays()
    pixels, visible = views[0].project(POINTS)
    arrays[f"{name}/pixels"], arrays[f"{name}/visible"] = pixels, visible
np.savez("arrays.npz", **arrays)
"""
POINTS = np.random.default_rng(1).normal(size=(400, 3)).tolist()
ARRAYS = ("rgb", "alpha", "depth", "z", "distance", "normal")


def read(folder, reprojections=()):
    """Return what read.py in a folder reads, in a process that cannot import Plenoforge."""
    values = f"POINTS = {POINTS}\nNAMES = {['', *reprojections]}\n"
    (folder / "program.py").write_text(f"{values}{PROGRAM}")
    program = ("-P", "-c", "import sys; sys.path.insert(0, '.'); import program")
    environment = {"PATH": "", "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run([sys.executable, *program], cwd=folder, env=environment, check=True)
    return dict(np.load(folder / "arrays.npz"))


def unpacked(dataset, folder):
    card = package.card(dataset, "room_rig", Credits())
    (archive,) = package.pack(dataset, card, folder / "room_rig.tar", None)
    subprocess.run(["tar", "-xf", archive, "-C", folder], check=True)
    return folder / "room_rig"


def shards(dataset, folder):
    publish(dataset, "room_rig", Credits.model_validate(CREDITS), folder / "shards", 30_000)
    return folder / "shards"


def compare(arrays, data):
    """Compare the arrays that a read.py has read with those of the library. Return their names."""
    compared = set()
    for name, dataset in {"": data, **data.reprojections}.items():
        views = dataset.views
        assert arrays[f"{name}/names"].tolist() == [view.name for view in views]
        assert arrays[f"{name}/splits"].tolist() == [view.split or "" for view in views]
        poses = [view.world_from_camera for view in views]
        np.testing.assert_array_equal(arrays[f"{name}/poses"], poses)
        for array in ARRAYS:
            if f"{name}/{array}" in arrays:
                mine = arrays[f"{name}/{array}"]
                assert mine.dtype == np.float32
                np.testing.assert_allclose(mine, [getattr(view, array) for view in views], 1e-6)
                compared.add(f"{name}/{array}")
        np.testing.assert_allclose(arrays[f"{name}/rays"], views[0].rays(), atol=1e-12)
        pixels, visible = views[0].project(POINTS)
        np.testing.assert_allclose(arrays[f"{name}/pixels"], pixels, atol=1e-6)
        np.testing.assert_array_equal(arrays[f"{name}/visible"], visible)
        assert visible.any()
    return compared


@pytest.mark.parametrize("form", [unpacked, shards])
def test_it_reads_what_the_library_reads(form, tmp_path):
    folder = form(write_dataset(tmp_path / "dataset"), tmp_path)
    data = open_dataset(folder)
    compared = compare(read(folder, data.reprojections), data)
    # Opaque views have an alpha of 1.
    assert (data.views[0].alpha == 1).all()
    own = {"/rgb", "/alpha", "/depth", "/z", "/distance", "/normal"}
    assert compared == {*own, *(f"panorama{array}" for array in own), *FACES}


# The faces of a cube map have no passes, and their depth is "z". Perspective is PNG.
FACES = {f"faces/{array}" for array in ("rgb", "alpha", "depth", "z", "distance")}


@pytest.mark.parametrize("form", [unpacked, shards])
def test_it_reads_all_frames_of_a_sequence(form, tmp_path):
    folder = form(write_sequence(tmp_path / "sequence"), tmp_path)
    data = open_dataset(folder)
    arrays = read(folder, data.reprojections)
    assert len(arrays["/rgb"]) == len(arrays["perspective/rgb"]) == 18
    compare(arrays, data)


@pytest.mark.parametrize("form", [unpacked, shards])
def test_it_reads_alpha_other_primaries_and_a_camera_without_depth(form, tmp_path):
    dataset = tmp_path / "dataset"
    write_views(dataset, CAMERA, RIG)
    make_transparent(dataset, 0.5)
    write_views(dataset / "aces", LENSES["perspective"], RIG)
    for path in (dataset / "lightfield.json", dataset / "aces/lightfield.json"):
        LightField.read(path).changed(scene={"name": "room"}).write(path)
    for path in dataset.glob("aces/*.exr"):
        image = images.read_image(path)
        colour = from_rec_709(image.colour, "acescg")
        planes = dict(zip("RGB", np.moveaxis(colour, -1, 0), strict=True))
        images.write_exr(path, planes, image.attributes, chromaticities=ACESCG)
    path = dataset / "aces/lightfield.json"
    LightField.read(path).changed(depth=None).write(path)
    folder = form(finish(dataset), tmp_path)
    data = open_dataset(folder)
    compared = compare(read(folder, data.reprojections), data)
    own = {"/rgb", "/alpha", "/depth", "/z", "/distance"}
    assert compared == {*own, "aces/rgb", "aces/alpha"}


@pytest.mark.parametrize("form", [unpacked, shards])
def test_it_reads_views_whose_files_store_other_pixels(form, tmp_path):
    dataset = write_dataset(tmp_path / "dataset")
    exr_windows.crop(dataset / "exr/view_0001f.exr", slice(3, 12), slice(4, 20))
    exr_windows.widen(dataset / "panorama/view_0002f.exr")
    finish(dataset)
    folder = form(dataset, tmp_path)
    data = open_dataset(folder)
    compared = compare(read(folder, data.reprojections), data)
    assert compared >= {"/rgb", "/depth", "panorama/rgb", "panorama/depth"}


def test_it_has_no_rays_for_omnidirectional_stereo(tmp_path):
    dataset = tmp_path / "dataset"
    write_views(dataset, LENSES["panorama"], RIG)
    path = dataset / "lightfield.json"
    keys = {"scene": {"name": "room"}, "omnidirectional_stereo": 0.065}
    LightField.read(path).changed(**keys).write(path)
    arrays = read(unpacked(finish(dataset), tmp_path))
    assert arrays["/rgb"].shape == (6, 32, 64, 3)
    origins, _ = arrays["/rays"]
    assert np.isnan(origins).all()
    assert not arrays["/visible"].any()


@pytest.mark.parametrize("form", [unpacked, shards])
def test_an_unknown_reprojection_is_named_with_what_there_is(form, tmp_path):
    folder = form(write_dataset(tmp_path / "dataset"), tmp_path)
    with pytest.raises(ValueError, match=r"no views 'perspectiv'.*'faces', .*'perspective'"):
        open_views("perspectiv", folder)


def test_missing_shards_are_named(tmp_path):
    folder = shards(write_dataset(tmp_path / "dataset"), tmp_path)
    missing = folder / "room_rig-train-00001.tar"
    missing.unlink()
    with pytest.raises(FileNotFoundError, match=re.escape(str(missing))):
        open_views(folder=folder)
    # Without the list, as in a family, what is there is read.
    (folder / "sha256sums.txt").unlink()
    assert 0 < len(open_views(folder=folder)) < 6


def test_all_packages_and_shards_have_the_same_file(tmp_path):
    folder = shards(write_dataset(tmp_path / "dataset"), tmp_path)
    sequence = unpacked(write_sequence(tmp_path / "sequence"), tmp_path)
    source = READER.read_bytes()
    assert (folder / "read.py").read_bytes() == (sequence / "read.py").read_bytes() == source


def test_it_is_short_and_needs_numpy_and_openexr_alone():
    source = READER.read_text()
    assert len(source.splitlines()) <= 325
    imported = {name.split(".")[0] for name in re.findall(r"^(?:import|from) (\S+)", source, re.M)}
    assert imported - sys.stdlib_module_names == {"numpy", "OpenEXR"}


@pytest.mark.parametrize("name", EXAMPLES)
def test_its_lens_is_the_librarys(name):
    """A lens that fails here is missing in the table of publishing/read.py's PlainLens."""
    lens = EXAMPLES[name]
    if isinstance(lens, CubeMap):
        # No dataset has this lens: each face is an image of its own.
        lens = lens.face
    own = PlainLens(json.loads(json.dumps(lens.to_lightfield())))
    x, y = grid(lens, np.float64)
    rays = lens.rays(x, y)
    np.testing.assert_allclose(own.rays(x, y), rays, rtol=0, atol=1e-12)
    points = np.random.default_rng(1).normal(size=(20_000, 3))
    rays = np.concatenate([points, rays[np.isfinite(rays[..., 0])]])
    own_pixels, pixels = own.pixels(rays), lens.pixels(rays)
    inside = lens.in_frame(pixels)
    np.testing.assert_allclose(own_pixels[inside], pixels[inside], rtol=0, atol=1e-9)
    # Pixels far outside the frame have fewer digits.
    np.testing.assert_allclose(own_pixels, pixels, rtol=1e-10, atol=1e-9)
    lens = lens.fitted(48)
    own = PlainLens(json.loads(json.dumps(lens.to_lightfield())))
    np.testing.assert_allclose(own.pixel_rays(), lens.pixel_rays(), rtol=1e-7)
