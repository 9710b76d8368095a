"""Develops light to display pixels as Blender does: its view transforms and looks.

Blender's own OpenColorIO and its configuration do it. They lie in bpy's package, and are used
without importing bpy. Every version of bpy brings the library that can read its configuration.
"""

import hashlib
import importlib.util
import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from lightfield.core.errors import UserError
from lightfield.core.settings import suggestion
from lightfield.imaging.primaries import REC_709, white_balance

Floats = NDArray[np.float32]

FILE = "file"
"""Instead of a look's name: the look of the .blend."""
FILE_LOOK = "file_look"
"""The key of lightfield.json with the look of the .blend, if something is developed with it."""

# Our pictures are sRGB.
_DISPLAY = "sRGB"
# Blender's name for the colour space of all light here.
_LIGHT = "Linear Rec.709"
# Blender's name for no look.
_NO_LOOK = "None"
# What stands between a view transform and a look, also in Blender's own names.
_SEPARATOR = " - "
# Brighter light would become NaN.
_BRIGHTEST = 1e6


class _Blender(NamedTuple):
    """Blender's OpenColorIO, its configuration, and the SHA-256 of this file."""

    ocio: Any
    config: Any
    sha256: str


@cache
def _blender() -> _Blender:
    """Load Blender's colour management. Raises `UserError` without bpy's package."""
    package = importlib.util.find_spec("bpy")
    if package is None or package.origin is None:
        raise UserError("look: needs Blender's colours, which the package bpy brings; install bpy")
    folder = Path(package.origin).parent
    (file,) = folder.glob("*/datafiles/colormanagement/config.ocio")
    (library,) = folder.glob("*/python/lib/python*/site-packages/PyOpenColorIO")
    ocio = _import(library)
    return _Blender(
        ocio,
        ocio.Config.CreateFromFile(str(file)),
        hashlib.sha256(file.read_bytes()).hexdigest(),
    )


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
    return {"bpy": metadata.version("bpy"), "config_sha256": _blender().sha256}


def source_of(name: str | None) -> str | None:
    """Return `source` as a text, for the settings of a job. None without a look."""
    return None if name is None else " ".join(source().values())


def views() -> list[str]:
    """Return the names of Blender's view transforms."""
    ocio, config, _ = _blender()
    # With these arguments, environment variables hide no view.
    return [*config.getViews(ocio.VIEW_DISPLAY_DEFINED, _DISPLAY)]


def looks(view: str) -> list[str]:
    """Return the names of the looks that Blender has for a view transform.

    A look whose name begins with a view transform is for this one alone. The looks without such a
    name are for the view transforms that have none of their own.
    """
    if _is_data(view):
        return []
    names = [look.getName() for look in _blender().config.getLooks()]
    own = [name for name in names if name.partition(_SEPARATOR)[0] == view]
    return own or [name for name in names if _SEPARATOR not in name]


def _is_data(view: str) -> bool:
    """Return whether a view transform shows numbers as they are.

    Versions of Blender differ by up to 117 levels of 255 in what a look does to such a picture.
    """
    config = _blender().config
    space = config.getColorSpace(config.getDisplayViewColorSpaceName(_DISPLAY, view))
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
        return view, _NO_LOOK
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


def check_beside(name: str | None, reinhard: float, key: str = "look") -> None:
    """Raise ``ValueError`` for a look beside a tone mapping of its own."""
    if name is not None and reinhard != 1:
        raise ValueError(
            f"reinhard: does not go with {key}, which tone maps; leave out one of them"
        )


@dataclass(frozen=True)
class Curves:
    """The curves of a .blend's colour management, which Blender applies to light before a look.

    - ``black``, ``white`` (3,): the light that the curves take for 0 and 1.
    - ``start``, ``end`` (3,): the first and the last value of each channel's table.
    - ``tables`` (3, n): what becomes of n equally spaced values from start to end.
    - ``slopes`` (3, 2): how each channel goes on before the start and after the end.
    """

    black: list[float]
    white: list[float]
    start: list[float]
    end: list[float]
    tables: list[list[float]]
    slopes: list[list[float]]

    def apply(self, light: Floats) -> Floats:
        """Return what becomes of light (n, 3)."""
        black = np.array(self.black, np.float32)
        scale = 1 / np.maximum(np.array(self.white, np.float32) - black, np.float32(1e-5))
        values = (light - black) * scale
        return np.stack([self._bent(channel, values[:, channel]) for channel in range(3)], axis=1)

    def _bent(self, channel: int, values: Floats) -> Floats:
        """Return what a channel's curve makes of its values (n,)."""
        table = np.array(self.tables[channel], np.float32)
        start = self.start[channel]
        end = self.end[channel]
        before, after = self.slopes[channel]
        bent = np.interp(values, np.linspace(start, end, len(table)), table)
        bent += before * np.minimum(values - start, 0) + after * np.maximum(values - end, 0)
        return np.asarray(bent, np.float32)


