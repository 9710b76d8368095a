"""Finds the files that a USD names, and its parts that Blender leaves out, with OpenUSD itself.

Blender reads USD with the same library, and says nothing of what it cannot find or read.
"""

import importlib
import itertools
import os
import re
import sys
from collections.abc import Iterator
from functools import cache
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.rendering.models.model_references import FileReference, Survey

# The suffixes of files that Blender reads for a USD. Others, such as sounds, affect no pixel.
_LAYERS = (".usd", ".usda", ".usdc", ".usdz")
_TEXTURES = (".png", ".jpg", ".jpeg", ".exr", ".hdr", ".tif", ".tiff", ".bmp", ".tga", ".webp")
_VOLUMES = (".vdb",)
# The types of geometry that Blender imports.
_IMPORTED = {"Mesh", "Cube", "Sphere", "Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1"}
_IMPORTED |= {"Plane", "Volume"}
# The types of geometry that a model never shows, because they are no surfaces.
_NO_SURFACES = {"BasisCurves", "NurbsCurves", "HermiteCurves", "Points"}


@cache
def openusd() -> SimpleNamespace:
    """Return the modules of the OpenUSD that comes with Blender. Blender itself is not loaded."""
    package = Path(str(metadata.distribution("bpy").locate_file("bpy")))
    folder = next(package.glob("*/python/**/site-packages"))
    # Only for this import: the folder has other packages, such as OpenImageIO, in other versions.
    sys.path.append(str(folder))
    try:
        names = ("Ar", "Gf", "Sdf", "Usd", "UsdGeom", "UsdShade", "UsdSkel", "UsdUtils", "Vt")
        return SimpleNamespace(**{name: importlib.import_module(f"pxr.{name}") for name in names})
    finally:
        sys.path.remove(str(folder))


def survey(path: Path) -> Survey:
    """Return the files that a USD names, and its parts that cannot be composed or imported.

    Raises `UserError` if the file is broken.
    """
    usd = openusd()
    references: list[FileReference] = []

    def note(layer: Any, dependency: Any) -> Any:
        # These are the tiles of a texture and the files of value clips.
        for name in dependency.dependencies or [dependency.assetPath]:
            if reference := _reference(layer, name):
                references.append(reference)
        return dependency

    address = str(path.absolute())
    try:
        # Layers live until nothing refers to them, so this one is read once.
        layer = usd.Sdf.Layer.FindOrOpen(address)
        layers, _, _ = usd.UsdUtils.ComputeAllDependencies(address, note)
        stage = usd.Usd.Stage.Open(layer)
        left_out = [*_composition_errors(path, stage), *_surfaces_left_out(stage)]
    except RuntimeError:
        raise UserError(
            f"{path}: is cut short, or not a USD file, or a layer of it is; export it again"
        ) from None
    except UnicodeError:
        raise UserError(f"{path}: names a file by bytes that are not UTF-8; rename it") from None
    lights = _names_of_lights(stage)
    references = [each for each in references if each.name not in lights]
    # An expression may name a layer, and a layer may be in a format of another library.
    noted = {reference.path for reference in references}
    for file in {_file(each.realPath) for each in [*layers, *stage.GetUsedLayers()]}:
        if file and Path(file) not in noted:
            references.append(FileReference(path.absolute(), file, Path(file)))
    others = {each for each in references if each.path != path.absolute()}
    return Survey([_from(path.parent, each) for each in sorted(others)], left_out)


def _reference(layer: Any, name: str) -> FileReference | None:
    """Return the reference of a layer to a file that Blender reads. None for anything else.

    A name may be an address on a server, which is no file. <UDIM> stands for the tiles of a
    texture, and is no file either.
    """
    usd = openusd()
    file = re.sub(r"\[.*\]$", "", name)
    is_read = file.lower().endswith(_LAYERS + _TEXTURES + _VOLUMES)
    if not is_read or "<" in file or "://" in file:
        return None
    named_by = Path(_file(layer.realPath))
    anchored = usd.Sdf.ComputeAssetPathRelativeToLayer(layer, name)
    # Without ./ before it, a name is also looked for in the working folder.
    path = named_by.parent / _file(str(usd.Ar.GetResolver().Resolve(anchored)) or anchored)
    return FileReference(named_by, name, path)


def _file(address: str) -> str:
    """Return the file of an address. A file in an archive has the archive's name before it."""
    outer, _ = openusd().Ar.SplitPackageRelativePathOuter(address)
    return str(outer)


def _from(folder: Path, reference: FileReference) -> FileReference:
    """Return a reference with paths that begin with the model's folder, as the user names it."""
    named_by, path = (
        Path(os.path.normpath(folder / os.path.relpath(each, folder)))
        for each in (reference.named_by, reference.path)
    )
    return FileReference(named_by, reference.name, path)


