"""Makes a scene of a model file in glTF, USD, FBX, OBJ, PLY or STL, with Blender's importers."""

import logging
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from lightfield.configuration.keys import model_fingerprint
from lightfield.core.errors import UserError
from lightfield.core.files import atomic_path, keep_apart, listed, sha256, write_json
from lightfield.core.names import UP
from lightfield.core.paths import case_hint
from lightfield.engine import receipts
from lightfield.imaging import environment
from lightfield.imaging.images import is_readable
from lightfield.rendering.imports import model_completion, model_light, model_paint, model_volumes
from lightfield.rendering.models import gltf_copies, model_files, obj_files, usd_copies
from lightfield.rendering.models.model_references import (
    FileReference,
    printable,
    refuse_outside,
    refuse_special,
)
from lightfield.rendering.models.second_readers import compare, reading
from lightfield.rendering.scenes import blend_file
from lightfield.rendering.scenes.quiet import reading_quietly
from lightfield.rendering.scenes.render_graph import in_render
from lightfield.rendering.setup.pruning import objects_of_used_collections
from lightfield.settings.base import FARTHEST
from lightfield.stages.scene import ImportModel, ImportSettings

# The options of each importer that differ from its defaults. Cameras and lamps are removed anyway.
_OPTIONS: dict[str, dict[str, Any]] = {
    # Without this, an armature brings a mesh for the shape of its bones.
    "gltf": {"disable_bone_shape": True},
    "usd": {
        "import_cameras": False,
        "import_lights": False,
        "create_world_material": False,
        # Blender imports point instancers all the same.
        "import_curves": False,
        "import_points": False,
    },
}
# How an importer turns each axis that may point up.
_AXES = {
    "y": {"forward_axis": "NEGATIVE_Z", "up_axis": "Y"},
    "z": {"forward_axis": "Y", "up_axis": "Z"},
}

# If a model's largest side is beyond these, it is a mistake, and Blender's 32 bits cannot hold it.
_SIDES = (1e-9, 1e12)

# Models of things, from a ring to a building, have a largest side within these, in metres. In most
# other units, as in millimetres, their numbers are beyond.
_PLAUSIBLE = (0.01, 100.0)

# The largest side of a scaled model may differ from 1 by this, because Blender computes in 32 bits.
_TOLERANCE = 0.01

# The least and the largest coordinates of all meshes, (2, 3).
Box = NDArray[np.float64]


def import_model(job: ImportModel) -> None:
    """Make a scene of a model, save it as a .blend, and write the record of the import.

    Raises `UserError` as `make_scene` does.
    """
    model = job.settings.model
    keep_apart("--record", job.record, Path(model))
    content = make_scene(job.settings, job.output.parent)
    with atomic_path(job.output) as temporary:
        blend_file.save_scene(temporary)
    write_json(job.record, content)
    if content["left_out"]:
        print(f"note: {model}: left out: {'; '.join(content['left_out'])}")
    if "unjudged" in content:
        print(f"note: {model}: not compared with the file: {'; '.join(content['unjudged'])}")
    if "placement" in content:
        print(f"note: {model}: unit: box: {_placed(**content['placement'])}")
    print(f"{model}: {summary(content)}")