@dataclass(frozen=True)
class Look:
    """How Blender develops light: a view transform with a look, as Blender names both.

    - ``exposure``: in stops.
    - ``gamma``: the exponent 1 / gamma applies to the display's pixels.
    - ``white`` (3,): the colour of light that becomes white. None: white itself.
    - ``curves``: None for straight ones.
    """

    view: str
    look: str = _NO_LOOK
    exposure: float = 0.0
    gamma: float = 1.0
    white: list[float] | None = None
    curves: Curves | None = None
    source: Mapping[str, str] = field(default_factory=source)

    @classmethod
    def of(cls, name: str | None, exposure: float, file_look: Any = None) -> "Look | None":
        """Return the look with a name, or the .blend's own. None without a name.

        ``exposure`` adds to the exposure of the .blend. Raises `UserError` without ``file_look``,
        which is the entry `FILE_LOOK` of lightfield.json.
        """
        if name is None:
            return None
        if name != FILE:
            view, look = view_and_look(name)
            return cls(view, look, exposure)
        if file_look is None:
            raise UserError(
                "look: file needs the .blend's look, which lightfield.json does not have"
            )
        own = cls.from_json(file_look)
        if own.look != _NO_LOOK and _is_data(own.view):
            raise UserError(
                f"look: file: the .blend shows {own.view} with the look {own.look}, which versions "
                "of Blender show differently; choose another view transform or no look in "
                "Blender's Color Management, or give look a name"
            )
        # Like Blender, ignore a look that is not for the view transform.
        look = own.look if own.look in looks(own.view) else _NO_LOOK
        return replace(own, look=look, exposure=own.exposure + exposure)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> "Look":
        """Return the look that a content of `to_json` describes, by the bpy that is installed."""
        keys = ("view", "look", "exposure", "gamma", "white")
        values = {key: content[key] for key in keys if key in content}
        if curves := content.get("curves"):
            values["curves"] = Curves(**curves)
        return cls(**values)

    def to_json(self) -> dict[str, Any]:
        """Return the look as lightfield.json has it, with what its pixels depend on."""
        content: dict[str, Any] = {
            "view": self.view,
            "look": self.look,
            "exposure": self.exposure,
            "gamma": self.gamma,
        }
        if self.white:
            content["white"] = self.white
        if self.curves:
            content["curves"] = vars(self.curves)
        return {**content, **self.source}

    @property
    def header(self) -> str:
        """The look as an image's header has it: without the numbers of its curves."""
        content = self.to_json()
        if self.curves:
            content["curves"] = True
        return json.dumps(content)

    def developed(self, light: NDArray[Any], alpha: NDArray[Any] | None = None) -> Floats:
        """Return the display's colour, 0 to 1, of linear Rec. 709 light (…, 3).

        Light is not multiplied with ``alpha`` (…, 1), which is above 0. Blender applies curves to
        light that is.
        """
        shown = np.nan_to_num(light.reshape(-1, 3).astype(np.float32), posinf=_BRIGHTEST)
        if self.curves:
            covered = np.float32(1) if alpha is None else alpha.reshape(-1, 1)
            shown = self.curves.apply(shown * covered) / covered
        shown = np.ascontiguousarray(np.clip(shown, -_BRIGHTEST, _BRIGHTEST), np.float32)
        self._processor.applyRGB(shown)
        # This turns NaN into 0.
        return np.fmin(np.fmax(shown, 0), 1).reshape(light.shape)

    def to_pixels(
        self, light: NDArray[Any], bits: int, alpha: NDArray[Any] | None = None
    ) -> NDArray[np.uint8 | np.uint16]:
        """Return `developed` light as whole numbers of 8 or 16 bits."""
        shown = self.developed(light, alpha)
        shown *= np.float32(2**bits - 1)
        return np.rint(shown, out=shown).astype(f"uint{bits}")

    @cached_property
    def _processor(self) -> Any:
        """What turns light into pixels, built of the steps that Blender takes, in its order."""
        ocio, config, _ = _blender()
        steps = ocio.GroupTransform()
        space = _LIGHT
        steps.appendTransform(ocio.MatrixTransform(self._matrix.reshape(-1).tolist()))
        has_look = self.look != _NO_LOOK
        if has_look:
            look_space = config.getLook(self.look).getProcessSpace()
            steps.appendTransform(ocio.LookTransform(src=space, dst=look_space, looks=self.look))
            space = look_space
        steps.appendTransform(
            ocio.DisplayViewTransform(
                src=space, display=_DISPLAY, view=self.view, looksBypass=has_look
            )
        )
        if self.gamma != 1:
            exponent = 1 / self.gamma
            steps.appendTransform(ocio.ExponentTransform([exponent, exponent, exponent, 1.0]))
        return config.getProcessor(steps).getDefaultCPUProcessor()

    @property
    def _matrix(self) -> NDArray[np.float64]:
        """The matrix (4, 4) of exposure and white balance."""
        matrix = np.eye(4)
        if self.white:
            matrix[:3, :3] = white_balance(self.white, REC_709)
        matrix[:3, :3] *= 2.0**self.exposure
        return matrix
