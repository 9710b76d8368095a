"""Writers on a full disk: each raises an error that names the file, and keeps the old file."""

import os
import re
from contextlib import contextmanager, nullcontext

import numpy as np
import pytest
from conftest import largest_file

from lightfield.core import files
from lightfield.core.errors import UserError
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.imaging import images, plots
from lightfield.rendering.scenes import blend_file
from lightfield.report import page
from lightfield.reprojection import lens_map

BLOCK = os.sysconf("SC_PAGE_SIZE")
FISHEYE = Equidistant(width=24, height=24, fov=3.0)


def noise(seed, *shape):
    return np.random.default_rng(seed).random(shape, np.float32)


def write_exr(path, seed):
    values = noise(seed, 64, 48)
    half = values.astype(np.float16)
    images.write_exr(path, {"R": half, "G": half, "B": half, "Z": values})


def write_small_exr(path, seed):
    images.write_exr(path, {"R": noise(seed, 2, 2).astype(np.float16)})


def write_png(path, seed):
    pixels = (noise(seed, 96, 64, 3) * 255).astype(np.uint8)
    images.write_png(path, pixels, {images.KEY_ATTRIBUTE: "key"})


def write_small_png(path, seed):
    images.write_png(path, (noise(seed, 2, 2) * 255).astype(np.uint8))


def write_plot(path, seed):
    # Many points and no text make files of several blocks that are quickly drawn.
    with plots.plot(path.with_suffix(""), size=(4, 3)) as axes:
        axes.set_axis_off()
        axes.plot(noise(seed, 700))


def write_page(path, seed):
    keys = ("rig", "link", "frames", "resolution", "lens", "projection", "state", "picture")
    datasets = [dict.fromkeys(keys) | {"scene": "a", "views": seed}]
    page.write(path, "index.html.j2", datasets=datasets, families=[])


def write_json(path, seed):
    files.write_json(path, list(range(seed, seed + 4000)))


def write_small_json(path, seed):
    files.write_json(path, {"seed": seed})


def write_lens_map(path, seed):
    target = Rectilinear(width=12, height=12, focal_length=18 + seed)
    lens_map.save(path, lens_map.compute(FISHEYE, target, np.eye(3)))


def write_blend(path, seed):
    blend_file.new_scene()
    blend_file.bpy.context.scene.frame_end = 100 + seed
    with files.atomic_path(path) as temporary:
        blend_file.save_scene(temporary)


# A .blend holds memory addresses, so a second one may be somewhat smaller.
SMALLER = {"a.blend": 2000}
WRITERS = [
    (write_exr, "a.exr"),
    (write_small_exr, "a.exr"),
    (write_png, "a.png"),
    (write_small_png, "a.png"),
    (write_plot, "a.svg"),
    (write_plot, "a.png"),
    (write_page, "a.html"),
    (write_json, "a.json"),
    (write_small_json, "a.json"),
    (write_lens_map, "a.npy"),
    (write_blend, "a.blend"),
]


@contextmanager
def nearly_full(disk, blocks):
    """Leave ``blocks`` blocks on a small disk. Without one, limit each file to that size."""
    folder, mounted = disk
    filler = folder / "filler"
    with nullcontext() if mounted else largest_file(blocks * BLOCK):
        if mounted:
            free = os.statvfs(folder).f_bavail
            filler.write_bytes(bytes((free - blocks) * BLOCK))
        try:
            yield
        finally:
            filler.unlink(missing_ok=True)


def assert_refused(write, path):
    """Assert that the file is not replaced, and that the error is one line with its path."""
    before = {p.name: p.read_bytes() for p in path.parent.iterdir()}
    with pytest.raises(UserError) as caught:
        write(path, 1)
    message = str(caught.value)
    assert message.startswith(f"{path.with_suffix('')}.")
    assert ": cannot be written: " in message and "\n" not in message
    # The message says what to do, and has sizes that a person can read.
    assert re.search(r"\w+ are free on its disk: |is full: free some space", message), message
    after = {p.name: p.read_bytes() for p in path.parent.iterdir()}
    assert after.keys() == before.keys()
    assert after[path.name] == before[path.name]


@pytest.mark.parametrize(("write", "name"), WRITERS)
@pytest.mark.slow
def test_an_incomplete_write_is_always_refused(write, name, tmp_path):
    path = tmp_path / "folder" / name
    write(path, 1)
    size = path.stat().st_size - SMALLER.get(name, 0)
    write(path, 0)
    for part in (0, 1, size // 2, size - 13, size - 5, size - 1):
        with largest_file(part):
            assert_refused(write, path)
    before = path.read_bytes()
    write(path, 1)
    assert path.read_bytes() != before


@pytest.mark.parametrize(("write", "name"), WRITERS)
def test_with_space_again_the_file_is_written(write, name, small_disk):
    path = small_disk[0] / name
    write(path, 1)
    blocks = -(-(path.stat().st_size - SMALLER.get(name, 0)) // BLOCK)
    write(path, 0)
    for left in {0, blocks // 2, max(0, blocks - 2)}:
        with nearly_full(small_disk, left):
            assert_refused(write, path)
    before = path.read_bytes()
    write(path, 1)
    assert path.read_bytes() != before
