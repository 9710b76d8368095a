"""Says what an FBX holds: its meshes at rest, and its features that Blender misreads."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from lightfield.core.errors import UserError
from lightfield.rendering.models.model_references import printable
from lightfield.rendering.models.second_readers.facts import Geometry, MeshFacts, ModelFacts
from lightfield.rendering.models.second_readers.fbx_tree import Thing, Tree

Array = NDArray[np.float64]

_MOVED = ("Lcl Translation", "Lcl Rotation", "Lcl Scaling")
# What points to the right, to the back and up in Blender: the setting, its default, and its sign.
_AXES = (("CoordAxis", 0, 1), ("FrontAxis", 2, -1), ("UpAxis", 1, 1))
_PIVOTS = ("RotationPivot", "RotationOffset", "ScalingPivot", "ScalingOffset")
# The orders of rotations by their number. The first letter turns first.
_ORDERS = ("xyz", "xzy", "yzx", "yxz", "zxy", "zyx")
# The ticks of FBX in a second.
_SECOND = 46186158000
# If keys are farther apart, pivots matter between them, in seconds.
_DENSE = 1 / 20
# A node takes its parents' rotation and scale in this way: as matrices multiply.
_PLAIN_INHERITANCE = 1
_LINEAR_SKIN = ("Linear", "Rigid")


def read(path: Path, _frame: float) -> ModelFacts:
    """Return what an FBX says. Meshes that move are not judged. Raises `UserError` if it is broken.

    Blender shows a frame between keys as it likes, so only models at rest are compared.
    """
    try:
        tree = Tree(path)
    except UserError:
        # Blender has read it.
        return ModelFacts(None, unjudged=["the file, which the second reader cannot read"])
    lost = [*_caches(tree), *_inbetweens(tree), *_layers(tree), *_pivots(tree), *_subdivided(tree)]
    unused = list(_further_animations(tree))
    unjudged = list(dict.fromkeys(_unjudged(tree)))
    try:
        meshes = None if unjudged else list(_meshes(tree))
    except (IndexError, ValueError, TypeError, KeyError) as error:
        raise UserError(f"{path}: is broken: {error}; export it again") from None
    return ModelFacts(meshes, lost=lost, unused=unused, unjudged=unjudged)


# ---- features -------------------------------------------------------------------------------


def _of_kind(tree: Tree, kind: str) -> Iterator[tuple[int, Thing]]:
    return ((number, thing) for number, thing in tree.objects.items() if thing.kind == kind)


def _caches(tree: Tree) -> Iterator[str]:
    for _, thing in _of_kind(tree, "Deformer"):
        if thing.category == "VertexCacheDeformer":
            yield f"the vertex cache {printable(thing.name)}"


def _inbetweens(tree: Tree) -> Iterator[str]:
    for number, thing in _of_kind(tree, "Deformer"):
        if thing.category == "BlendShapeChannel":
            shapes = [shape for _, shape, _ in tree.children(number, "Geometry")]
            if len(shapes) > 1:
                yield f"the shapes between the ends of {printable(thing.name)}"


def _layers(tree: Tree) -> Iterator[str]:
    for number, thing in _of_kind(tree, "AnimationStack"):
        layers = [
            layer.name
            for key, layer, _ in tree.children(number, "AnimationLayer")
            if any(tree.children(key, "AnimationCurveNode"))
        ]
        if len(layers) > 1:
            names = ", ".join(map(printable, layers))
            yield f"the layers {names} of the animation {printable(thing.name)}"


def _further_animations(tree: Tree) -> Iterator[str]:
    names = [thing.name for _, thing in _of_kind(tree, "AnimationStack")]
    if len(names) > 1:
        others = ", ".join(map(printable, names[1:]))
        yield f"the animations {others}: only one moves the model"


def _pivots(tree: Tree) -> Iterator[str]:
    """Yield the objects that turn or grow about a pivot, with keys that lie far apart."""
    for number, thing in _of_kind(tree, "Model"):
        properties = tree.properties(thing)
        has_pivot = any(np.any(_triple(properties, name)) for name in _PIVOTS)
        if has_pivot and any(_gap(tree, number, name) > _DENSE for name in _MOVED[1:]):
            yield f"the pivot of {printable(thing.name)} between the keys of its animation"


def _gap(tree: Tree, owner: int, name: str) -> float:
    """Return the longest time in seconds between keys of a property with other values."""
    longest = 0.0
    for number, _, target in tree.children(owner, "AnimationCurveNode"):
        for _, curve, _ in tree.children(number, "AnimationCurve") if target == name else ():
            times, values = curve.node.numbers("KeyTime"), curve.node.numbers("KeyValueFloat")
            for (begin, end), (first, last) in zip(pairwise(times), pairwise(values), strict=False):
                if first != last:
                    longest = max(longest, (end - begin) / _SECOND)
    return longest


def _subdivided(tree: Tree) -> Iterator[str]:
    for _, thing in _of_kind(tree, "Geometry"):
        levels = [*thing.node.numbers("PreviewDivisionLevels")]
        levels += [*thing.node.numbers("RenderDivisionLevels")]
        if any(thing.node.numbers("Smoothness")) and any(levels):
            name = next((model.name for _, model in _owners(tree, thing)), thing.name)
            yield f"the subdivision of the mesh {printable(name)}"


def _owners(tree: Tree, thing: Thing) -> Iterator[tuple[int, Thing]]:
    """Yield the models that show a geometry."""
    numbers = {number for number, each in tree.objects.items() if each is thing}
    for connection in tree.connections:
        owner = tree.objects.get(connection.owner)
        if connection.child in numbers and owner and owner.kind == "Model":
            yield connection.owner, owner


def _unjudged(tree: Tree) -> Iterator[str]:
    """Yield why the reader cannot say where the meshes are."""
    if tree.is_old:
        yield "its meshes, because it is older than FBX 7"
    for _, thing in _of_kind(tree, "AnimationCurve"):
        if len(set(thing.node.numbers("KeyValueFloat"))) > 1:
            yield "its meshes, because they may move"
            break
    for number, thing in _of_kind(tree, "Deformer"):
        kind = thing.node.child("SkinningType")
        if thing.category == "Skin" and kind and kind.values[0] not in _LINEAR_SKIN:
            yield "its meshes, because a skin is not linear"
        if thing.category == "BlendShapeChannel" and any(
            True for _ in tree.children(number, "AnimationCurveNode")
        ):
            yield "its meshes, because their shapes may change"
    for thing in tree.objects.values():
        if thing.kind == "Constraint" or thing.category == "LodGroup":
            yield f"its meshes, because it has a {printable(thing.category or thing.kind)}"
    for _, thing in _of_kind(tree, "Model"):
        properties = tree.properties(thing)
        if properties.get("InheritType", _PLAIN_INHERITANCE) != _PLAIN_INHERITANCE:
            scales = _triple(properties, "Lcl Scaling", 1)
            if not np.allclose(scales, 1):
                yield "its meshes, because children do not take all scales of their parents"


# ---- meshes ---------------------------------------------------------------------------------


def _meshes(tree: Tree) -> Iterator[MeshFacts]:
    """Yield the meshes in the world of Blender."""
    world = _world(tree.settings())
    parents = _parents(tree)
    for number, model in _of_kind(tree, "Model"):
        for key, geometry, _ in tree.children(number, "Geometry"):
            if geometry.category != "Mesh":
                continue
            local = _global(tree, number, parents) @ _geometric(tree.properties(model))
            places = geometry.node.numbers("Vertices").reshape(-1, 3)
            places = _shaped(tree, key, places)
            rest = places @ local[:3, :3].T + local[:3, 3]
            bent = _bent(tree, key, places, rest, parents)
            if bent is not None:
                places, local = bent, np.eye(4)
            shown = Geometry(places, *_faces(geometry))
            if shown:
                yield shown.placed(model.name, world @ local)


def _parents(tree: Tree) -> dict[int, int]:
    """Return the parent of each model. The root of the scene is 0."""
    return {
        connection.child: connection.owner
        for connection in tree.connections
        if not connection.property
        and connection.child in tree.objects
        and tree.objects[connection.child].kind == "Model"
        and (connection.owner == 0 or tree.objects.get(connection.owner, (None,))[0] == "Model")
    }


def _world(settings: dict[str, Any]) -> Array:
    """Return the matrix (4, 4) from the file's units and axes to Blender.

    If it names no axes, they are Blender's. If it names no unit, it is a centimetre.
    """
    matrix = np.zeros((4, 4))
    for row, (name, default, sign) in enumerate(_AXES):
        matrix[row, int(settings.get(name, default))] = sign * int(settings.get(f"{name}Sign", 1))
    if "UpAxis" not in settings:
        matrix = np.eye(4)
    matrix *= float(settings.get("UnitScaleFactor", 1)) / 100
    matrix[3, 3] = 1
    return matrix


def _triple(properties: dict[str, Any], name: str, default: float = 0) -> Array:
    return np.array(properties.get(name, (default,) * 3), float).reshape(3)


def _global(tree: Tree, number: int, parents: dict[int, int]) -> Array:
    """Return the matrix (4, 4) of a model in the scene."""
    matrix = np.eye(4)
    seen = set()
    while number and number not in seen:
        seen.add(number)
        matrix = _local(tree.properties(tree.objects[number])) @ matrix
        number = parents.get(number, 0)
    return matrix


def _moved(offset: Array) -> Array:
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


def _turned(angles: Array, order: int = 0) -> Array:
    matrix = np.eye(4)
    # Lower letters turn about fixed axes.
    sequence = _ORDERS[order]
    picked = [angles["xyz".index(axis)] for axis in sequence]
    matrix[:3, :3] = Rotation.from_euler(sequence, picked, degrees=True).as_matrix()
    return matrix


def _local(properties: dict[str, Any]) -> Array:
    """Return the matrix (4, 4) of a model in its parent, about its pivots."""
    get = {name: _triple(properties, name) for name in (*_PIVOTS, *_MOVED[:2])}
    order = int(properties.get("RotationOrder", 0))
    before = _turned(_triple(properties, "PreRotation"))
    after = _turned(_triple(properties, "PostRotation"))
    scale = np.diag([*_triple(properties, "Lcl Scaling", 1), 1])
    rotation = before @ _turned(get["Lcl Rotation"], order if order < 6 else 0)
    rotation = rotation @ np.linalg.inv(after)
    turned = _moved(get["RotationPivot"]) @ rotation @ _moved(-get["RotationPivot"])
    scaled = _moved(get["ScalingPivot"]) @ scale @ _moved(-get["ScalingPivot"])
    start = _moved(get["Lcl Translation"]) @ _moved(get["RotationOffset"])
    return np.asarray(start @ turned @ _moved(get["ScalingOffset"]) @ scaled)


def _geometric(properties: dict[str, Any]) -> Array:
    """Return the matrix (4, 4) of a mesh in its model, which the model's children lack."""
    scale = np.diag([*_triple(properties, "GeometricScaling", 1), 1])
    turn = _turned(_triple(properties, "GeometricRotation"))
    return np.asarray(_moved(_triple(properties, "GeometricTranslation")) @ turn @ scale)


