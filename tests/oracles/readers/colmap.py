"""A COLMAP model, binary or text, read by COLMAP's format.rst and models.h.

Poses are world to camera with x right, y down and z forward. The reader compares what the model
says twice: an image's points with the points' tracks, and a point's pixel in an image with its
projection.
"""

import math
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.files import reading
from oracles.readers.cameras import Camera, OfColmap, OpenCVFisheye, Panorama, Pinhole
from oracles.readers.contents import (
    FLOAT32,
    Cloud,
    Exported,
    ExportedCamera,
    ExportedView,
    Floats,
    Part,
    development,
    from_texts,
    numbers,
)

Ints = NDArray[np.int64]


def _panorama(width: int, height: int, w: float, h: float) -> Panorama:
    """Return COLMAP's EQUIRECTANGULAR. 2π of longitude take w pixels, and π of latitude take h."""
    east = 2 * math.pi * (width / w) - math.pi
    south = math.pi / 2 - math.pi * (height / h)
    return Panorama(width, height, -math.pi, east, math.pi / 2, south)


def _own(model: str) -> Callable[..., Camera]:
    """Return what makes a camera of one of COLMAP's models from its size and its parameters."""
    return lambda width, height, *parameters: OfColmap(width, height, model, parameters)


# COLMAP's id, name and class of each model, with the number of its parameters.
MODELS: dict[int, tuple[str, Callable[..., Camera], int]] = {
    1: ("PINHOLE", Pinhole, 4),
    5: ("OPENCV_FISHEYE", OpenCVFisheye, 8),
    17: ("EQUIRECTANGULAR", _panorama, 2),
} | {
    number: (name, _own(name), count)
    for number, name, count in (
        (4, "OPENCV", 8),
        (6, "FULL_OPENCV", 12),
        (7, "FOV", 5),
        (10, "THIN_PRISM_FISHEYE", 12),
        (11, "RAD_TAN_THIN_PRISM_FISHEYE", 16),
        (13, "DIVISION", 5),
        (16, "EUCM", 6),
    )
}
NAMES = {name: number for number, (name, _, _) in MODELS.items()}

# POINTS2D without a point have this number.
NO_POINT = -1

# From COLMAP's camera to that of lightfield.json (y up, looks along −z), and back.
_FLIP = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class Image:
    """One image. It sees the points with the numbers ``points`` (m,) at ``pixels`` (m, 2).

    ``rotation`` (3, 3) and ``translation`` (3,) map the world to the camera.
    """

    number: int
    name: str
    camera: int
    rotation: Floats
    translation: Floats
    pixels: Floats
    points: Ints


@dataclass(frozen=True)
class Points:
    """The n points and their tracks, one after the other. ``sizes`` (n,) are the tracks' lengths.

    A row of ``tracks`` holds an image's number, and an index in the points that it sees. ``errors``
    (n,) are mean distances in pixels between a point's projections and its places in the images.
    """

    numbers: Ints
    positions: Floats
    errors: Floats
    sizes: Ints
    tracks: Ints


