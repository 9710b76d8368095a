"""The keys that identify a view's pixels: the scene's fingerprint, the render key, and the seed.

Two views with equal keys have equal pixels. So a finished view is recognised by its key, and never
rendered twice. A view of other settings has another key.

Two things are not in the key. Pruning changes no byte (see `lightfield.rendering.setup.pruning`).
The machine changes last digits (see `lightfield.core.machine`), but a build may be resumed on
another. So each view names the machine that rendered it, and validation reports differences.
"""

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from lightfield.configuration import own_builder
from lightfield.configuration.scene_source import Parameters, SceneSource
from lightfield.core.errors import UserError
from lightfield.core.files import sha256
from lightfield.core.names import BUILDERS, IMU, SOFTBOXES
from lightfield.core.paths import files_below
from lightfield.formats import published
from lightfield.formats.lightfield import MACHINE, MODEL_PLACEMENT, RIG_FIT, LightField, View
from lightfield.imaging.blender_looks import FILE_LOOK

# The versions of the steps that make views. The keys of the views that a step concerns have its
# version, and no other keys have it. Raise a version when equal settings give other files.
VERSIONS = {
    # All rendered views.
    "render": 4,
    # Views with passes of surfaces.
    "surfaces": 2,
    # Denoised views that are rendered only in part.
    "part": 1,
    # Views of a user's .blend.
    "blend": 1,
    # Views of a user's .blend with a pass of numbers.
    "numbers": 1,
    # Views of a user's .blend with mattes.
    "mattes": 1,
    # Transparent views of a scene that may have shadow catchers.
    "catchers": 1,
    # Optical flow.
    "flow": 1,
    # Views of models, if the import makes another scene of them.
    "model": 2,
    # Views of models in softboxes, for the same reason.
    "softboxes": 1,
    # The import of models, if it refuses or records something else. Views keep their keys.
    "import": 4,
    # The choice of spread test views. Views keep their keys.
    "spread": 1,
    # The choice of the points of exports that have a number of them. Views keep their keys.
    "points": 1,
}


# Cached, because a look-up in a package's files takes a millisecond.
version = cache(metadata.version)


def scene_fingerprint(source: SceneSource, external: Sequence[tuple[str, str | None]] = ()) -> str:
    """Return the identity of a scene YAML's ``scene`` block: 64 hexadecimal digits.

    - A .blend: its SHA-256, and the path and SHA-256 of each of the ``external`` files that it
      reads. None stands for a missing file. Raises `UserError` if its own SHA-256 is unknown.
    - Somebody else's views: their lightfield.json.
    - A builder: the parameters, bpy's version, and source code: its own, the builders' library, and
      the builders whose pieces it uses. The built .blend does not count: it holds memory addresses,
      which differ between builds.
    - A user's own builder: likewise, with its own files, and the library only if it uses it.
    """
    if source.blend:
        if source.sha256 is None:
            raise UserError(f"{source.blend}: its sha256 is not known; check_blend.py records it")
        return _digest([source.sha256, external]) if external else source.sha256
    if source.dataset:
        return _digest(published.fingerprint(source.dataset))
    assert source.builder
    return builder_fingerprint(source.builder, source.parameters)


def builder_fingerprint(name: str, parameters: Parameters | Mapping[str, Any] | None) -> str:
    """Return the identity of a scene of the builder ``name``: see `scene_fingerprint`."""
    if isinstance(parameters, Parameters):
        parameters = parameters.model_dump(exclude_none=True)
        files = []
        folders = ["library", name]
    else:
        builder = Path(name)
        own_files = own_builder.files(builder)
        files = [[file.relative_to(builder.parent).as_posix(), sha256(file)] for file in own_files]
        folders = own_builder.imported_builders(own_files)
    for folder in _builder_folders(folders):
        for file in _sources(folder):
            files.append([file.relative_to(BUILDERS).as_posix(), _hash(file.read_bytes())])
    return _digest([files, parameters, version("bpy")])


def _sources(folder: str) -> list[Path]:
    """Return the files of source code in a folder of builders."""
    return [file for file in files_below(BUILDERS / folder) if file.suffix == ".py"]