def _faces(geometry: Thing) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the vertices of all corners, and each face's number of corners."""
    corners = geometry.node.numbers("PolygonVertexIndex").astype(np.int64)
    # The last corner of a face is written as -1 - vertex.
    ends = np.flatnonzero(corners < 0)
    sizes = np.diff(ends, prepend=-1)
    corners = np.where(corners < 0, -1 - corners, corners)[: int(sizes.sum())]
    is_face = sizes > 2
    return corners[np.repeat(is_face, sizes)], sizes[is_face]


def _shaped(tree: Tree, geometry: int, places: Array) -> Array:
    """Return vertices (V, 3) with the shapes of their mesh, as far as these are mixed in."""
    shaped = places.copy()
    for number, deformer, _ in tree.children(geometry, "Deformer"):
        for key, channel, _ in tree.children(number, "Deformer"):
            if deformer.category == "BlendShape":
                written = channel.node.numbers("DeformPercent")
                default = written[0] if len(written) else 0
                weight = float(tree.properties(channel).get("DeformPercent", default)) / 100
                for _, shape, _ in tree.children(key, "Geometry") if weight else ():
                    indices = shape.node.numbers("Indexes").astype(int)
                    shaped[indices] += weight * shape.node.numbers("Vertices").reshape(-1, 3)
    return shaped


def _bent(
    tree: Tree, geometry: int, places: Array, rest: Array, parents: dict[int, int]
) -> Array | None:
    """Return vertices (V, 3) in the scene, where bones put them. None if the mesh has no bones.

    ``rest`` is where vertices are that no bone moves.
    """
    blend, total = np.zeros((len(places), 4, 4)), np.zeros(len(places))
    for number, skin, _ in tree.children(geometry, "Deformer"):
        for key, cluster, _ in tree.children(number, "Deformer") if skin.category == "Skin" else ():
            indices = cluster.node.numbers("Indexes").astype(int)
            weights = cluster.node.numbers("Weights")
            for bone, _, _ in tree.children(key, "Model"):
                bind = cluster.node.numbers("Transform").reshape(4, 4).T
                matrix = _global(tree, bone, parents) @ bind
                np.add.at(blend, indices, matrix * weights[:, None, None])
                np.add.at(total, indices, weights)
    if not total.any():
        return None
    blend /= np.where(total, total, 1)[:, None, None]
    bent = np.einsum("vij,vj->vi", blend[:, :3, :3], places) + blend[:, :3, 3]
    return np.where(total[:, None] > 0, bent, rest)