@dataclass(frozen=True)
class Model:
    """A model in a ``folder``. Its files end in ``suffix``."""

    folder: Path
    suffix: str
    cameras: dict[int, Camera]
    images: list[Image]
    points: Points

    def file(self, name: str) -> Path:
        return self.folder / f"{name}{self.suffix}"


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the model of an export, and the names of the images to test with."""
    folder = listing.parent / "sparse" / "0"
    model = read_model(folder, ".bin" if options["format"] == "binary" else ".txt")
    exported = exported_model(model, listing.parent / "images")
    tests = folder / "test.txt"
    if tests.is_file():
        with reading(tests, "list of images"):
            names = [Path(line).stem for line in tests.read_text(encoding="utf-8").splitlines()]
        exported.parts.append(Part(str(tests), "test", names))
    for image in model.images:
        view = Path(image.name).stem
        colour = listing.parent / "images" / image.name
        exported.add_picture(colour, view, "colour", development=development(options))
        exported.add_mask(listing.parent / "masks" / f"{image.name}.png", view)
        if options["depth"]:
            depth = listing.parent / "stereo/depth_maps" / f"{image.name}.geometric.bin"
            _check_depth_map(depth, size, exported)
            exported.add_picture(depth, view, "metres", size=size)
    return exported


def read_model(folder: Path, suffix: str) -> Model:
    """Read the three files of a model, ``.bin`` or ``.txt``."""
    is_binary = suffix == ".bin"
    cameras_path = folder / f"cameras{suffix}"
    with reading(cameras_path, "COLMAP cameras file"):
        cameras = _binary_cameras(cameras_path) if is_binary else _text_cameras(cameras_path)
        if not cameras:
            raise ValueError("it is empty")
    images_path = folder / f"images{suffix}"
    with reading(images_path, "COLMAP images file"):
        images = _binary_images(images_path) if is_binary else _text_images(images_path)
        if not images:
            raise ValueError("it is empty")
    points_path = folder / f"points3D{suffix}"
    with reading(points_path, "COLMAP points3D file"):
        points = _binary_points(points_path) if is_binary else _text_points(points_path)
    return Model(folder, suffix, cameras, images, points)


def exported_model(model: Model, pictures: Path | None) -> Exported:
    """Return what a model says of the images in the folder ``pictures``, if they have one."""
    exported = Exported()
    cameras_file = model.file("cameras")
    images_file = model.file("images")
    for number, camera in model.cameras.items():
        exported.cameras.append(ExportedCamera(f"{cameras_file}: camera {number}", camera))
    numbers_so_far: set[int] = set()
    for image in model.images:
        place = f"image {image.number}"
        if image.number in numbers_so_far:
            exported.faults.append(f"{images_file}: {place}: occurs twice")
        numbers_so_far.add(image.number)
        if image.camera not in model.cameras:
            exported.faults.append(f"{images_file}: {place}: has no camera {image.camera}")
        if pictures and not (pictures / image.name).is_file():
            exported.faults.append(f"{images_file}: {place}: {image.name} is not a file")
        matrix = np.eye(4)
        matrix[:3, :3] = image.rotation.T @ _FLIP
        matrix[:3, 3] = -image.rotation.T @ image.translation
        view = ExportedView(images_file, place, Path(image.name).stem, matrix)
        exported.views.append(view)
    points_file = model.file("points3D")
    points = model.points
    if len(np.unique(points.numbers)) < len(points.numbers):
        exported.faults.append(f"{points_file}: two points have one number")
    exported.clouds.append(Cloud(points_file, "point", points.numbers, points.positions))
    exported.faults += _track_faults(model)
    exported.faults += _projection_faults(model)
    return exported


def _rotation(quaternion: Floats) -> Floats:
    """Return the matrix (3, 3) of a quaternion (w, x, y, z), as COLMAP's readers compute it.

    None of them normalises the quaternion. So only a unit quaternion gives a rotation.
    """
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _camera(model: int, width: int, height: int, parameters: Floats) -> Camera:
    name, kind, count = MODELS[model]
    if len(parameters) != count:
        raise ValueError(f"{name} has {count} parameters, not {len(parameters)}")
    return kind(width, height, *parameters.tolist())


# ---- binary ---------------------------------------------------------------------------------


def _binary_cameras(path: Path) -> dict[int, Camera]:
    content = path.read_bytes()
    place = 8
    cameras = {}
    for _ in range(struct.unpack_from("<Q", content)[0]):
        number, model, width, height = struct.unpack_from("<iiQQ", content, place)
        if model not in MODELS:
            raise ValueError(
                f"camera {number}: its model is {model}, not {' or '.join(map(str, MODELS))}"
            )
        count = MODELS[model][2]
        parameters = numbers(np.frombuffer(content, "<f8", count, place + 24), (count,))
        cameras[number] = _camera(model, width, height, parameters)
        place += 24 + 8 * count
    _require_end(content, place)
    return cameras


def _binary_images(path: Path) -> list[Image]:
    content = path.read_bytes()
    place = 8
    row = np.dtype([("pixel", "<f8", 2), ("point", "<i8")])
    images = []
    for _ in range(struct.unpack_from("<Q", content)[0]):
        number, *values, camera = struct.unpack_from("<i7di", content, place)
        pose = numbers(values, (7,))
        end = content.index(b"\0", place + 64)
        name = content[place + 64 : end].decode()
        (count,) = struct.unpack_from("<Q", content, end + 1)
        rows = np.frombuffer(content, row, count, end + 9) if count else np.empty(0, row)
        place = end + 9 + count * row.itemsize
        rotation = _rotation(pose[:4])
        images.append(Image(number, name, camera, rotation, pose[4:], rows["pixel"], rows["point"]))
    _require_end(content, place)
    return images


def _binary_points(path: Path) -> Points:
    content = path.read_bytes()
    place = 8
    count = struct.unpack_from("<Q", content)[0]
    heads, tracks = [], []
    head = struct.Struct("<Q3d3BdQ")
    for _ in range(count):
        number, x, y, z, _, _, _, error, size = head.unpack_from(content, place)
        heads.append((number, x, y, z, error, size))
        place += head.size + 8 * size
        if place > len(content):
            raise ValueError(f"point {number}: it has {size} views, more than the file holds")
        tracks.append(content[place - 8 * size : place])
    _require_end(content, place)
    pairs = np.frombuffer(b"".join(tracks), "<i4").reshape(-1, 2).astype(np.int64)
    return _points(heads, pairs)


def _require_end(content: bytes, place: int) -> None:
    if place != len(content):
        raise ValueError(f"it has {len(content)} bytes, and its entries {place}")


# ---- text -----------------------------------------------------------------------------------


def _lines(path: Path) -> Iterator[tuple[str, str]]:
    """Yield the place and the text of each line that is not a comment."""
    with path.open(encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            if not line.startswith("#"):
                yield f"{path}: line {number}", line


def _text_cameras(path: Path) -> dict[int, Camera]:
    cameras = {}
    for place, line in _lines(path):
        with reading(place, "camera"):
            number, model, width, height, *parameters = line.split()
            if model not in NAMES:
                raise ValueError(f"its model is {model}, not {' or '.join(NAMES)}")
            cameras[int(number)] = _camera(
                NAMES[model], int(width), int(height), from_texts(parameters)
            )
    return cameras


def _text_images(path: Path) -> list[Image]:
    images = []
    lines = _lines(path)
    for place, line in lines:
        with reading(place, "image"):
            number, *texts, camera, name = line.split()
            pose = numbers(from_texts(texts), (7,))
            rotation = _rotation(pose[:4])
            _, body = next(lines, ("", ""))
            rows = np.array(body.split(), np.float64).reshape(-1, 3)
            pixels = rows[:, :2]
            points = _integers(rows[:, 2])
            images.append(Image(int(number), name, int(camera), rotation, pose[4:], pixels, points))
    return images


def _text_points(path: Path) -> Points:
    heads = []
    tracks = [np.empty((0, 2), np.int64)]
    for place, line in _lines(path):
        with reading(place, "point"):
            number, x, y, z, _, _, _, error, *track = line.split()
            heads.append((int(number), *map(float, (x, y, z, error)), len(track) // 2))
            tracks.append(np.array(track, np.int64).reshape(-1, 2))
    return _points(heads, np.concatenate(tracks))


def _points(heads: Sequence[tuple[Any, ...]], tracks: Ints) -> Points:
    """Return the points. A head is (number, x, y, z, error, length of the track)."""
    point_numbers = np.array([head[0] for head in heads], np.int64)
    positions_and_errors = np.array([head[1:5] for head in heads], np.float64).reshape(-1, 4)
    sizes = np.array([head[5] for head in heads], np.int64)
    positions = positions_and_errors[:, :3]
    errors = positions_and_errors[:, 3]
    return Points(point_numbers, positions, errors, sizes, tracks)


def _integers(values: Floats) -> Ints:
    """Return whole numbers that were read as floats. Raises ValueError for others."""
    with np.errstate(invalid="ignore"):
        integers = values.astype(np.int64)
    if not (integers == values).all():
        raise ValueError("a number of a point is not whole")
    return integers


# ---- what the files say twice ---------------------------------------------------------------


def _track_faults(model: Model) -> list[str]:
    """Compare the points' tracks with the lists of points that the images have."""
    path = model.file("points3D")
    points = model.points
    index_of_image = {image.number: index for index, image in enumerate(model.images)}
    # The points of all images, one image after the other.
    starts = np.cumsum([0, *(len(image.points) for image in model.images)])
    listed = np.concatenate([np.empty(0, np.int64), *(image.points for image in model.images)])
    image_numbers, inverse = np.unique(points.tracks[:, 0], return_inverse=True)
    image_indices = np.array(
        [index_of_image.get(number, -1) for number in image_numbers.tolist()], np.int64
    )
    # The image, the index in its points, and the point of each row of the tracks.
    image = image_indices[inverse] if len(inverse) else np.empty(0, np.int64)
    index = points.tracks[:, 1]
    owner = np.repeat(points.numbers, points.sizes)
    exists = (image >= 0) & (index >= 0) & (index < (starts[1:] - starts[:-1])[image])
    place = np.where(exists, starts[image] + index, 0)
    is_right = exists & (listed[place] == owner) if len(listed) else exists
    faults = [
        f"{path}: point {number}: its track has what is no such point of an image"
        for number in np.unique(owner[~is_right]).tolist()
    ]
    is_tracked = listed == NO_POINT
    is_tracked[place[is_right]] = True
    untracked = np.flatnonzero(~is_tracked)
    images_of_untracked = np.searchsorted(starts, untracked, side="right") - 1
    for point, number in zip(listed[untracked], images_of_untracked, strict=True):
        faults.append(f"{path}: point {point}: its track lacks {model.images[number].name}")
    return faults


