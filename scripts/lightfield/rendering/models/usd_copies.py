"""Lays corrections over USD files that Blender misreads, without changing the files.

A copy is a layer on top of the model. Its prims have the same paths, and say plainly what OpenUSD
composes: values that come through interfaces, inherited colours, places outside of parents, shears.
"""

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import bpy
import numpy as np
from numpy.typing import NDArray

from lightfield.rendering.models.usd_files import all_prims, openusd, preview_surface, producer

Matrix = NDArray[np.float64]
# A change of the copy's stage.
Edit = Callable[[Any], None]

# The colour of a UsdPreviewSurface that names none. Blender has another.
_DEFAULT_COLOUR = (0.18, 0.18, 0.18)
_COLOUR = "color3f"
_OPACITIES = ("opacity", "opacityThreshold", "opacityMode")
_LEAST = 1e-6
# The rows of a matrix without a shear stand at right angles, up to this cosine.
_SHEAR = 1e-5
_INHERITED = ("displayColor", "displayOpacity")
# What a mesh has in directions, and not in places.
_NORMALS = ("normals", "primvars:normals")


@contextmanager
def readable(path: Path, frame: float) -> Iterator[Path]:
    """Yield a USD that Blender reads right at a frame: the file itself, or a copy.

    Caches of animations that Blender has made of the copy name the file afterwards.
    """
    stage = openusd().Usd.Stage.Open(str(path.absolute()))
    edits = list(_edits(stage, frame))
    if not edits:
        yield path
        return
    with tempfile.TemporaryDirectory() as name:
        copy = Path(os.path.realpath(name)) / f"{path.stem}.usda"
        _write(stage, edits, copy)
        yield copy
        for cache in bpy.data.cache_files:
            cache.filepath = str(path.absolute())


def _write(stage: Any, edits: list[tuple[Any, Edit]], copy: Path) -> None:
    usd = openusd()
    original = stage.GetRootLayer()
    layer = usd.Sdf.Layer.CreateNew(str(copy))
    for key in original.pseudoRoot.ListInfoKeys():
        if key not in ("subLayers", "subLayerOffsets"):
            layer.pseudoRoot.SetInfo(key, original.pseudoRoot.GetInfo(key))
    layer.subLayerPaths.append(original.identifier)
    changed = usd.Usd.Stage.Open(layer)
    for place in sorted({place for prim, _ in edits for place in _instances(prim)}):
        # Prims of an instance cannot be changed for one instance alone.
        changed.OverridePrim(place).SetInstanceable(False)
    for _, edit in edits:
        edit(changed)
    layer.Save()


def _instances(prim: Any) -> Iterator[Any]:
    """Yield the paths of the instances in which a prim lies."""
    while prim:
        if prim.IsInstance():
            yield prim.GetPath()
        prim = prim.GetParent()


def _edits(stage: Any, frame: float) -> Iterator[tuple[Any, Edit]]:
    """Yield prims that Blender misreads, and what says the same plainly."""
    usd = openusd()
    time = usd.Usd.TimeCode(frame)
    for prim in all_prims(stage):
        found: list[Edit] = []
        if prim.IsA(usd.UsdShade.Material):
            found += _plain_shaders(usd.UsdShade.Material(prim), time)
        if prim.IsA(usd.UsdGeom.Gprim):
            found += _own_colours(prim, time)
        if prim.IsA(usd.UsdGeom.Imageable):
            found += _visibility_at(usd.UsdGeom.Imageable(prim), time)
        if prim.IsA(usd.UsdSkel.Animation):
            found += _more_keys(prim)
        if prim.IsA(usd.UsdGeom.Xformable):
            found += _placed_below_parent(usd.UsdGeom.Xformable(prim), time)
            found += _unsheared(prim, time)
        yield from ((prim, edit) for edit in found)


# ---- materials and colours ------------------------------------------------------------------


