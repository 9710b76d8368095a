"""Develops light to display pixels as Blender does: its view transforms and looks."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.names import FILE
from lightfield.imaging.blender_looks import (
    DISPLAY,
    NO_LOOK,
    blender,
    is_data,
    looks,
    source,
    view_and_look,
)
from lightfield.imaging.primaries import REC_709, white_balance

Floats = NDArray[np.float32]

# Blender's name for the colour space of all light here.
_LIGHT = "Linear Rec.709"
# Brighter light would become NaN.
_BRIGHTEST = 1e6


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
    look: str = NO_LOOK
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
                "look: file needs the .blend's look, which lightfield.json has only if the scene "
                "YAML says look: file; give look a name"
            )
        own = cls.from_json(file_look)
        if own.look != NO_LOOK and is_data(own.view):
            raise UserError(
                f"look: file: the .blend shows {own.view} with the look {own.look}, which versions "
                "of Blender show differently; choose another view transform or no look in "
                "Blender's Color Management, or give look a name"
            )
        # Like Blender, ignore a look that is not for the view transform.
        look = own.look if own.look in looks(own.view) else NO_LOOK
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

    def table(self, shaper: NDArray[Any]) -> NDArray[np.uint8]:
        """Return the 8-bit pixels (n, n, n, 3) of all light whose channels are in ``shaper`` (n,).

        Red changes along the first axis, and blue along the last one.
        """
        red, green, blue = np.meshgrid(shaper, shaper, shaper, indexing="ij")
        return np.asarray(self.to_pixels(np.stack([red, green, blue], axis=-1), 8), np.uint8)

    @cached_property
    def _processor(self) -> Any:
        """What turns light into pixels, built of the steps that Blender takes, in its order."""
        ocio, config, _ = blender()
        steps = ocio.GroupTransform()
        space = _LIGHT
        steps.appendTransform(ocio.MatrixTransform(self._matrix.reshape(-1).tolist()))
        has_look = self.look != NO_LOOK
        if has_look:
            look_space = config.getLook(self.look).getProcessSpace()
            steps.appendTransform(ocio.LookTransform(src=space, dst=look_space, looks=self.look))
            space = look_space
        steps.appendTransform(
            ocio.DisplayViewTransform(
                src=space, display=DISPLAY, view=self.view, looksBypass=has_look
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