def _projection_faults(model: Model) -> list[str]:
    """Compare where each image has its points with where its camera projects them."""
    faults: list[str] = []
    # The number of images that see each point.
    totals = np.zeros(len(model.points.numbers), np.int64)
    # For each wrong projection: the image, the index in its points, and the point's row.
    off = [np.empty((0, 3), np.int64)]
    # The number of points of each image.
    sizes = []
    order = np.argsort(model.points.numbers)
    for number, image in enumerate(model.images):
        places, rows = _places_and_rows(image, model, order)
        unknown = rows < 0
        for place in places[unknown].tolist():
            point = image.points[place]
            faults.append(f"{model.file('images')}: {image.name}: there is no point {point}")
        places = places[~unknown]
        rows = rows[~unknown]
        wrong = _is_projected_elsewhere(image, model, places, rows)
        totals += np.bincount(rows, minlength=len(totals))
        sizes.append(len(rows))
        numbers_of = np.full(int(wrong.sum()), number)
        off.append(np.stack([numbers_of, places[wrong], rows[wrong]], axis=-1))
    images, places, rows = np.concatenate(off).T
    all_off = (np.bincount(images, minlength=len(sizes)) == sizes) & (np.array(sizes) > 0)
    if all_off.any() and all_off.sum() == np.count_nonzero(sizes):
        return [*faults, f"{model.file('cameras')}: no image has its points where its camera does"]
    limit = FLOAT32 * max(max(c.width, c.height) for c in model.cameras.values())
    for point in model.points.numbers[~(np.abs(model.points.errors) <= limit)].tolist():
        faults.append(
            f"{model.file('points3D')}: point {point}: its error is not that of its images"
        )
    misplaced = (np.bincount(rows, minlength=len(totals)) == totals) & (totals > 0)
    for number in np.flatnonzero(all_off).tolist():
        name = model.images[number].name
        faults.append(f"{model.file('images')}: {name}: no point is where its camera sees it")
    for point in model.points.numbers[misplaced].tolist():
        faults.append(f"{model.file('points3D')}: point {point}: is where no image has it")
    alone = ~all_off[images] & ~misplaced[rows]
    for number, place, row in zip(images[alone], places[alone], rows[alone], strict=True):
        name = model.images[number].name
        point = model.points.numbers[row]
        faults.append(
            f"{model.file('images')}: {name}: POINTS2D {place}: is not where its camera sees "
            f"point {point}"
        )
    return faults