def _set(attribute: Any, value: Any) -> Edit:
    """Return an edit that gives an attribute a value, in place of keys."""
    place, kind = attribute.GetPath(), attribute.GetTypeName()

    def edit(stage: Any) -> None:
        prim = stage.OverridePrim(place.GetPrimPath())
        changed = prim.GetAttribute(place.name) or prim.CreateAttribute(place.name, kind)
        changed.Set(value)

    return edit


def _plain_shaders(material: Any, time: Any) -> Iterator[Edit]:
    """Give a material shaders with plain inputs, if some inputs have their values from elsewhere.

    For Blender, an input that was connected in any layer has no value of its own. So the shaders
    are new ones.
    """
    top = preview_surface(material)
    if not top:
        return
    shaders = {shader.GetPath(): _plain_shader(shader, time) for shader in _network(top)}
    surface = shaders[top.GetPath()]
    if producer(top.GetInput("diffuseColor")) is None:
        surface.inputs["diffuseColor"] = (_COLOUR, openusd().Gf.Vec3f(*_DEFAULT_COLOUR))
    _decide_opacity(surface.inputs)
    if any(shader.inputs != shader.said for shader in shaders.values()):
        yield _new_shaders(material.GetPath(), top.GetPath(), shaders)


def _decide_opacity(inputs: dict[str, tuple[str, Any]]) -> None:
    """Compare an opacity with its threshold. Without one, tell coverage from glass."""
    opacity, least, mode = (inputs.get(name, ("", None))[1] for name in _OPACITIES)
    if least and isinstance(opacity, float):
        inputs["opacity"] = ("float", float(opacity >= least))
    elif mode == "presence" and not least and opacity is not None:
        # Blender takes an opacity without threshold for glass.
        inputs["opacityThreshold"] = ("float", _LEAST)


class _Shader(NamedTuple):
    """A shader: its identity, and the type and the value or the source of each input.

    ``said`` has the inputs as they are written at the shader itself. ``outputs`` are types by name.
    """

    identity: str
    inputs: dict[str, tuple[str, Any]]
    said: dict[str, tuple[str, Any]]
    outputs: dict[str, str]


def _network(top: Any) -> list[Any]:
    """Return a shader and all on which its inputs depend."""
    shade = openusd().UsdShade
    found = {top.GetPath(): top}
    left = [top]
    while left:
        sources = [producer(entry) for entry in left.pop().GetInputs()]
        for source in sources:
            if source and shade.Output.IsOutput(source) and source.GetPrimPath() not in found:
                left.append(shade.Shader(source.GetPrim()))
                found[source.GetPrimPath()] = left[-1]
    return list(found.values())


def _plain_shader(shader: Any, time: Any) -> _Shader:
    inputs, said = {}, {}
    for entry in shader.GetInputs():
        name, kind, attribute = entry.GetBaseName(), str(entry.GetTypeName()), entry.GetAttr()
        source = producer(entry)
        connections = attribute.GetConnections()
        said[name] = (kind, connections[0] if connections else _anchored(attribute.Get(time)))
        if source is not None:
            is_output = openusd().UsdShade.Output.IsOutput(source)
            inputs[name] = (kind, source.GetPath() if is_output else _anchored(source.Get(time)))
    outputs = {out.GetBaseName(): str(out.GetTypeName()) for out in shader.GetOutputs()}
    return _Shader(str(shader.GetIdAttr().Get()), inputs, said, outputs)


def _anchored(value: Any) -> Any:
    """Return a value, with the whole path if it names a file that exists."""
    asset_path = openusd().Sdf.AssetPath
    is_found = isinstance(value, asset_path) and value.resolvedPath
    return asset_path(value.resolvedPath) if is_found else value


