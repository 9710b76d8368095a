"""Reads a file of a scene as its format, and says why it cannot be read.

Blender itself shows nothing, or something else, in place of such a file, and only prints why.
"""

import csv
import json
import re
import struct
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy

from lightfield.core.errors import UserError
from lightfield.imaging.images import is_readable
from lightfield.rendering.inspection import ogawa
from lightfield.rendering.models import model_files, usd_files
from lightfield.rendering.models.second_readers import ply, stl
from lightfield.rendering.scenes.quiet import quiet


class DamagedError(UserError):
    """A file is damaged, or not of its format."""

    def __init__(self, path: Path, problem: str) -> None:
        super().__init__(f"{path}: {problem}")
        self.problem = problem


def check(file_format: str, path: Path) -> None:
    """Raise `DamagedError` if a file cannot be read as a format, one of `READERS`.

    Files of other formats are not read. Raises `UserError` for a picture that is too large.
    """
    reader = READERS.get(file_format)
    if reader:
        reader(path)


def _read_picture(path: Path) -> None:
    # Do not let Blender read it: 5.0 crashes on some broken EXRs.
    if not is_readable(path):
        raise DamagedError(path, "cannot be read")


def _read_movie(path: Path) -> None:
    # Blender repeats the last picture of a movie that is cut short.
    if _promised_bytes(path) > path.stat().st_size:
        raise DamagedError(path, "is cut short")
    image = bpy.data.images.load(str(path.absolute()))
    try:
        if not image.size[0]:
            raise DamagedError(path, "cannot be read as a movie")
    finally:
        bpy.data.images.remove(image)


def _promised_bytes(path: Path) -> int:
    """Return how many bytes a movie must have by the sizes in its container. 0 if unknown."""
    with path.open("rb") as file:
        head = file.read(64)
        if head[:4] == b"RIFF":
            return 8 + int.from_bytes(head[4:8], "little")
        if head[:4] == b"\x1aE\xdf\xa3":
            return _end_of_matroska(head)
        return _end_of_boxes(file) if head[4:8] == b"ftyp" else 0


def _end_of_matroska(head: bytes) -> int:
    """Return where the segment of a Matroska or WebM file ends. 0 if the file does not say it."""
    header_length, start = _matroska_length(head, 4)
    # After the header comes the segment, with an id of four bytes.
    length, first = _matroska_length(head, start + header_length + 4)
    width = first - (start + header_length + 4)
    is_unknown = length == 2 ** (7 * width) - 1
    return 0 if is_unknown else first + length


def _matroska_length(head: bytes, at: int) -> tuple[int, int]:
    """Return a length of Matroska, whose leading zero bits count its bytes, and where it ends."""
    width = 9 - head[at : at + 1].ljust(1, b"\x01")[0].bit_length()
    value = int.from_bytes(head[at : at + width], "big")
    return value & (2 ** (7 * width) - 1), at + width


def _end_of_boxes(file: Any) -> int:
    """Return where the last box of an MP4 or QuickTime file ends."""
    end = 0
    while True:
        file.seek(end)
        head = file.read(16)
        if len(head) < 8:
            return end + len(head)
        length = int.from_bytes(head[:4], "big")
        if length == 1:
            length = int.from_bytes(head[8:], "big")
        if length < 8:
            # The last box may reach to the end of the file.
            return end
        end += length


def _read_font(path: Path) -> None:
    try:
        with quiet():
            bpy.data.fonts.remove(bpy.data.fonts.load(str(path.absolute())))
    except RuntimeError:
        raise DamagedError(path, "cannot be read") from None


def _read_vdb(path: Path) -> None:
    volume = bpy.data.volumes.new(path.name)
    volume.filepath = str(path.absolute())
    try:
        if not volume.grids.load():
            raise DamagedError(path, "cannot be read")
        for grid in volume.grids:
            # The list of grids says nothing of their voxels.
            if not grid.load():
                raise DamagedError(
                    path, f"its grid {grid.name} cannot be read; it may be cut short"
                )
            grid.unload()
    finally:
        bpy.data.volumes.remove(volume)


def _read_alembic(path: Path) -> None:
    try:
        ogawa.check(path)
    except ValueError as error:
        raise DamagedError(path, str(error)) from None