def _builder_folders(folders: Sequence[str]) -> list[str]:
    """Return the folders with the source of builders, and the folders of those that they use."""
    folders = [*folders]
    for folder in folders:
        for file in _sources(folder):
            imported = re.findall(
                r"^from scenes\.(\w+)", file.read_text(encoding="utf-8"), re.MULTILINE
            )
            folders += [name for name in dict.fromkeys(imported) if name not in folders]
    return folders


def _model_version(light: str) -> int:
    """Return the version of the import of models in a ``light``."""
    return VERSIONS["model"] + (VERSIONS["softboxes"] if light == SOFTBOXES else 0)


def import_version(light: str) -> int:
    """Return the versions that change whenever models in a ``light`` must be imported again."""
    return _model_version(light) + VERSIONS["import"]


def model_fingerprint(options: Mapping[str, Any], files: Sequence[tuple[str, str | None]]) -> str:
    """Return the identity of an imported model: 64 hexadecimal digits.

    ``options`` say how it was imported, and its ``light``. ``files`` are path and SHA-256 of each
    file that it was read from. None stands for a missing file.
    """
    return _digest([_model_version(options["light"]), version("bpy"), dict(options), files])


# The keys of lightfield.json that change no view. Views are light, whatever look is given to
# versions of them. A model's fingerprint says how it is placed, and the poses where the rig is.
_NOT_OF_VIEWS = (MACHINE, FILE_LOOK, MODEL_PLACEMENT, RIG_FIT, IMU)


def render_key(lightfield: LightField, view: View) -> str:
    """Return the key of one of the views of a light field: 64 hexadecimal digits."""
    pose = view.world_from_camera.tolist()
    content = {key: value for key, value in lightfield.content.items() if key not in _NOT_OF_VIEWS}
    key = [VERSIONS["render"], version("bpy"), content, view.name, pose]
    if any(view_pass.unless for view_pass in lightfield.passes):
        key.append(VERSIONS["surfaces"])
    if renders_part(lightfield) and lightfield.render.denoise:
        key.append(["part", VERSIONS["part"]])
    if _is_of_blend(lightfield):
        key.append(["blend", VERSIONS["blend"]])
        if any(view_pass.kind == "id" for view_pass in lightfield.passes):
            key.append(["numbers", VERSIONS["numbers"]])
        if any(view_pass.kind == "matte" for view_pass in lightfield.passes):
            key.append(["mattes", VERSIONS["mattes"]])
    if lightfield.transparent and _may_have_shadow_catchers(lightfield):
        key.append(["catchers", VERSIONS["catchers"]])
    return _digest(key)


def _is_of_blend(lightfield: LightField) -> bool:
    """Return whether the scene is a user's .blend: neither built nor a model."""
    scene = lightfield.content.get("scene", {})
    return "fingerprint" in scene and not scene.keys() & {"builder", "unit"}


def _may_have_shadow_catchers(lightfield: LightField) -> bool:
    """Return whether the scene is a user's .blend, or a model on a ground."""
    return _is_of_blend(lightfield) or lightfield.content.get("scene", {}).get("ground", False)


def renders_part(lightfield: LightField) -> bool:
    """Return whether views are rendered only where they can show something: a model.

    Without denoising, this changes no byte.
    """
    return (
        "unit" in lightfield.content.get("scene", {})
        and lightfield.transparent
        and not lightfield.passes
        and lightfield.content["camera"]["type"] == "PERSP"
    )


def names_key(lightfield: LightField) -> str:
    """Return the key of the numbers of a light field's objects and materials."""
    return _digest([VERSIONS["render"], version("bpy"), lightfield.content.get("scene")])


def flow_key(lightfield: LightField, view: View, other: View, sums: Sequence[str]) -> str:
    """Return the key of the flow between two views, whose SHA-256 checksums are ``sums``."""
    poses = [view.world_from_camera.tolist(), other.world_from_camera.tolist()]
    return _digest([VERSIONS["flow"], lightfield.lens.to_lightfield(), poses, list(sums)])


def view_seed(seed: int, name: str) -> int:
    """Return the Cycles seed, 0 to 2^31 − 1, of the view ``name`` under the scene's ``seed``."""
    return int(_digest([seed, name])[:8], 16) & 0x7FFFFFFF


def _digest(content: Any) -> str:
    return _hash(json.dumps(content, sort_keys=True, allow_nan=False).encode())


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