def _new_shaders(material: Any, top: Any, shaders: dict[Any, _Shader]) -> Edit:
    """Return an edit that makes shaders below a material, and shows the one from ``top``."""
    usd = openusd()
    places = {
        path: material.AppendChild(f"plain_{number}_{path.name}")
        for number, path in enumerate(shaders)
    }

    def edit(stage: Any) -> None:
        for path, shader in shaders.items():
            made = usd.UsdShade.Shader.Define(stage, places[path])
            made.CreateIdAttr(shader.identity)
            for name, kind in shader.outputs.items():
                made.CreateOutput(name, usd.Sdf.ValueTypeNames.Find(kind))
        for path, shader in shaders.items():
            made = usd.UsdShade.Shader(stage.GetPrimAtPath(places[path]))
            for name, (kind, value) in shader.inputs.items():
                entry = made.CreateInput(name, usd.Sdf.ValueTypeNames.Find(kind))
                if isinstance(value, usd.Sdf.Path):
                    source = places[value.GetPrimPath()].AppendProperty(value.name)
                    entry.GetAttr().SetConnections([source])
                elif value is not None:
                    entry.Set(value)
        surface = usd.UsdShade.Material(stage.GetPrimAtPath(material)).CreateSurfaceOutput()
        surface.GetAttr().SetConnections([places[top].AppendProperty("outputs:surface")])

    return edit


def _own_colours(prim: Any, time: Any) -> Iterator[Edit]:
    """Give a surface without material the colours and the opacity that it inherits."""
    usd = openusd()
    if usd.UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]:
        return
    for name in _INHERITED:
        primvars = usd.UsdGeom.PrimvarsAPI(prim)
        primvar = primvars.FindPrimvarWithInheritance(name)
        if primvar and primvar.GetAttr().GetPrim() != prim:
            yield _add_primvar(prim.GetPath(), name, primvar, primvar.ComputeFlattened(time))


def _add_primvar(place: Any, name: str, primvar: Any, value: Any) -> Edit:
    kind, interpolation = primvar.GetTypeName(), primvar.GetInterpolation()

    def edit(stage: Any) -> None:
        primvars = openusd().UsdGeom.PrimvarsAPI(stage.OverridePrim(place))
        primvars.CreatePrimvar(name, kind, interpolation).Set(value)

    return edit


# ---- places ---------------------------------------------------------------------------------


def _visibility_at(shape: Any, time: Any) -> Iterator[Edit]:
    """Show or hide what appears or vanishes with time as it is at one frame."""
    visibility = shape.GetVisibilityAttr()
    if visibility.GetNumTimeSamples():
        yield _set(visibility, visibility.Get(time))


def _more_keys(animation: Any) -> Iterator[Edit]:
    """Give rotations of bones a key at each frame. Blender turns unevenly between far keys."""
    rotations = openusd().UsdSkel.Animation(animation).GetRotationsAttr()
    keys = rotations.GetTimeSamples()
    if len(keys) < 2 or np.diff(keys).max() <= 1.01:
        return
    times = np.union1d(keys, np.arange(np.ceil(keys[0]), keys[-1]))
    values = [(float(time), rotations.Get(float(time))) for time in times]

    def edit(stage: Any) -> None:
        changed = stage.GetAttributeAtPath(rotations.GetPath())
        for time, value in values:
            changed.Set(value, time)

    yield edit


def _placed_below_parent(shape: Any, time: Any) -> Iterator[Edit]:
    """Say where a prim is that ignores its parents' places, as a place below its parent."""
    usd = openusd()
    if not shape.GetResetXformStack() or shape.TransformMightBeTimeVarying():
        return
    parent = usd.UsdGeom.XformCache(time).GetLocalToWorldTransform(shape.GetPrim().GetParent())
    yield _place(shape.GetPath(), shape.GetLocalTransformation(time) * parent.GetInverse())


def _place(path: Any, matrix: Any) -> Edit:
    def edit(stage: Any) -> None:
        shape = openusd().UsdGeom.Xformable(stage.OverridePrim(path))
        shape.ClearXformOpOrder()
        shape.AddTransformOp(opSuffix="plain").Set(matrix)

    return edit


