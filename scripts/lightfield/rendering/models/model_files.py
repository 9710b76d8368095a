"""Finds the files that a model file names, without Blender, which does not list them."""

import json
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.files import check_readable
from lightfield.rendering.models import fbx_files, obj_files, ply_files, usd_files
from lightfield.rendering.models.model_references import FileReference, Survey
from lightfield.rendering.models.second_readers.gltf_data import file_of, is_data


def check(path: Path) -> None:
    """Raise `UserError` for a model file that is empty, cut short, or of another format.

    Blender's importers say little about such files, or import the part that is there.
    """
    check_readable(path)
    size = path.stat().st_size
    if not size:
        raise UserError(f"{path}: is empty; must be a model")
    with path.open("rb") as file:
        head = file.read(84)
    match path.suffix.lower():
        case ".glb" | ".gltf" if not _begins_as_gltf(head):
            raise UserError(
                f"{path}: is not a glTF file: it begins with neither glTF nor {{; give it the "
                "suffix of its format, or export it again"
            )
        case ".glb" | ".gltf" if hidden := _hidden_node(path):
            raise UserError(
                f"{path}: hides the node {hidden} by KHR_node_visibility, but Blender would show "
                "it; export the model without hidden nodes"
            )
        case ".fbx":
            fbx_files.check(path)
        case ".usdz" if not zipfile.is_zipfile(path):
            raise UserError(f"{path}: is cut short, or not a USDZ file, which is a ZIP archive")


def _begins_as_gltf(head: bytes) -> bool:
    """Return whether a file may be glTF by its first bytes: a binary one, or JSON."""
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    return head.startswith(b"glTF") or text.startswith(b"{")


def survey(path: Path) -> Survey:
    """Return the files that a model names, and its parts that Blender leaves out.

    The files may be missing. The list contains neither the model itself, nor the textures that an
    OBJ's libraries of materials name. Raises `UserError` if the model file is broken.
    """
    match path.suffix.lower():
        case ".gltf" | ".glb":
            return Survey(list(_of_gltf(path)), [])
        case ".obj":
            return obj_files.survey(path)
        case ".ply":
            return ply_files.survey(path)
        case ".usd" | ".usda" | ".usdc" | ".usdz":
            return usd_files.survey(path)
        case ".fbx":
            return fbx_files.survey(path)
        case _:
            return Survey([], [])


def _gltf_document(path: Path) -> Any:
    """Return the JSON of a glTF file. Raises `UserError` if it has none."""
    with path.open("rb") as file:
        # A binary one has a head of 12 bytes, and then the JSON with its length and type.
        head = file.read(20)
        is_binary = head[:4] == b"glTF"
        length = int.from_bytes(head[12:16], "little")
        content = file.read(length) if is_binary else head + file.read()
    try:
        return json.loads(content)
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path}: is cut short, or not a glTF file: {error}") from None


def _hidden_node(path: Path) -> str:
    """Return the name of a node that a glTF file hides, or its number. "" if it hides none."""
    try:
        for number, node in enumerate(_gltf_document(path).get("nodes", ())):
            visibility = node.get("extensions", {}).get("KHR_node_visibility", {})
            if not visibility.get("visible", True):
                return str(node.get("name", number))
    except (TypeError, AttributeError):
        # Blender refuses such a file.
        pass
    return ""


def _of_gltf(path: Path) -> Iterator[FileReference]:
    """Yield the external buffers and images of a glTF file."""
    document = _gltf_document(path)
    try:
        entries: list[Any] = [*document.get("buffers", ()), *document.get("images", ())]
        addresses = [entry["uri"] for entry in entries if "uri" in entry]
    except (TypeError, AttributeError) as error:
        raise UserError(f"{path}: is cut short, or not a glTF file: {error}") from None
    for address in addresses:
        if not is_data(address):
            yield FileReference(path, address, file_of(path, address))


def compressions(path: Path) -> list[str]:
    """Return the extensions by which a glTF file compresses its geometry."""
    names = _gltf_document(path).get("extensionsUsed")
    names = names if isinstance(names, list) else []
    return [name for name in names if "_compression" in str(name)]
