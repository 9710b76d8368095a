"""One table of faults: the kinds of files in a build, and what can happen to a file.

promises/test_damage.py does every fault to every kind of file.
"""

import json
import os

import bookkeeping
import numpy as np
from bookkeeping import CUBOID, LATTICE, PLANE

from lightfield.imaging import images
from soak import delete, empty, folder

HDR = f"results/{CUBOID}/perspective_hdr"
NCORE = f"{HDR}/exports/ncore/views.ncore4.zarr/cameras/camera/frames"

# For each kind: a file of the build, and another file that it may be swapped with.
KINDS = {
    "scene": ("work/smoke/scene.blend", f"results/{LATTICE}/report/noise.png"),
    "inventory": ("work/smoke/inventory.json", f"results/{LATTICE}/report/costs.json"),
    "light field": (f"results/{CUBOID}/lightfield.json", f"results/{LATTICE}/lightfield.json"),
    "reprojected light field": (
        f"results/{PLANE}/perspective/lightfield.json",
        f"results/{LATTICE}/perspective/lightfield.json",
    ),
    "lens map": (
        f"work/{CUBOID}/perspective/lens_map.npy",
        f"work/{LATTICE}/perspective/lens_map.npy",
    ),
    "receipt of views": bookkeeping.KINDS["receipt of views"],
    "receipt of a reprojection": bookkeeping.KINDS["receipt of a reprojection"],
    "receipt of a file": bookkeeping.KINDS["receipt of a file"],
    "view": (f"results/{CUBOID}/exr/view_b0000f.exr", f"results/{CUBOID}/exr/view_f0000f.exr"),
    "reprojected PNG": (
        f"results/{CUBOID}/perspective/view_l0000f.png",
        f"results/{CUBOID}/perspective/view_r0000f.png",
    ),
    "reprojected EXR": (f"{HDR}/view_u0000f.exr", f"{HDR}/view_d0000f.exr"),
    "parameters of a sensor": (
        f"results/{PLANE}/sensor/view_0000f.json",
        f"results/{PLANE}/sensor/view_0001f.json",
    ),
    "panorama's light field": (
        f"work/{CUBOID}/panorama/lightfield.json",
        f"work/{LATTICE}/panorama/lightfield.json",
    ),
    "panorama": (
        f"work/{CUBOID}/panorama/exr/view_0000f.exr",
        f"work/{LATTICE}/panorama/exr/view_0000f.exr",
    ),
    "clearance of cameras": (f"work/{PLANE}/cameras.json", f"work/{LATTICE}/cameras.json"),
    "transforms": (
        f"results/{CUBOID}/perspective/transforms.json",
        f"results/{LATTICE}/perspective/transforms.json",
    ),
    "transforms of a split": (
        f"results/{PLANE}/perspective/transforms_train.json",
        f"results/{PLANE}/perspective/transforms_test.json",
    ),
    "picture of instant-ngp": (
        f"{HDR}/instant_ngp/view_b0000f.exr",
        f"{HDR}/instant_ngp/view_f0000f.exr",
    ),
    "list of an export": (
        f"{HDR}/exports/colmap/export.json",
        f"{HDR}/exports/nerfstudio/export.json",
    ),
    "picture of an export": (
        f"{HDR}/exports/colmap/images/view_r0000f.png",
        f"{HDR}/exports/colmap/images/view_l0000f.png",
    ),
    "points": (
        f"{HDR}/exports/point_cloud/points.ply",
        f"{HDR}/exports/nerfstudio/points.ply",
    ),
    "surface": (f"results/{CUBOID}/mesh/scene.glb", f"results/{CUBOID}/mesh/scene.ply"),
    "validation": (f"results/{CUBOID}/validation.json", f"results/{LATTICE}/validation.json"),
    "published sums": (f"results/{CUBOID}/sha256sums.txt", f"results/{LATTICE}/sha256sums.txt"),
    "splits": ("results/smoke/splits.json", f"results/{PLANE}/validation.json"),
    "picture of a report": (
        f"results/{CUBOID}/report/rig.png",
        f"results/{LATTICE}/report/rig.png",
    ),
    "costs": (f"results/{CUBOID}/report/costs.json", f"results/{PLANE}/report/costs.json"),
    "page": (f"results/{PLANE}/report/index.html", f"results/{LATTICE}/report/index.html"),
    "settings": (
        f"work/{CUBOID}/settings/lightfield.json",
        f"work/{LATTICE}/settings/lightfield.json",
    ),
    "benchmark": bookkeeping.KINDS["benchmark"],
    "log": bookkeeping.KINDS["log"],
    "array of a Zarr store": (f"{NCORE}/0/image/0", f"{NCORE}/1000000/image/0"),
    "metadata of a Zarr store": (f"{NCORE}/0/image/.zarray", f"{NCORE}/.zattrs"),
}
# The same for the corpus of a family, from the family's folder.
CORPUS_KINDS = {
    "corpus": ("corpus.json", "index.html"),
    "page of a corpus": ("index.html", "corpus.json"),
    "thumbnail": ("thumbnails/0001.webp", "index.html"),
    "index of shards": ("shards/views.csv", "index.html"),
    "record of a member": ("0001/member.json", "0002/member.json"),
    "record of a failed member": ("broken/member.json", "0001/member.json"),
    "sums of a member": ("0001/plane/sha256sums.txt", "0002/plane/sha256sums.txt"),
    "light field of a member": ("0001/plane/lightfield.json", "0001/plane/validation.json"),
    "view of a member": ("0001/plane/exr/view_0000f.exr", "0002/plane/exr/view_0000f.exr"),
}


