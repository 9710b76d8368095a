"""The names of Blender's view transforms and looks, and Blender's library that applies them.

Blender's own OpenColorIO and its configuration lie in bpy's package, and are used without importing
bpy. Every version of bpy brings the library that can read its configuration.
"""

import hashlib
import importlib.util
import sys
from collections.abc import Mapping
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import AfterValidator, Field

from lightfield.core.errors import UserError
from lightfield.core.names import FILE
from lightfield.settings.base import suggestion

FILE_LOOK = "file_look"
"""The key of lightfield.json with the look of the .blend, if something is developed with it."""

# Our pictures are sRGB.
DISPLAY = "sRGB"
# Blender's name for no look.
NO_LOOK = "None"
# What stands between a view transform and a look, also in Blender's own names.
_SEPARATOR = " - "


class Blender(NamedTuple):
    """Blender's OpenColorIO, its configuration, and the SHA-256 of this file."""

    ocio: Any
    config: Any
    sha256: str


@cache
def blender() -> Blender:
    """Load Blender's colour management. Raises `UserError` without bpy's package."""
    package = importlib.util.find_spec("bpy")
    if package is None or package.origin is None:
        raise UserError("look: needs Blender's colours, which the package bpy brings; install bpy")
    folder = Path(package.origin).parent
    # Blender itself has the package in a folder beside its data: 5.2/scripts/modules/bpy.
    if folder.parts[-3:-1] == ("scripts", "modules"):
        folder = folder.parents[3]
    file = _part_of_blender(folder, "[0-9]*/datafiles/colormanagement/config.ocio")
    ocio = _import(
        _part_of_blender(folder, "[0-9]*/python/lib/python*/site-packages/PyOpenColorIO")
    )
    return Blender(
        ocio,
        ocio.Config.CreateFromFile(str(file)),
        hashlib.sha256(file.read_bytes()).hexdigest(),
    )


def _part_of_blender(folder: Path, pattern: str) -> Path:
    """Return the path in Blender's folder that matches. Raises `UserError` if there is none."""
    path = next(folder.glob(pattern), None)
    if path is None:
        raise UserError(f"look: needs Blender's {folder / pattern}, which is missing; install bpy")
    return path


def _import(library: Path) -> Any:
    """Import a package from a folder that is not in Python's path."""
    if library.name not in sys.modules:
        spec = importlib.util.spec_from_file_location(
            library.name, library / "__init__.py", submodule_search_locations=[str(library)]
        )
        assert spec and spec.loader
        module = importlib.util.module_from_spec(spec)
        # The package imports its own library by this name.
        sys.modules[library.name] = module
        spec.loader.exec_module(module)
    return sys.modules[library.name]


def source() -> dict[str, str]:
    """Return what the pixels of all looks depend on: bpy's version, and its configuration."""
    return {"bpy": metadata.version("bpy"), "config_sha256": blender().sha256}


def source_of(name: str | None) -> str | None:
    """Return `source` as a text, for the settings of a job. None without a look."""
    return None if name is None else " ".join(source().values())


def views() -> list[str]:
    """Return the names of Blender's view transforms."""
    ocio, config, _ = blender()
    # With these arguments, environment variables hide no view.
    return [*config.getViews(ocio.VIEW_DISPLAY_DEFINED, DISPLAY)]


def looks(view: str) -> list[str]:
    """Return the names of the looks that Blender has for a view transform.

    A look whose name begins with a view transform is for this one alone. The looks without such a
    name are for the view transforms that have none of their own.
    """
    if is_data(view):
        return []
    names = [look.getName() for look in blender().config.getLooks()]
    own = [name for name in names if name.partition(_SEPARATOR)[0] == view]
    return own or [name for name in names if _SEPARATOR not in name]


def title(look: Mapping[str, Any]) -> str:
    """Return the name of a look for people, as `view_and_look` takes it.

    ``look`` has the keys view and look, as in lightfield.json.
    """
    view, name = look["view"], look["look"]
    if name == NO_LOOK:
        return str(view)
    return name if name.startswith(f"{view}{_SEPARATOR}") else f"{view}{_SEPARATOR}{name}"


def is_data(view: str) -> bool:
    """Return whether a view transform shows numbers as they are.

    Versions of Blender differ by up to 117 levels of 255 in what a look does to such a picture.
    """
    config = blender().config
    space = config.getColorSpace(config.getDisplayViewColorSpaceName(DISPLAY, view))
    return bool(space and space.isData())


def view_and_look(name: str) -> tuple[str, str]:
    """Return the view transform and the look in a name such as AgX or AgX - Punchy.

    Raises ``ValueError`` for another name.
    """
    view, separator, look = name.partition(_SEPARATOR)
    if view not in views():
        hint = suggestion(view, views())
        raise ValueError(f"must be none, {FILE}, or one of {', '.join(views())}{hint}")
    if not separator:
        return view, NO_LOOK
    shown = {each.removeprefix(f"{view}{_SEPARATOR}"): each for each in looks(view)}
    if look not in shown:
        allowed = [f"{view}{_SEPARATOR}{each}" for each in shown]
        if not allowed:
            raise ValueError(f"must be {view} without a look")
        hint = suggestion(name, allowed)
        raise ValueError(f"must be one of {', '.join(allowed)}{hint}")
    return view, shown[look]


def _checked(name: str | None) -> str | None:
    """Return the name of a look, or None for ``none``. Raises ``ValueError`` if there is none."""
    if name is None or name == "none":
        return None
    if name != FILE:
        view_and_look(name)
    return name


LOOK_FLAG = (
    "Blender's look of PNGs: file, as lightfield.json has it from the .blend; or a view transform "
    "of Blender, alone or with a look, such as AgX or AgX - Punchy"
)
LookName = Annotated[
    str | None,
    AfterValidator(_checked),
    Field(
        description="Blender's look, instead of plain sRGB. none: no look. file: as the .blend "
        "sets it, with its exposure, gamma, curves and white balance. Otherwise a view transform "
        "of Blender, such as AgX, Filmic or Khronos PBR Neutral, or one with a look, such as "
        "AgX - Punchy."
    ),
]


def check_beside(name: str | None, reinhard: float) -> None:
    """Raise ``ValueError`` for a look beside a tone mapping of its own."""
    if name is not None and reinhard != 1:
        raise ValueError("reinhard: does not go with look, which tone maps; leave out one of them")