def make_scene(settings: ImportSettings, folder: Path) -> dict[str, Any]:
    """Make a scene of a model in the open file. Return the record of the import.

    ``folder`` is where the .blend will be.

    The record has the ``fingerprint``, the files that the model was read from as
    ``external_files``, the parts that are ``left_out``, its ``box`` in metres, and what the second
    reader of the format cannot judge as ``unjudged``. With unit: box, ``placement`` is how its
    points came into this box: they were moved by ``shift``, and then multiplied by ``scale``.

    Raises `UserError` for a model that is broken, empty, lacks files or parts, or names files
    outside its folder.
    """
    path = Path(settings.model)
    receipts.note_inputs([path])
    model_files.check(path)
    if settings.light_file:
        receipts.note_inputs([settings.light_file])
        environment.check(Path(settings.light_file))
    references, left_out = model_files.survey(path)
    refuse_special(path, references)
    refuse_outside(path, references, settings.shared_folder)
    receipts.note_inputs(reference.path for reference in references)
    if path.suffix.lower() == ".obj":
        receipts.note_inputs([obj_files.own_library(path)])
    if not settings.allow_missing:
        _refuse_missing(path, [reference.path for reference in references])
        _refuse_without(path, left_out)
    blend_file.new_scene()
    skipped, is_corrected = _import(path, settings.up, settings.frame)
    # After the import, because Blender says more of a broken file.
    facts = reading.read(path, settings.up, settings.frame)
    left_out += skipped
    if path.suffix.lower() in (".glb", ".gltf"):
        model_volumes.follow_gltf()
    is_mended, lost = model_completion.complete(path)
    left_out += lost
    if path.suffix.lower() == ".fbx":
        left_out += _forget_folders()
    unread_materials = _unread_materials()
    left_out += [
        f"the shader of the material {printable(material.name)}, which is no UsdPreviewSurface, "
        "but MaterialX or another that Blender does not read"
        for material in unread_materials
    ]
    _remove_cameras_and_lamps()
    refuse_outside(path, _textures(path, references), settings.shared_folder)
    files = _read_files(path, references)
    receipts.note_inputs(files)
    entries = [listed(file, path.parent) for file in files]
    unread_textures = _unread_textures()
    if not settings.allow_missing:
        _refuse_missing(path, files)
        _refuse_without(path, left_out)
        _refuse_unread(path, unread_textures)
    left_out += [f"{file} is missing" for file in _missing(files)] + unread_textures
    if path.suffix.lower() == ".obj":
        is_mended = model_paint.show_luminance() or obj_files.corrects_materials(path)
    _pack(path)
    for material in unread_materials:
        model_paint.paint(material)
    model_paint.give_material()
    bpy.context.scene.frame_set(settings.frame)
    shown = in_render(compare.shown_meshes)
    box = _box(path, [mesh.box for mesh in shown])
    if facts:
        lost = [*facts.lost, *compare.differences(facts, shown)]
        if not settings.allow_missing:
            _refuse_without(path, lost)
        left_out += [*lost, *facts.unused]
    placement = None
    if settings.unit == "box":
        placement = _scale_to_box(path, box)
        box = _box(path, in_render(compare.shown_boxes))
        if abs((box[1] - box[0]).max() - 1) > _TOLERANCE:
            raise UserError(
                f"{path}: Blender does not scale all its parts alike; export it without "
                "constraints, near its origin, or use unit: metres"
            )
    elif np.abs(box).max() > FARTHEST:
        raise UserError(
            f"{path}: reaches {np.abs(box).max():.3g} m from the origin, and Blender computes in "
            "32 bits; scale it with unit: box"
        )
    model_light.add(settings.light, box)
    if settings.ground:
        model_light.add_ground(box)
    _name_caches_from(folder)
    options = settings.model_dump(include={"unit", "up", "ground", "light", "frame"})
    if settings.light_file:
        options["light"] = sha256(settings.light_file)
    if unread_materials:
        # An earlier version left them black.
        options["grey"] = len(unread_materials)
    if is_corrected:
        # An earlier version showed what Blender makes of the file itself.
        options["corrected"] = 1
    if model_volumes.volumes():
        # An earlier version gave them other densities.
        options["volumes"] = len(model_volumes.volumes())
    if is_mended:
        # An earlier version left out colours and opacities.
        options["mended"] = True
    names = [(entry["path"], entry["sha256"]) for entry in entries]
    unjudged = facts.unjudged if facts else []
    return {
        "fingerprint": model_fingerprint(options, names),
        "box": box.round(6).tolist(),
        "external_files": entries,
        "left_out": left_out,
        **({"unjudged": unjudged} if unjudged else {}),
        **({"placement": placement} if placement else {}),
    }