def flip(path, _):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def digit(path, _):
    """Change the first digit in the second half. Without one, change the middle byte."""
    content = bytearray(path.read_bytes())
    middle = len(content) // 2
    places = [place for place in range(middle, len(content)) if chr(content[place]).isdecimal()]
    content[(places or [middle])[0]] ^= 1
    path.write_bytes(content)


def truncate(path, _):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def replace(path, _):
    """Replace the file with another valid one."""
    pixels = np.full((4, 4), 100, np.uint8)
    match path.suffix:
        case ".exr":
            images.write_exr(path, {"R": pixels.astype(np.float16)})
        case ".png":
            images.write_png(path, pixels)
        case ".npy":
            np.save(path, np.zeros_like(np.load(path)))
        case ".json":
            path.write_text(json.dumps(json.loads(path.read_text()) | {"other": 1}))
        case _:
            path.write_bytes(path.read_bytes() + b"\n")


def swap(path, sibling):
    beside = path.with_name("beside")
    path.rename(beside)
    sibling.rename(path)
    beside.rename(sibling)


def link(path, _):
    path.unlink()
    path.symlink_to("nowhere")


def fifo(path, _):
    path.unlink()
    os.mkfifo(path)


def unreadable(path, _):
    path.chmod(0)


# For each fault: its function, and whether it keeps the file's old time.
FAULTS = {
    "a bit": (flip, False),
    "a bit, at the old time": (flip, True),
    "a digit": (digit, True),
    "cut short": (truncate, True),
    "emptied": (empty, True),
    "deleted": (delete, False),
    "another valid file": (replace, True),
    "swapped": (swap, False),
    "a folder": (folder, False),
    "a link to nowhere": (link, False),
    "unreadable": (unreadable, False),
    "a FIFO": (fifo, False),
}


def spoil(root, kind, fault, number=0):
    """Apply a fault to file ``number`` of a kind. Return the files that are damaged now."""
    files = (KINDS | CORPUS_KINDS)[kind]
    names = files[number:] + files[:number]
    path, sibling = (root / name for name in names)
    apply, sets_time_back = FAULTS[fault]
    status = path.stat()
    apply(path, sibling)
    if sets_time_back:
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    return names if fault == "swapped" else names[:1]