def _composition_errors(path: Path, stage: Any) -> list[str]:
    """Return why a stage is incomplete: missing and unknown files, servers, and cycles."""
    messages = set()
    for error in stage.GetCompositionErrors():
        prim = stage.GetPrimAtPath(error.rootSite.path)
        if prim and not prim.IsActive():
            continue
        message = str(error).replace(f"{path.absolute().parent}/", "")
        # Remove the name of the session's layer, and the arguments with which layers were opened.
        message = re.sub(r",@anon:[^@]*@|:SDF_FORMAT_ARGS:[^@]*", "", message)
        # OpenUSD takes an address for a path, and shortens it.
        message = re.sub(r"@(\w+):/(?=\w)", r"@\1://", message)
        messages.add(" ".join(message.split()).rstrip("."))
    return sorted(messages)


def _names_of_lights(stage: Any) -> set[str]:
    """Return the files that only lights name, such as an environment's. No light is imported."""
    earliest = openusd().Usd.TimeCode.EarliestTime()
    names: dict[bool, set[str]] = {True: set(), False: set()}
    for prim in _prims(stage):
        is_light = re.search(r"Light(_\d+)?$", str(prim.GetTypeName())) is not None
        attributes = [
            each for each in prim.GetAuthoredAttributes() if each.GetTypeName() == "asset"
        ]
        names[is_light] |= {value.path for each in attributes if (value := each.Get(earliest))}
    return names[True] - names[False]


def _prims(stage: Any) -> Iterator[Any]:
    """Yield the prims of a stage, and of its instances, which the stage's own do not include."""
    roots = [stage.GetPseudoRoot(), *stage.GetPrototypes()]
    return itertools.chain.from_iterable(map(openusd().Usd.PrimRange, roots))


def _surfaces_left_out(stage: Any) -> list[str]:
    """Return the visible surfaces of a stage that Blender does not import, or not as they are."""
    usd = openusd()
    problems = []
    for prim in _prims(stage):
        type_name = prim.GetTypeName()
        if type_name == "Mesh" and (fault := _fault(usd.UsdGeom.Mesh(prim))):
            problem = f"the mesh {prim.GetName()} has {fault}"
        elif type_name in _IMPORTED and prim.IsInstance():
            problem = f"Blender does not import the {type_name} {prim.GetName()}, an instance"
        elif type_name not in _IMPORTED | _NO_SURFACES and prim.IsA(usd.UsdGeom.Gprim):
            problem = f"Blender does not import the {type_name} {prim.GetName()}"
        else:
            continue
        shape = usd.UsdGeom.Imageable(prim)
        is_shown = shape.ComputeVisibility() != "invisible"
        if is_shown and shape.ComputePurpose() in ("default", "render"):
            problems.append(problem)
    return sorted(problems)


def _fault(mesh: Any) -> str | None:
    """Return what is wrong with the faces of a mesh, if anything. Blender leaves such faces out."""
    usd = openusd()
    earliest = usd.Usd.TimeCode.EarliestTime()
    attributes = {
        mesh.GetFaceVertexCountsAttr(): usd.Vt.IntArray,
        mesh.GetFaceVertexIndicesAttr(): usd.Vt.IntArray,
        mesh.GetPointsAttr(): usd.Vt.Vec3fArray,
    }
    values = []
    for attribute, array in attributes.items():
        value = attribute.Get(earliest)
        # A file may declare any type.
        if not isinstance(value, array | None):
            return f"{attribute.GetName()} of another type than {attribute.GetTypeName()}"
        values.append(value or ())
    counts, corners = (np.array(each, int) for each in values[:2])
    places = len(values[2])
    exist = not len(corners) or (corners.min() >= 0 and corners.max() < places)
    fits = counts.sum() == len(corners) and exist
    return None if fits else "faces with corners that do not exist"


def array_of(attribute: Any, time: Any) -> NDArray[Any]:
    """Return the values of an attribute at a time: no values if it has none, or is no array."""
    value = attribute.Get(time)
    return np.array(value if hasattr(value, "__len__") else ())


def all_prims(stage: Any) -> list[Any]:
    """Return all prims of a stage, also the prims of instances."""
    usd = openusd().Usd
    return list(usd.PrimRange(stage.GetPseudoRoot(), usd.TraverseInstanceProxies()))


def preview_surface(material: Any) -> Any:
    """Return the UsdPreviewSurface of a material. None if it has another shader, or none."""
    shader, _, _ = material.ComputeSurfaceSource()
    is_preview = shader and shader.GetIdAttr().Get() == "UsdPreviewSurface"
    return shader if is_preview else None


def producer(entry: Any) -> Any:
    """Return the attribute that gives an input's value: its own, or a shader's output.

    None if nothing gives it a value.
    """
    if not entry:
        return None
    shade = openusd().UsdShade
    for attribute in shade.Utils.GetValueProducingAttributes(entry):
        if shade.Output.IsOutput(attribute) or attribute.HasAuthoredValue():
            return attribute
    return None