def _import(path: Path, up: str, frame: int) -> tuple[list[str], bool]:
    """Import a model with the importer of its suffix.

    Return what it skips, and whether it read a corrected copy of a glTF or a USD.

    Raises `UserError` if it refuses the model.
    """
    suffix = path.suffix.lower()
    family = "gltf" if suffix in (".glb", ".gltf") else suffix[1:4]
    options = dict(_OPTIONS.get(family, {}))
    if suffix in UP:
        options |= _AXES[UP[suffix] if up == "auto" else up]
    operators: dict[str, Callable[..., set[str]]] = {
        "fbx": bpy.ops.wm.fbx_import,
        "gltf": bpy.ops.import_scene.gltf,
        "obj": bpy.ops.wm.obj_import,
        "ply": bpy.ops.wm.ply_import,
        "stl": bpy.ops.wm.stl_import,
        "usd": bpy.ops.wm.usd_import,
    }
    readers: dict[str, Callable[[Path], AbstractContextManager[Path]]] = {
        "gltf": gltf_copies.readable,
        "obj": obj_files.readable,
        "usd": partial(usd_copies.readable, frame=frame),
    }
    readable = readers.get(family, nullcontext)(path)
    try:
        with (
            reading_quietly(path),
            _skipped_by_gltf() as skipped,
            readable as file,
        ):
            # Blender would take a path with // before it for one from the .blend.
            result = operators[family](filepath=str(file.absolute()), **options)
            if file != path and family == "obj":
                _normalise_textures()
    except RuntimeError as error:
        raise UserError(_refusal(path, str(error))) from None
    except UnicodeError:
        raise UserError(_refusal(path, "it has a name that is not UTF-8")) from None
    if "FINISHED" not in result:
        raise UserError(_refusal(path, "it says nothing more"))
    return skipped, file != path and family != "obj"


def _normalise_textures() -> None:
    """Name textures by paths that do not lead through the folder of a copy of the model."""
    for image in _images():
        image.filepath_raw = os.path.normpath(image.filepath)


