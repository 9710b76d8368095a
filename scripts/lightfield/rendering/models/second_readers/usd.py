"""Says what a USD holds, with OpenUSD itself, without Blender."""

from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path, PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.rendering.models.model_references import printable
from lightfield.rendering.models.second_readers.facts import (
    Geometry,
    MaterialFacts,
    MeshFacts,
    ModelFacts,
)
from lightfield.rendering.models.usd_files import (
    all_prims,
    array_of,
    openusd,
    preview_surface,
    producer,
)

Array = NDArray[np.float64]

_UPRIGHT = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], float)
# The shapes that Blender gives flat faces, and by how much of their size they are smaller.
_CURVED = {"Sphere", "Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1"}
_FLATTENED = 0.06
_TEXTURES = {
    "diffuseColor": "base colour",
    "opacity": "opacity",
    "metallic": "metallic",
    "roughness": "roughness",
    "normal": "normal",
    "emissiveColor": "emission",
}


def read(path: Path, frame: float) -> ModelFacts:
    """Return what a USD says at a frame, which is a time code. Raises `UserError` if it cannot."""
    usd = openusd()
    try:
        stage = usd.Usd.Stage.Open(str(path.absolute()))
        unjudged = _bake_skins(stage, frame)
        reader = _UsdReader(stage, frame)
        reader.visit(stage.GetPseudoRoot(), _world_from_stage(stage))
    except (RuntimeError, ValueError, KeyError, IndexError, TypeError) as error:
        raise UserError(f"{path}: is broken: {error}; export it again") from None
    return ModelFacts(
        reader.meshes,
        list(_materials(stage, frame)),
        lost=list(_changing(stage)),
        unused=sorted(reader.unused) + list(_displaced(stage)),
        unjudged=unjudged,
    )


def _world_from_stage(stage: Any) -> Array:
    """Return the matrix (4, 4) from a stage to Blender's metres with z up."""
    geom = openusd().UsdGeom
    metres = np.diag([*[geom.GetStageMetersPerUnit(stage)] * 3, 1])
    upright = _UPRIGHT if geom.GetStageUpAxis(stage) == "Y" else np.eye(4)
    return np.asarray(upright @ metres, np.float64)


def _bake_skins(stage: Any, frame: float) -> list[str]:
    """Bend the points of skinned meshes at a frame. Return the skins that cannot be bent."""
    usd = openusd()
    stage.SetEditTarget(stage.GetEditTargetForLocalLayer(stage.GetSessionLayer()))
    for prim in all_prims(stage):
        if prim.IsA(usd.UsdSkel.Animation) and not prim.IsInstanceProxy():
            _hold(prim, frame)
    unjudged = []
    roots = (prim for prim in all_prims(stage) if prim.IsA(usd.UsdSkel.Root))
    for root in roots:
        interval = usd.Gf.Interval(frame, frame)
        is_proxy = root.IsInstanceProxy()
        if is_proxy or not usd.UsdSkel.BakeSkinning(usd.UsdSkel.Root(root), interval):
            unjudged.append(f"the skeleton {printable(root.GetName())}")
    return unjudged


def _hold(animation: Any, frame: float) -> None:
    """Give an animation a key at a frame, because skins are bent only at keys."""
    for attribute in animation.GetAttributes():
        if attribute.GetNumTimeSamples():
            value = attribute.Get(frame)
            attribute.Set(value, frame)


def is_rendered(prim: Any) -> bool:
    """Return whether a prim is for renders, and not a guide or a stand-in."""
    return openusd().UsdGeom.Imageable(prim).ComputePurpose() in ("default", "render")