def _unsheared(prim: Any, time: Any) -> Iterator[Edit]:
    """Move a shear from the matrix of a prim into the points of the meshes below it."""
    usd = openusd()
    if not _is_sheared(_local(prim, time)) or any(
        _is_sheared(_local(parent, time)) for parent in _parents(prim)
    ):
        return
    below = list(usd.Usd.PrimRange(prim, usd.Usd.TraverseInstanceProxies()))
    shapes = [each for each in below if each.IsA(usd.UsdGeom.Boundable)]
    if not all(_is_still_mesh(each) for each in shapes):
        return
    for each in below:
        if each.IsA(usd.UsdGeom.Xformable):
            yield _place(each.GetPath(), usd.Gf.Matrix4d(1))
    for each in shapes:
        yield _with_points(each, _below(each, prim, time), time)


def _parents(prim: Any) -> Iterator[Any]:
    while prim := prim.GetParent():
        yield prim


def _local(prim: Any, time: Any) -> Matrix:
    """Return the matrix (4, 4) of a prim, which multiplies rows."""
    shape = openusd().UsdGeom.Xformable(prim)
    return np.array(shape.GetLocalTransformation(time)) if shape else np.eye(4)


def _is_sheared(matrix: Matrix) -> bool:
    rows = matrix[:3, :3]
    lengths = np.linalg.norm(rows, axis=1)
    if not lengths.all():
        return False
    cosines = rows @ rows.T / np.outer(lengths, lengths)
    return bool(np.abs(cosines - np.eye(3)).max() > _SHEAR)


def _is_still_mesh(prim: Any) -> bool:
    """Return whether a prim is a mesh that neither moves nor bends."""
    geom = openusd().UsdGeom
    is_bent = prim.HasAPI(openusd().UsdSkel.BindingAPI)
    mesh = geom.Mesh(prim)
    if not mesh or is_bent or mesh.GetPointsAttr().ValueMightBeTimeVarying():
        return False
    shapes = (geom.Xformable(each) for each in (prim, *_parents(prim)))
    return not any(shape.TransformMightBeTimeVarying() for shape in shapes if shape)


def _below(prim: Any, top: Any, time: Any) -> Matrix:
    """Return the matrix (4, 4) from a prim to the parent of ``top``, which multiplies rows."""
    matrix = _local(prim, time)
    for parent in _parents(prim) if prim != top else ():
        matrix = matrix @ _local(parent, time)
        if parent == top:
            break
    return matrix


def _with_points(prim: Any, matrix: Matrix, time: Any) -> Edit:
    """Return an edit that moves the points and the normals of a mesh by a matrix."""
    usd = openusd()
    mesh = usd.UsdGeom.Mesh(prim)
    points = np.array(mesh.GetPointsAttr().Get(time) or ()).reshape(-1, 3)
    values = {"points": points @ matrix[:3, :3] + matrix[3, :3]}
    for name in _NORMALS:
        attribute = prim.GetAttribute(name)
        if attribute and attribute.HasAuthoredValue():
            normals = np.array(attribute.Get(time)) @ np.linalg.inv(matrix[:3, :3]).T
            values[name] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    is_mirrored = bool(np.linalg.det(matrix[:3, :3]) < 0)
    is_right_handed = (mesh.GetOrientationAttr().Get() == "rightHanded") != is_mirrored
    side = "rightHanded" if is_right_handed else "leftHanded"

    def edit(stage: Any) -> None:
        changed = stage.OverridePrim(prim.GetPath())
        for name, value in values.items():
            array = usd.Vt.Vec3fArray.FromNumpy(value.astype(np.float32))
            changed.GetAttribute(name).Set(array)
        usd.UsdGeom.Mesh(changed).CreateOrientationAttr(side)

    return edit