def _places_and_rows(image: Image, model: Model, order: Ints) -> tuple[Ints, Ints]:
    """Return the indices of an image's points, and their rows among the model's points.

    The row is −1 for a point that the model lacks. ``order`` (n,) sorts the numbers of the model's
    points.
    """
    places = np.flatnonzero(image.points != NO_POINT)
    if not len(order):
        return places, np.full(len(places), -1)
    indices = np.searchsorted(model.points.numbers, image.points[places], sorter=order)
    rows = order[indices.clip(max=len(order) - 1)]
    return places, np.where(model.points.numbers[rows] == image.points[places], rows, -1)


def _is_projected_elsewhere(image: Image, model: Model, places: Ints, rows: Ints) -> NDArray[Any]:
    """Return which of an image's points its camera projects to another pixel."""
    camera = model.cameras.get(image.camera)
    if camera is None:
        return np.ones(len(rows), bool)
    # A damaged number may be anything.
    with np.errstate(over="ignore", invalid="ignore"):
        local = (model.points.positions[rows] @ image.rotation.T + image.translation) @ _FLIP
        offsets = np.abs(camera.pixels(local) - image.pixels[places]).max(axis=-1)
    elsewhere: NDArray[Any] = ~(offsets <= FLOAT32 * max(camera.width, camera.height))
    return elsewhere


def _check_depth_map(path: Path, size: tuple[int, int], exported: Exported) -> None:
    """Check a depth map's header and its number of bytes."""
    width, height = size
    header = f"{width}&{height}&1&".encode()
    with reading(path, "depth map of COLMAP"):
        with path.open("rb") as file:
            exported.expect(f"{path}: header", file.read(len(header)), header)
        exported.expect(f"{path}: bytes", path.stat().st_size, len(header) + 4 * width * height)
