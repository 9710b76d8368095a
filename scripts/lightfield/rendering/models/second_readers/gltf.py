"""Says what a glTF file holds, by its specification, without Blender."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.errors import UserError
from lightfield.rendering.models.model_references import printable
from lightfield.rendering.models.second_readers.facts import (
    Geometry,
    MaterialFacts,
    MeshFacts,
    ModelFacts,
)
from lightfield.rendering.models.second_readers.gltf_data import (
    Array,
    CompressedError,
    Document,
    file_of,
    is_data,
)
from lightfield.rendering.models.second_readers.gltf_motion import (
    animated,
    composed,
    world_matrices,
)

# glTF has y up and looks along +Z.
_UPRIGHT = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], float)
_INSTANCING = "EXT_mesh_gpu_instancing"
_POINTER = "KHR_animation_pointer"
# Extensions whose effect a view shows, or that change no view.
SHOWN = {
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
}


def read(path: Path, frame: float) -> ModelFacts:
    """Return what a glTF says at a frame. Raises `UserError` if the file is broken."""
    document = Document(path)
    try:
        unused, unjudged = list(_unused(document)), _pointers(document)
        materials = [] if unjudged else list(_materials(document))
        if any(pointer.startswith(("/nodes/", "/meshes/")) for pointer in unjudged):
            return ModelFacts(None, materials, unused=unused, unjudged=unjudged)
        try:
            meshes = _meshes(document, animated(document, frame))
        except CompressedError:
            unjudged.append("its meshes, because some data are compressed")
            return ModelFacts(None, materials, unused=unused, unjudged=unjudged)
        return ModelFacts(meshes, materials, unused=unused, unjudged=unjudged)
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, OSError) as error:
        raise UserError(f"{path}: is cut short, or not a glTF file: {error}") from None


# ---- meshes ---------------------------------------------------------------------------------


def _meshes(document: Document, nodes: Sequence[Mapping[str, Any]]) -> list[MeshFacts]:
    """Return the meshes with faces in Blender's world.

    Raises `CompressedError` if only a decoder can read one.
    """
    matrices = world_matrices(nodes, _roots(document))
    meshes: list[MeshFacts] = []
    for number, matrix in sorted(matrices.items()):
        node = nodes[number]
        if "mesh" not in node:
            continue
        mesh = document.all("meshes")[node["mesh"]]
        places = _places(document, mesh, node)
        if "skin" in node:
            skin = document.all("skins")[node["skin"]]
            places = _bent(document, mesh, skin, matrices, places)
            matrix = np.eye(4)
        geometry = Geometry(places, *_faces(document, mesh))
        if geometry:
            name = node.get("name") or mesh.get("name") or f"Mesh_{node['mesh']}"
            meshes += [
                geometry.placed(name, _UPRIGHT @ matrix @ instance)
                for instance in _instances(document, node)
            ]
    return meshes


def _roots(document: Document) -> list[int]:
    """Return the nodes of the scene that is shown. A file may lack scenes: then all nodes are."""
    scenes = document.all("scenes")
    if scenes:
        return list(scenes[document.content.get("scene", 0)].get("nodes", ()))
    nodes = document.all("nodes")
    children = {child for node in nodes for child in node.get("children", ())}
    return [number for number in range(len(nodes)) if number not in children]


def _primitives(mesh: Mapping[str, Any]) -> list[Any]:
    """Return the primitives of triangles. Points and lines are no surfaces."""
    for primitive in mesh["primitives"]:
        if "KHR_draco_mesh_compression" in primitive.get("extensions", ()):
            raise CompressedError
    has_places = (p for p in mesh["primitives"] if "POSITION" in p["attributes"])
    return [primitive for primitive in has_places if primitive.get("mode", 4) > 3]


def _places(document: Document, mesh: Mapping[str, Any], node: Mapping[str, Any]) -> Array:
    """Return the vertices (V, 3) of all primitives, with the morph targets' weights."""
    weights = node.get("weights", mesh.get("weights", ()))
    parts = [np.zeros((0, 3))]
    for primitive in _primitives(mesh):
        places = document.numbers(primitive["attributes"]["POSITION"])
        for weight, target in zip(weights, primitive.get("targets", ()), strict=False):
            if weight and "POSITION" in target:
                places = places + weight * document.numbers(target["POSITION"])
        parts.append(places)
    return np.concatenate(parts)


def _faces(document: Document, mesh: Mapping[str, Any]) -> tuple[Array, Array]:
    """Return the corners of all triangles of all primitives, and how many each has: three."""
    parts = [np.zeros((0, 3))]
    first = 0
    for primitive in _primitives(mesh):
        count = document.all("accessors")[primitive["attributes"]["POSITION"]]["count"]
        if "indices" in primitive:
            corners = document.numbers(primitive["indices"]).ravel()
        else:
            corners = np.arange(count, dtype=float)
        if len(corners) and np.max(corners) >= count:
            raise ValueError("a face has a corner that does not exist")
        parts.append(_triangles(corners, primitive.get("mode", 4)) + first)
        first += count
    triangles = np.concatenate(parts)
    return triangles.ravel(), np.full(len(triangles), 3)


def _triangles(corners: Array, mode: int) -> Array:
    """Return the triangles (T, 3) of a list, a strip or a fan. Modes are 4, 5 and 6."""
    if mode == 4:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if mode == 5:
        return np.stack([corners[:-2], corners[1:-1], corners[2:]], 1)
    first = np.full(max(0, len(corners) - 2), corners[0] if len(corners) else 0)
    return np.stack([first, corners[1:-1], corners[2:]], 1)


