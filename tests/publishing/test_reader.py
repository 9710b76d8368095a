"""read.py of a package and of shards: it reads them as `open_dataset` does, without Plenoforge."""

import itertools
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
from lightfield.formats.lightfield import LightField, View
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.cube_map import CubeMap
from lightfield.imaging import images
from lightfield.imaging.primaries import ACESCG, from_rec_709
from lightfield.publishing import package, reader
from lightfield.publishing.publish import publish

# Prints nothing. Writes all arrays of the first view of each set of views, and which views it has.
PROGRAM = """
import sys

import numpy as np
from read import LENSES, open_dataset

assert "lightfield" not in sys.modules
data = open_dataset()
arrays = {}
for name in LENSES:
    views = data.reprojections[name].views if name else data.views
    arrays[f"{name}/names"] = [view.name for view in views]
    arrays[f"{name}/splits"] = [view.split or "" for view in views]
    arrays[f"{name}/poses"] = [view.world_from_camera for view in views]
    for array in ("rgb", "alpha", "depth", "distance", "normal"):
        try:
            arrays[f"{name}/{array}"] = [getattr(view, array) for view in views]
        except (AttributeError, KeyError, RuntimeError):
            pass
    if hasattr(views[0], "rays"):
        arrays[f"{name}/rays"] = views[0].rays()
        pixels, visible = views[0].project(POINTS)
        arrays[f"{name}/pixels"], arrays[f"{name}/visible"] = pixels, visible
np.savez("arrays.npz", **arrays)
"""
POINTS = np.random.default_rng(1).normal(size=(400, 3)).tolist()


def read(folder):
    """Return what read.py in a folder reads, in a process that cannot import Plenoforge."""
    (folder / "program.py").write_text(f"POINTS = {POINTS}\n{PROGRAM}")
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


def source_of(lens: Lens, **keys: object) -> str:
    """Return read.py of a dataset with everything that makes it long, except reprojections."""
    content = {"render": {"passes": ["normal"], "transparent": True}, "depth": lens.usual_depth}
    view = View.placed("view_0000f", np.eye(4))
    return reader.source({"": LightField(lens.to_lightfield() | content, [view])}, **keys)


def compare(arrays, data):
    """Compare the arrays that a read.py has read with those of the library. Return their names."""
    compared = set()
    for name, dataset in {"": data, **data.reprojections}.items():
        views = dataset.views
        assert arrays[f"{name}/names"].tolist() == [view.name for view in views]
        assert arrays[f"{name}/splits"].tolist() == [view.split or "" for view in views]
        poses = [view.world_from_camera for view in views]
        np.testing.assert_array_equal(arrays[f"{name}/poses"], poses)
        for array in ("rgb", "alpha", "depth", "distance", "normal"):
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
    compared = compare(read(folder), open_dataset(folder))
    assert compared >= {
        *("/rgb", "/depth", "/distance", "/normal"),
        *("panorama/rgb", "panorama/depth", "panorama/distance", "panorama/normal"),
    }


@pytest.mark.parametrize("form", [unpacked, shards])
def test_it_reads_all_frames_of_a_sequence(form, tmp_path):
    folder = form(write_sequence(tmp_path / "sequence"), tmp_path)
    arrays = read(folder)
    assert len(arrays["/rgb"]) == len(arrays["perspective/rgb"]) == 18
    compare(arrays, open_dataset(folder))


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
    compared = compare(read(folder), open_dataset(folder))
    assert compared == {"/rgb", "/alpha", "/depth", "/distance", "aces/rgb"}


@pytest.mark.parametrize("form", [unpacked, shards])
def test_it_reads_views_whose_files_store_other_pixels(form, tmp_path):
    dataset = write_dataset(tmp_path / "dataset")
    exr_windows.crop(dataset / "exr/view_0001f.exr", slice(3, 12), slice(4, 20))
    exr_windows.widen(dataset / "panorama/view_0002f.exr")
    finish(dataset)
    folder = form(dataset, tmp_path)
    compared = compare(read(folder), open_dataset(folder))
    assert compared >= {"/rgb", "/depth", "panorama/rgb", "panorama/depth"}


def test_it_has_no_rays_for_omnidirectional_stereo(tmp_path):
    dataset = tmp_path / "dataset"
    write_views(dataset, LENSES["panorama"], RIG)
    path = dataset / "lightfield.json"
    keys = {"scene": {"name": "room"}, "omnidirectional_stereo": 0.065}
    LightField.read(path).changed(**keys).write(path)
    arrays = read(unpacked(finish(dataset), tmp_path))
    assert arrays["/rgb"].shape == (6, 32, 64, 3)
    assert "/rays" not in arrays


@pytest.mark.parametrize("name", EXAMPLES)
def test_its_lens_is_the_librarys(name):
    lens = EXAMPLES[name]
    names: dict[str, object] = {"__file__": "read.py"}
    source = source_of(lens)
    assert "lightfield" not in re.findall(r"import (\w+)", source)
    exec(source, names)
    own = names["LENSES"][""]
    x, y = grid(lens, np.float64)
    rays = lens.rays(x, y)
    np.testing.assert_allclose(own.rays(x, y), rays, rtol=0, atol=1e-12)
    points = np.random.default_rng(1).normal(size=(20_000, 3))
    rays = np.concatenate([points, rays[np.isfinite(rays[..., 0])]])
    # Pixels far outside the frame have fewer digits.
    np.testing.assert_allclose(own.pixels(rays), lens.pixels(rays), rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(own.pixel_rays()[::97, ::101], lens.pixel_rays()[::97, ::101])


def test_it_is_short_and_laid_out_as_the_projects_own_code(tmp_path):
    for number, (lens, shards) in enumerate(itertools.product(EXAMPLES.values(), (False, True))):
        source = source_of(lens, shards=shards)
        # No dataset has the cube map's lens: its faces are images of their own.
        assert source.count("\n") < 200 or isinstance(lens, CubeMap)
        (tmp_path / f"{number}.py").write_text(source)
    for check in (["check"], ["format", "--check"]):
        ruff = ["ruff", *check, "--config", ROOT / "pyproject.toml", tmp_path]
        said = subprocess.run(ruff, capture_output=True, text=True)
        assert said.returncode == 0, said.stdout