@contextmanager
def _skipped_by_gltf() -> Iterator[list[str]]:
    """Collect what the importer of glTF only logs: primitives that it cannot decode and skips."""
    messages: list[str] = []

    class Collector(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if "Skipping" in record.getMessage():
                messages.append(record.getMessage().rstrip("."))

    logger = logging.getLogger("glTFImporter_errors")
    collector = Collector()
    logger.addHandler(collector)
    try:
        yield messages
    finally:
        logger.removeHandler(collector)


def _refusal(path: Path, message: str) -> str:
    """Return in one line that an importer refuses a model. It may report a Python traceback."""
    lines = [line.strip() for line in message.splitlines() if line.strip()]
    if "Traceback" in message:
        # Blender adds the place of the operator's call.
        lines = [line for line in lines if re.match(r"\w*(Error|Exception): ", line)][-1:] or lines
    # Messages must be the same in every folder: the record of a family's member has them.
    reason = lines[0].removeprefix("Error: ").rstrip(".").replace(str(path.absolute()), str(path))
    advice = "export the model again"
    is_gltf = path.suffix.lower() in (".glb", ".gltf")
    names = model_files.compressions(path) if is_gltf else []
    # The reason is an unknown extension, or a path of this machine, where a decoder is missing.
    if names and re.search("not available|OSError|ecod", reason):
        reason = f"it cannot decode {' and '.join(names)}"
        advice = "export the model without compression"
    return f"{path}: Blender {bpy.app.version_string} cannot import it: {reason}; {advice}"


def _remove_cameras_and_lamps() -> None:
    """Remove what would change the dataset's own cameras and light."""
    kinds = {"CAMERA", "LIGHT", "LIGHT_PROBE", "SPEAKER"}
    for obj in [obj for obj in bpy.data.objects if obj.type in kinds]:
        # The world places of its children depend on it.
        if obj.children:
            empty = bpy.data.objects.new(obj.name, None)
            bpy.context.scene.collection.objects.link(empty)
            obj.user_remap(empty)
            empty.parent = obj.parent
            empty.matrix_local = obj.matrix_local
        bpy.data.objects.remove(obj)


def _read_files(path: Path, references: Sequence[FileReference]) -> list[Path]:
    """Return all files that a model was read from, also missing ones, in order."""
    files = {path, *(reference.path for reference in references)}
    for image in _images():
        if not image.packed_files:
            files.update(_image_files(image))
    return sorted({Path(os.path.relpath(file)) for file in files})


def _textures(path: Path, references: Sequence[FileReference]) -> Iterator[FileReference]:
    """Yield the textures that the importer has found: names of an OBJ's materials among them."""
    libraries = [each.path for each in references if each.path.suffix.lower() == ".mtl"]
    for image in _images():
        for file in () if image.packed_files else _image_files(image):
            name = os.fsencode(file.name)
            named_by = (each for each in libraries if each.is_file() and name in each.read_bytes())
            yield FileReference(next(named_by, path), os.path.relpath(file), file)


def _images() -> list[Any]:
    """Return the images that the importer has loaded from files."""
    return [image for image in bpy.data.images if image.source in ("FILE", "TILED", "SEQUENCE")]


def _forget_folders() -> list[str]:
    """Remove textures whose path is a folder, and return them as parts that are left out.

    Blender takes the model's folder for a texture of an FBX that has no relative path.
    """
    folders = [
        image
        for image in _images()
        if not image.packed_files and any(file.is_dir() for file in _image_files(image))
    ]
    for image in folders:
        bpy.data.images.remove(image)
    return ["it has a texture without a relative path"] if folders else []


def _image_files(image: Any) -> list[Path]:
    """Return the files of an image. One with tiles has several."""
    # Blender takes a backslash for a slash, too.
    path = bpy.path.abspath(image.filepath).replace("\\", "/")
    if image.source != "TILED":
        return [Path(path)]
    return [Path(path.replace("<UDIM>", str(tile.number))) for tile in image.tiles]


def _refuse_missing(path: Path, files: Sequence[Path]) -> None:
    """Raise `UserError` if a model names files that do not exist."""
    if missing_files := _missing(files):
        more = f" and {len(missing_files) - 8} more" if missing_files[8:] else ""
        raise UserError(
            f"{path}: files that it names are missing: {', '.join(missing_files[:8])}{more}; put "
            "them there, or render without them: scene: {allow_missing: true}"
        )


def _missing(files: Sequence[Path]) -> list[str]:
    """Return the names of the files that do not exist."""
    # Path.is_file() raises for a path that is too long.
    missing_files = [file for file in files if not os.path.isfile(file)]  # noqa: PTH113
    return [printable(f"{file}{case_hint(file)}") for file in missing_files]


def _refuse_without(path: Path, left_out: Sequence[str]) -> None:
    """Raise `UserError` if Blender leaves out parts of a model."""
    if left_out:
        more = f"; and {len(left_out) - 3} more" if left_out[3:] else ""
        raise UserError(
            f"{path}: parts of it would be left out: {'; '.join(left_out[:3])}{more}; export the "
            "model with all parts in files that Blender reads, or render without them: scene: "
            "{allow_missing: true}"
        )


def _refuse_unread(path: Path, textures: Sequence[str]) -> None:
    """Raise `UserError` if a model has textures that Blender leaves out, such as KTX2."""
    if textures:
        more = f" and {len(textures) - 1} more" if textures[1:] else ""
        raise UserError(
            f"{path}: {textures[0]}{more}; export it with PNG or JPEG, or render it magenta: "
            "scene: {allow_missing: true}"
        )


def _unread_textures() -> list[str]:
    """Return which textures Blender leaves out, or shows without a part."""
    left_out = [
        f"the material {material.name} has a texture on a server, or in a format that Blender does "
        "not read"
        for material in bpy.data.materials
        for node in material.node_tree.nodes
        if node.bl_idname == "ShaderNodeTexImage" and node.image is None
    ]
    damaged = [
        f"the texture {image.name} is damaged, or in a format that Blender does not read"
        for image in _damaged_images()
    ]
    return [printable(each) for each in left_out + damaged]


def _damaged_images() -> Iterator[Any]:
    """Yield the images that exist, but cannot be read."""
    for image in _images():
        if image.packed_files:
            readable = image.size[0] > 0
            # All of them at once may fill the memory.
            image.buffers_free()
        else:
            # Do not let Blender read files: 5.0 crashes on some broken EXRs.
            readable = all(is_readable(file) for file in _image_files(image) if file.is_file())
        if not readable:
            yield image


def _pack(path: Path) -> None:
    """Pack all textures into the .blend, without this machine's paths."""
    for image in _images():
        is_packed = bool(image.packed_files)
        if not is_packed and all(file.is_file() for file in _image_files(image)):
            try:
                image.pack()
            except RuntimeError as error:
                file = bpy.path.abspath(image.filepath)
                raise UserError(f"{path}: the texture {file} cannot be read: {error}") from None
        # Blender would read the file at another `filepath` again.
        image.filepath_raw = f"//{Path(image.filepath).name or image.name}"


def _name_caches_from(folder: Path) -> None:
    """Name the USD files of animations, which are read again for each frame, from ``folder``."""
    for cache in bpy.data.cache_files:
        absolute = bpy.path.abspath(cache.filepath)
        cache.filepath = bpy.path.relpath(absolute, start=str(folder.absolute()))


def _unread_materials() -> list[Any]:
    """Return the materials whose shader the importer of USD does not read: they have no nodes."""
    return [material for material in bpy.data.materials if not material.node_tree.nodes]


def _box(path: Path, boxes: Sequence[Box]) -> Box:
    """Return the box of all meshes. Raises `UserError` if there are none, or one is not finite."""
    if not boxes:
        raise UserError(f"{path}: has no faces to render; must have a mesh with faces")
    corners = np.array(boxes)
    if not np.isfinite(corners).all():
        raise UserError(f"{path}: has vertices whose places are not numbers; export it again")
    return np.array([corners[:, 0].min(0), corners[:, 1].max(0)])


def _scale_to_box(path: Path, box: Box) -> dict[str, Any]:
    """Scale the scene, so that the largest side of ``box`` is 1 and its middle the origin.

    Return the scene's shift in metres, and its scale.
    """
    side = float((box[1] - box[0]).max())
    if not side:
        raise UserError(f"{path}: all its vertices are at one place; must have a size")
    if not _SIDES[0] < side < _SIDES[1]:
        raise UserError(
            f"{path}: its largest side is {side:.3g}; must be from {_SIDES[0]:g} to {_SIDES[1]:g}"
        )
    model = bpy.data.objects.new("model", None)
    bpy.context.scene.collection.objects.link(model)
    # Objects that an instancer places scale with the instancer.
    instanced = objects_of_used_collections(bpy.data.user_map())
    for obj in bpy.data.objects:
        if obj.parent is None and obj != model and obj not in instanced:
            obj.parent = model
    model.matrix_world = Matrix.Scale(1 / side, 4) @ Matrix.Translation(-box.mean(0))
    model_volumes.scale(1 / side)
    bpy.context.view_layer.update()
    return {"shift": (-box.mean(0) + 0.0).tolist(), "scale": 1 / side}


def _placed(shift: Sequence[float], scale: float) -> str:
    """Return how a model came into the unit box, in words, and whether metres fit, too."""
    said = f"moved by ({', '.join(f'{each:.4g}' for each in shift)}), scaled by {scale:.4g}"
    side = 1 / scale
    if _PLAUSIBLE[0] <= side <= _PLAUSIBLE[1]:
        said += (
            f"; its largest side, {side:.4g} in the file, is plausible in metres: unit: metres "
            "keeps its size and place"
        )
    return said


def summary(record: dict[str, Any]) -> str:
    """Return what a record says of an imported model, in one line."""
    size = np.subtract(*reversed(record["box"]))
    sides = " × ".join(f"{side:.4g}" for side in size)
    return f"read from {len(record['external_files'])} files; its box has {sides} m"