class _UsdReader:
    """Collects the surfaces of a stage at a frame."""

    def __init__(self, stage: Any, frame: float) -> None:
        self._stage = stage
        self._time = openusd().Usd.TimeCode(frame)
        self._geometry = cache(self._read_geometry)
        self.meshes: list[MeshFacts] = []
        self.unused: set[str] = set()

    def visit(self, prim: Any, parent: Array) -> None:
        """Collect the surfaces of a prim, and of the prims below it."""
        usd = openusd()
        geom = usd.UsdGeom
        shape = geom.Imageable(prim)
        if shape and shape.GetVisibilityAttr().Get(self._time) == "invisible":
            return
        matrix = self._placed(prim, parent)
        if prim.IsA(geom.PointInstancer):
            self._visit_instances(geom.PointInstancer(prim), matrix)
            return
        if prim.IsA(geom.Gprim) and is_rendered(prim):
            self._add(prim, matrix)
        for child in prim.GetFilteredChildren(usd.Usd.TraverseInstanceProxies()):
            self.visit(child, matrix)

    def _placed(self, prim: Any, parent: Array) -> Array:
        """Return the matrix (4, 4) of a prim in the world."""
        geom = openusd().UsdGeom
        if not prim.IsA(geom.Xformable):
            return parent
        shape = geom.Xformable(prim)
        if shape.GetResetXformStack():
            parent = _world_from_stage(self._stage)
        # OpenUSD multiplies rows by matrices.
        return np.asarray(parent @ np.array(shape.GetLocalTransformation(self._time)).T)

    def _visit_instances(self, instancer: Any, matrix: Array) -> None:
        prototypes = [
            self._stage.GetPrimAtPath(target)
            for target in instancer.GetPrototypesRel().GetTargets()
        ]
        numbers = instancer.GetProtoIndicesAttr().Get(self._time) or ()
        transforms = instancer.ComputeInstanceTransformsAtTime(
            self._time, self._time, instancer.ExcludeProtoXform, instancer.IgnoreMask
        )
        mask = list(instancer.ComputeMaskAtTime(self._time)) or [True] * len(numbers)
        for number, transform, is_shown in zip(numbers, transforms, mask, strict=False):
            if is_shown:
                self.visit(prototypes[number], matrix @ np.array(transform).T)

    def _add(self, prim: Any, matrix: Array) -> None:
        kind, name = str(prim.GetTypeName()), str(prim.GetName())
        if kind == "Mesh":
            if geometry := self._geometry(prim):
                self.meshes.append(geometry.placed(name, matrix))
            if _is_subdivided(prim):
                self.unused.add(f"the subdivision of the mesh {printable(name)}: its cage is shown")
        elif kind in {*_CURVED, "Cube", "Plane"}:
            self.meshes.append(self._shape(prim, matrix))

    def _read_geometry(self, prim: Any) -> Geometry | None:
        """Return the faces of a mesh. None if it has none, or some without corners."""
        mesh = openusd().UsdGeom.Mesh(prim)
        places, corners, sizes = (
            array_of(attribute, self._time).astype(kind)
            for attribute, kind in (
                (mesh.GetPointsAttr(), float),
                (mesh.GetFaceVertexIndicesAttr(), int),
                (mesh.GetFaceVertexCountsAttr(), int),
            )
        )
        is_whole = sizes.sum() == len(corners) and (not len(corners) or corners.max() < len(places))
        if not len(corners) or not is_whole:
            return None
        holes = array_of(mesh.GetHoleIndicesAttr(), self._time).astype(int)
        is_face = ~np.isin(np.arange(len(sizes)), holes)
        is_corner = np.repeat(is_face, sizes)
        colours = self._colours(prim, corners, sizes)
        if colours is not None:
            colours = colours[is_corner]
        return Geometry(places, corners[is_corner], sizes[is_face], colours)

    def _colours(self, prim: Any, corners: Any, sizes: Any) -> Array | None:
        """Return the colour (C, 3) of each corner that a mesh without material shows."""
        usd = openusd()
        if usd.UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]:
            return None
        primvar = usd.UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
        values = primvar.ComputeFlattened(self._time) if primvar else None
        if not values:
            return None
        colours = np.array(values, float)
        places = {
            "constant": np.zeros(len(corners), int),
            "uniform": np.repeat(np.arange(len(sizes)), sizes),
            "vertex": corners,
            "varying": corners,
            "faceVarying": np.arange(len(corners)),
        }[primvar.GetInterpolation()]
        return colours[places] if places.max() < len(colours) else None

    def _shape(self, prim: Any, matrix: Array) -> MeshFacts:
        """Return the box of a sphere and the like, around its own box's corners."""
        geom = openusd().UsdGeom
        extent = geom.Boundable.ComputeExtentFromPlugins(geom.Boundable(prim), self._time)
        low, high = np.array(extent, float)
        corners = np.where(np.indices((2, 2, 2)).reshape(3, 8).T, high, low)
        world = corners @ matrix[:3, :3].T + matrix[:3, 3]
        box = np.array([world.min(0), world.max(0)])
        is_curved = str(prim.GetTypeName()) in _CURVED
        # A turned curve is smaller than the box around its turned box.
        is_turned = np.count_nonzero(np.abs(matrix[:3, :3]) > 1e-9) > 3
        part = (0.45 if is_turned else _FLATTENED) if is_curved else 0
        return MeshFacts(str(prim.GetName()), box, slack=part * float((box[1] - box[0]).max()))