def _read_usd(path: Path) -> None:
    try:
        model_files.check(path)
        usd_files.survey(path)
    except UserError as error:
        raise DamagedError(path, str(error).removeprefix(f"{path}: ")) from None


def _read_mdd(path: Path) -> None:
    head = _head(path, 8)
    frames, points = struct.unpack(">2I", head)
    # Each frame has a time, and three coordinates for each point.
    _refuse_short(path, 8 + frames * (4 + 12 * points))


def _read_pc2(path: Path) -> None:
    head = _head(path, 32)
    if not head.startswith(b"POINTCACHE2\0"):
        raise DamagedError(path, "is not a PC2 file")
    points, frames = struct.unpack("<16xI8xI", head)
    _refuse_short(path, 32 + 12 * points * frames)


def _head(path: Path, length: int) -> bytes:
    with path.open("rb") as file:
        head = file.read(length)
    if len(head) < length:
        raise DamagedError(path, f"is cut short: it has {len(head)} bytes")
    return head


def _refuse_short(path: Path, least: int) -> None:
    size = path.stat().st_size
    if size < least:
        raise DamagedError(path, f"is cut short: it has {size} bytes of {least}")


def _read_simulated_frame(path: Path) -> None:
    """Read a frame of a simulation's cache: a head, and blocks of values for each point."""
    head = _head(path, 20)
    if not head.startswith(b"BPHYSICS"):
        raise DamagedError(path, "is not a frame of a simulation")
    kind, points, values = struct.unpack("<8x3I", head)
    sizes = [size for bit, size in enumerate(_SIZES_OF_VALUES) if values >> bit & 1]
    if not kind & _COMPRESSED:
        _refuse_short(path, 20 + points * sum(sizes))
        return
    with path.open("rb") as file:
        end = 20
        for size in sizes:
            end = _end_of_block(file, end, points * size)
    _refuse_short(path, end)


# Bytes of a point's index, place, velocity, rotation, angular velocity, size, times, and boids.
_SIZES_OF_VALUES = (4, 12, 12, 16, 12, 4, 12, 20)
_COMPRESSED = 1 << 16
_LZMA = 2


def _end_of_block(file: Any, start: int, plain_length: int) -> int:
    """Return where a compressed block of a simulation's frame ends. It may also be plain."""
    file.seek(start)
    head = file.read(5).ljust(5, b"\0")
    if head[0] == 0:
        return start + 1 + plain_length
    end = start + 5 + int.from_bytes(head[1:], "little")
    if head[0] == _LZMA:
        # The properties of the compression follow.
        file.seek(end)
        end += 4 + int.from_bytes(file.read(4), "little")
    return end


def _read_light_profile(path: Path) -> None:
    """Read an IES file as Cycles does, which otherwise gives the lamp no profile."""
    _, marker, rest = path.read_text("latin-1").partition("TILT=")
    tilt, _, text = rest.partition("\n")
    try:
        numbers = iter([float(word) for word in text.replace(",", " ").split()])
    except ValueError:
        numbers = iter(())
    if not marker or not _has_intensities(numbers, tilt.strip() == "INCLUDE"):
        raise DamagedError(path, "is cut short, or not a light profile (IES)")


def _has_intensities(numbers: Iterator[float], has_tilt: bool) -> bool:
    """Return whether the numbers of an IES file include the intensity at each of its angles."""

    def skip(count: int) -> float:
        return [next(numbers) for _ in range(count)][-1]

    try:
        if has_tilt:
            skip(1)
            pairs = int(skip(1))
            skip(2 * pairs)
        # Lamps, lumens, a factor, the counts of angles, type, unit, three sizes, and three factors.
        skip(3)
        heights, turns = int(skip(1)), int(skip(1))
        skip(8)
        skip(heights + turns + heights * turns)
    except (StopIteration, RuntimeError, IndexError):
        return False
    return True


def _read_shader(path: Path) -> None:
    # Only Blender, once it is loaded, has this module.
    import _cycles

    with tempfile.TemporaryDirectory() as folder, quiet():
        if not _cycles.osl_compile(str(path.absolute()), f"{folder}/shader.oso"):
            raise DamagedError(path, "cannot be compiled as an OSL shader")