def _bent(
    document: Document,
    mesh: Mapping[str, Any],
    skin: Mapping[str, Any],
    matrices: Mapping[int, Array],
    places: Array,
) -> Array:
    """Return vertices (V, 3) in the world, where the joints of a skin put them."""
    joints = np.array([matrices[joint] for joint in skin["joints"]])
    if "inverseBindMatrices" in skin:
        inverse = document.numbers(skin["inverseBindMatrices"])[: len(joints)]
        joints = joints @ inverse.reshape(-1, 4, 4).transpose(0, 2, 1)
    bent, first = np.zeros_like(places), 0
    for primitive in _primitives(mesh):
        count = document.all("accessors")[primitive["attributes"]["POSITION"]]["count"]
        ends = slice(first, first + count)
        bent[ends] = _moved(document, primitive["attributes"], joints, places[ends])
        first += count
    return bent


def _moved(
    document: Document, attributes: Mapping[str, int], joints: Array, places: Array
) -> Array:
    """Return a primitive's vertices, each moved by its joints (J, 4, 4) with their weights."""
    blend, total = np.zeros((len(places), 4, 4)), np.zeros(len(places))
    for place in range(len(attributes)):
        if f"JOINTS_{place}" not in attributes:
            break
        numbers = document.numbers(attributes[f"JOINTS_{place}"]).astype(int)
        weights = document.numbers(attributes[f"WEIGHTS_{place}"])
        for number, weight in zip(numbers.T, weights.T, strict=True):
            blend += joints[number] * weight[:, None, None]
            total += weight
    blend /= np.where(total, total, 1)[:, None, None]
    blend[total == 0] = np.eye(4)
    moved: Array = np.einsum("vij,vj->vi", blend[:, :3, :3], places) + blend[:, :3, 3]
    return moved


def _instances(document: Document, node: Mapping[str, Any]) -> list[Array]:
    """Return the matrix (4, 4) of each instance of a node's mesh."""
    attributes = node.get("extensions", {}).get(_INSTANCING, {}).get("attributes", {})
    columns = {
        name: document.numbers(attributes[name])
        for name in ("TRANSLATION", "ROTATION", "SCALE")
        if name in attributes
    }
    if not columns:
        return [np.eye(4)]
    count = len(next(iter(columns.values())))
    plain = {"TRANSLATION": (0, 0, 0), "ROTATION": (0, 0, 0, 1), "SCALE": (1, 1, 1)}
    columns = {name: columns.get(name, np.tile(value, (count, 1))) for name, value in plain.items()}
    return [composed(*values) for values in zip(*columns.values(), strict=True)]


# ---- materials and features -----------------------------------------------------------------


def _materials(document: Document) -> Iterator[MaterialFacts]:
    """Yield the materials that meshes of the document use."""
    numbers = {
        primitive["material"]
        for mesh in document.all("meshes")
        for primitive in mesh["primitives"]
        if "material" in primitive and primitive.get("mode", 4) > 3
    }
    named = [document.all("materials")[number].get("name") for number in sorted(numbers)]
    for number in sorted(numbers):
        material = document.all("materials")[number]
        name = material.get("name")
        # Blender gives another number to the second of a name.
        if name and named.count(name) == 1 and not material.get("extensions"):
            yield _material(document, name, material)


def _material(document: Document, name: str, material: Mapping[str, Any]) -> MaterialFacts:
    base = material.get("pbrMetallicRoughness", {})
    entries = {
        "base colour": base.get("baseColorTexture"),
        "roughness": base.get("metallicRoughnessTexture"),
        "metallic": base.get("metallicRoughnessTexture"),
        "normal": material.get("normalTexture"),
        "emission": material.get("emissiveTexture"),
    }
    textures = {role: _picture(document, entry) for role, entry in entries.items() if entry}
    *colour, alpha = base.get("baseColorFactor", (1, 1, 1, 1))
    is_plain = "base colour" not in textures
    is_opaque = material.get("alphaMode", "OPAQUE") == "OPAQUE"
    return MaterialFacts(
        name,
        (colour[0], colour[1], colour[2]) if is_plain else None,
        1.0 if is_opaque else alpha if is_plain and material["alphaMode"] == "BLEND" else None,
        textures,
    )


def _picture(document: Document, entry: Mapping[str, Any]) -> str:
    """Return the name of the picture file of a texture. "" if it is in the glTF, or a choice."""
    texture = document.all("textures")[entry["index"]]
    if "source" not in texture or texture.get("extensions"):
        return ""
    address = document.all("images")[texture["source"]].get("uri")
    return "" if address is None or is_data(address) else file_of(document.path, address).name


def _unused(document: Document) -> Iterator[str]:
    """Yield what the file names, and no view shows."""
    used = document.content.get("extensionsUsed", ())
    for name in used if isinstance(used, list) else ():
        if name not in SHOWN:
            yield f"the extension {printable(str(name))}"
    names = [each.get("name") or f"{n}" for n, each in enumerate(document.all("animations"))]
    if names[1:]:
        others = ", ".join(map(printable, names[1:]))
        yield f"the animations {others}: only the first, {printable(names[0])}, moves the model"
    variants = document.content.get("extensions", {}).get("KHR_materials_variants", {})
    if variants.get("variants"):
        names = [each.get("name", "") for each in variants["variants"]]
        yield f"the variants {', '.join(map(printable, names))}: the default materials are shown"


def _pointers(document: Document) -> list[str]:
    """Return what the first animation moves by pointers, such as /materials/0/emissiveFactor."""
    return [
        channel["target"]["extensions"][_POINTER]["pointer"]
        for animation in document.all("animations")[:1]
        for channel in animation["channels"]
        if channel["target"]["path"] == "pointer"
    ]