def _is_subdivided(prim: Any) -> bool:
    """Return whether a mesh asks for subdivision. By default it does, which nobody means."""
    scheme = openusd().UsdGeom.Mesh(prim).GetSubdivisionSchemeAttr()
    return bool(scheme.HasAuthoredValue() and scheme.Get() != "none")


def _changing(stage: Any) -> Iterator[str]:
    """Yield what appears or vanishes with time. Blender shows it as it is at one frame."""
    geom = openusd().UsdGeom
    for prim in all_prims(stage):
        if prim.IsA(geom.Imageable):
            times = geom.Imageable(prim).GetVisibilityAttr().GetTimeSamples()
            values = {geom.Imageable(prim).GetVisibilityAttr().Get(time) for time in times}
            if len(values) > 1:
                name = printable(prim.GetName())
                yield f"that {name} appears or vanishes with time: all frames show it as at one"


# ---- materials ------------------------------------------------------------------------------


def _materials(stage: Any, frame: float) -> Iterator[MaterialFacts]:
    """Yield the bound materials that have a UsdPreviewSurface, and a name of their own."""
    usd = openusd()
    bound = {}
    for prim in all_prims(stage):
        if prim.IsA(usd.UsdGeom.Gprim) and is_rendered(prim):
            material, _ = usd.UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
            if material:
                bound[material.GetPath()] = material
    names = [material.GetPrim().GetName() for material in bound.values()]
    for material in bound.values():
        shader = preview_surface(material)
        if shader and names.count(material.GetPrim().GetName()) == 1:
            yield _material(material.GetPrim().GetName(), shader, usd.Usd.TimeCode(frame))


def _displaced(stage: Any) -> Iterator[str]:
    """Yield the materials whose displacement Blender does not show."""
    usd = openusd()
    for prim in all_prims(stage):
        material = usd.UsdShade.Material(prim)
        shader = preview_surface(material) if material else None
        source = producer(shader.GetInput("displacement")) if shader else None
        if source is not None and (usd.UsdShade.Output.IsOutput(source) or source.Get()):
            yield f"the displacement of the material {printable(prim.GetName())}"


def _material(name: str, shader: Any, time: Any) -> MaterialFacts:
    colour, opacity, least, mode = (_value(shader, key, time) for key in _DEFAULTS)
    textures = dict(_textures(shader))
    if isinstance(opacity, float):
        opacity = float(opacity >= least) if least else opacity
    if not least and mode != "presence" and opacity != 1:
        # This is glass.
        opacity = None
        textures.pop("opacity", None)
    rgb = None if colour is None else (colour[0], colour[1], colour[2])
    return MaterialFacts(name, rgb, opacity, textures)


_DEFAULTS = {
    "diffuseColor": (0.18, 0.18, 0.18),
    "opacity": 1.0,
    "opacityThreshold": 0.0,
    "opacityMode": "transparent",
}


def _value(shader: Any, name: str, time: Any) -> Any:
    """Return the value of an input. None if another shader, such as a texture, gives it."""
    source = producer(shader.GetInput(name))
    if source is None:
        return _DEFAULTS[name]
    if openusd().UsdShade.Output.IsOutput(source):
        return None
    return source.Get(time)


def _textures(shader: Any) -> Mapping[str, str]:
    """Return the names of the textures that inputs are connected to, by their role.

    Textures that are missing, or on a server, are found elsewhere.
    """
    shade = openusd().UsdShade
    textures = {}
    for name, role in _TEXTURES.items():
        source = producer(shader.GetInput(name))
        if source is None or not shade.Output.IsOutput(source):
            continue
        texture = shade.Shader(source.GetPrim())
        file = producer(texture.GetInput("file"))
        if texture.GetIdAttr().Get() == "UsdUVTexture" and file and file.Get().resolvedPath:
            textures[role] = PurePath(file.Get().path.replace("\\", "/")).name
    return textures