def _read_compiled_shader(path: Path) -> None:
    lines = path.read_text("latin-1").split("\n")
    if not lines[0].startswith("OpenShadingLanguage") or lines[-2].strip() != "end":
        raise DamagedError(path, "is cut short, or not a compiled OSL shader")


def _read_table(path: Path) -> None:
    with path.open(newline="", encoding="utf-8", errors="replace") as file:
        rows = [row for row in csv.reader(file) if row]
    if len(rows) < 2:
        raise DamagedError(path, "has no row of values below its header")
    for number, row in enumerate(rows, 1):
        if len(row) != len(rows[0]):
            raise DamagedError(path, f"row {number} has {len(row)} values of {len(rows[0])}")


def _read_json(path: Path) -> None:
    try:
        json.loads(path.read_bytes())
    except ValueError:
        raise DamagedError(path, "is cut short, or not JSON") from None


# Blender reads garbage from a PLY that is cut short, and nothing from such an STL.
_CONTENT_READERS: dict[str, Callable[[Path], Any]] = {
    "STL": stl.read_facets,
    "PLY": ply.read_content,
}


def _geometry_reader(node: str) -> Callable[[Path], None]:
    """Return a reader of models that geometry nodes import, by the name of their node."""

    def read(path: Path) -> None:
        try:
            model_files.check(path)
            if node in _CONTENT_READERS:
                _CONTENT_READERS[node](path)
        except UserError as error:
            raise DamagedError(path, str(error).removeprefix(f"{path}: ")) from None
        if node == "OBJ" and _ends_before_faces(path):
            raise DamagedError(path, "is cut short: it ends within a line, and has no faces")
        if not _imports_geometry(node, path):
            raise DamagedError(
                path, f"has nothing that Blender can read as {path.suffix[1:].upper()}"
            )

    return read


def _ends_before_faces(path: Path) -> bool:
    """Return whether an OBJ has points only, and its last line has no end."""
    content = path.read_bytes()
    return not content.endswith((b"\n", b"\r")) and not re.search(rb"(?m)^\s*(f|l|curv)\s", content)


def _imports_geometry(node: str, path: Path) -> bool:
    """Return whether geometry nodes get anything from a file. The open scene does not change."""
    tree = bpy.data.node_groups.new("reader", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    importer = tree.nodes.new(f"GeometryNodeImport{node}")
    importer.inputs["Path"].default_value = str(path.absolute())
    realized = tree.nodes.new("GeometryNodeRealizeInstances")
    tree.links.new(importer.outputs[0], realized.inputs[0])
    tree.links.new(realized.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    scene = bpy.data.scenes.new("reader")
    mesh = bpy.data.meshes.new("reader")
    obj = bpy.data.objects.new("reader", mesh)
    try:
        scene.collection.objects.link(obj)
        obj.modifiers.new("reader", "NODES").node_group = tree
        layer = scene.view_layers[0]
        with quiet():
            layer.update()
            geometry = obj.evaluated_get(layer.depsgraph).evaluated_geometry()
        return bool(geometry.mesh and geometry.mesh.vertices) or bool(
            geometry.pointcloud and geometry.pointcloud.points
        )
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.objects.remove(obj)
        bpy.data.meshes.remove(mesh)
        bpy.data.node_groups.remove(tree)


# The reader of each format. A name is a suffix, unless Blender takes files of any suffix.
READERS: dict[str, Callable[[Path], None]] = {
    "picture": _read_picture,
    "movie": _read_movie,
    "font": _read_font,
    "vdb": _read_vdb,
    "abc": _read_alembic,
    **dict.fromkeys(("usd", "usda", "usdc", "usdz"), _read_usd),
    "mdd": _read_mdd,
    "pc2": _read_pc2,
    "bphys": _read_simulated_frame,
    "json": _read_json,
    "stl": _geometry_reader("STL"),
    "ply": _geometry_reader("PLY"),
    "obj": _geometry_reader("OBJ"),
    "csv": _read_table,
    "ies": _read_light_profile,
    "osl": _read_shader,
    "oso": _read_compiled_shader,
}
