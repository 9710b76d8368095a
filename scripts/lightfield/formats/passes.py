"""The passes that a view can have beside its colour and depth, each in an EXR of its own.

A pass has a folder of its name beside lightfield.json: normal/view_0000f.exr. Settings, rendering,
validation and reprojection all use this table.
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from lightfield.formats import light_groups

# The prefix of the light groups' passes, here and in Cycles.
GROUP_PREFIX = "Combined_"

# The prefix of the passes that materials write, in Cycles. In INEXACT a surface writes 1 if it is
# not one opaque Principled BSDF.
AOV_PREFIX = "plenoforge_"
INEXACT = f"{AOV_PREFIX}inexact"

# The estimated variance of a pixel's colour. Half floats would lose small values.
VARIANCE = "variance"
# It is estimated from so many parts of the samples, each rendered by itself.
SAMPLE_PARTS = 8

# The JSON beside images of ids, which maps names to ids.
NAMES = "names.json"


@dataclass(frozen=True)
class Pass:
    """One pass.

    ``kind`` says how reprojections resample it:

    - "light" and "value": as colour;
    - "normal": as colour, and scaled to a unit vector again;
    - "id", "matte" and "variance": the value of the source pixel that the ray falls in;
    - "motion" and "flow": not at all, because they are in pixels of their own lens.

    Its values are the sum of the Cycles passes ``cycles``. If it has them, this sum is multiplied
    by the Cycles pass ``factor``, and the Cycles pass ``without`` is subtracted. Values are 0 where
    the Cycles pass ``unless`` is not. A matte holds them side by side. Light, values and mattes are
    means over all samples, and the variance is the variance of such a mean. Other passes describe
    the surface at the pixel's centre, as depth does.
    """

    name: str
    kind: Literal["light", "value", "matte", "variance", "normal", "id", "motion", "flow"]
    channels: tuple[str, ...]
    dtype: str
    meaning: str
    cycles: tuple[str, ...]
    factor: str | None = None
    without: str | None = None
    unless: str | None = None

    @property
    def of_colour(self) -> bool:
        """Whether it follows from all samples, and does not describe the pixel's centre."""
        return self.kind in ("light", "value", "matte", "variance")

    @property
    def needed(self) -> tuple[str, ...]:
        """All Cycles passes that it is computed from."""
        others = [name for name in (self.factor, self.without, self.unless) if name]
        return (*self.cycles, *others)

    @property
    def bytes(self) -> int:
        """The bytes of a pixel, uncompressed."""
        return len(self.channels) * (2 if self.dtype == "float16" else 4)

    def path(self, folder: Path, view: str) -> Path:
        """Return a view's file of this pass. ``folder`` is the folder of lightfield.json."""
        return folder / self.name / f"{view}.exr"


def _light(name: str, meaning: str, *cycles: str, factor: str | None = None) -> Pass:
    return Pass(name, "light", ("R", "G", "B"), "float16", meaning, cycles, factor)


def of_group(group: str) -> Pass:
    """Return the pass of the light of a light group. Their sum is the colour.

    Raises KeyError for a name that no group can have, because it names a folder.
    """
    if not re.fullmatch(light_groups.NAME_PATTERN, group):
        raise KeyError(group)
    name = group_pass(group)
    return _light(name, f"light that comes from the light group {group}", name)


def _id(name: str, cycles: str) -> Pass:
    meaning = f"the {name}'s number in {NAMES}; 0 where nothing is hit"
    return Pass(name, "id", ("Y",), "uint32", meaning, (cycles,))


def _matte(*cycles: str) -> Pass:
    channels = tuple(f"{name}.{letter}" for name in cycles for letter in "RGBA")
    meaning = (
        "the six objects that cover most of the pixel, each its hash and its part, greatest first"
    )
    return Pass("cryptomatte", "matte", channels, "float32", meaning, cycles)


def _scattered(name: str) -> Pass:
    kind = name.capitalize()
    return _light(
        f"{name}_light",
        f"light that the first surface sends on by {name} scattering",
        f"{kind} Direct",
        f"{kind} Indirect",
        factor=f"{kind} Color",
    )


def _surface(name: str, meaning: str, is_colour: bool = False) -> Pass:
    return Pass(
        name,
        "light" if is_colour else "value",
        ("R", "G", "B") if is_colour else ("Y",),
        "float16",
        meaning,
        (f"{AOV_PREFIX}{name}",),
        unless=INEXACT,
    )


_ALL_PASSES = (
    Pass(
        "normal",
        "normal",
        ("R", "G", "B"),
        "float32",
        "unit shading normal (x, y, z) in world space, on the camera's side; 0 for a miss",
        ("Normal",),
    ),
    _id("object", "Object Index"),
    _id("material", "Material Index"),
    _id("instance", "Object Index"),
    _matte("CryptoObject00", "CryptoObject01", "CryptoObject02"),
    Pass(
        "motion",
        "motion",
        ("previous.X", "previous.Y", "next.X", "next.Y"),
        "float32",
        "where the surface is in the previous and in the next frame, in pixels from here, "
        "x to the right and y down",
        ("Vector",),
    ),
    Pass(
        VARIANCE,
        "variance",
        ("R", "G", "B"),
        "float32",
        "estimated variance of the colour, in squared linear light",
        (),
    ),
    _light("albedo", "diffuse reflectance; black on metal and glass", "Diffuse Color"),
    _scattered("diffuse"),
    _scattered("glossy"),
    _scattered("transmission"),
    _light("volume_light", "light scattered by volumes", "Volume Direct", "Volume Indirect"),
    _light("emission", "light that the surface itself emits", "Emission"),
    _light("environment", "light of the world, seen directly", "Environment"),
    _surface("base_colour", "base colour of surfaces of one Principled BSDF", is_colour=True),
    _surface("roughness", "roughness of surfaces of one Principled BSDF"),
    _surface("metallic", "how metallic surfaces of one Principled BSDF are"),
    _surface("transmission", "transmission weight of surfaces of one Principled BSDF"),
    _surface(
        "surface_emission",
        "emission colour times strength of surfaces of one Principled BSDF",
        is_colour=True,
    ),
    _surface(
        "surface_mask",
        "the part of the pixel whose surface is one opaque Principled BSDF; 0 beside any other "
        "surface",
    ),
)
PASSES = {view_pass.name: view_pass for view_pass in _ALL_PASSES}

# Flow is computed from depth and poses: see `lightfield.geometry.flow`. Its files have the names of
# two views, as in view_0000f_to_view_0001f.exr.
FLOW = Pass(
    "flow",
    "flow",
    ("X", "Y", "V"),
    "float32",
    "where the other view has what is here, in pixels from here, x to the right and y down, and "
    "whether it is visible there (1) or hidden or out of its frame (0)",
    (),
)

# The header of a matte, by the specification of Cryptomatte. A layer's key is the beginning of its
# name's hash. The manifest is a JSON of the objects' names and hashes.
_LAYER = "cryptomatte/3ae39a5/"
MANIFEST = f"{_LAYER}manifest"


def matte_header(manifest: Mapping[str, str]) -> dict[str, str | int | float]:
    """Return the attributes of a matte's EXR, which other programs need to read it."""
    return {
        f"{_LAYER}name": "CryptoObject",
        f"{_LAYER}hash": "MurmurHash3_32",
        f"{_LAYER}conversion": "uint32_to_float32",
        MANIFEST: json.dumps(manifest),
    }


# The passes whose sum is the view's colour.
PARTS_OF_LIGHT = (
    "diffuse_light",
    "glossy_light",
    "transmission_light",
    "volume_light",
    "emission",
    "environment",
)


def by_name(name: str) -> Pass:
    """Return the pass of this name. Raises KeyError if there is none, or if it is no text."""
    if not isinstance(name, str):
        raise KeyError(name)
    if name.startswith(GROUP_PREFIX):
        return of_group(name.removeprefix(GROUP_PREFIX))
    return PASSES[name]


def group_pass(group: str) -> str:
    """Return the name of the pass of a light group."""
    return f"{GROUP_PREFIX}{group}"


def is_group(view_pass: Pass) -> bool:
    """Return whether a pass holds the light of a light group."""
    return view_pass.name.startswith(GROUP_PREFIX)


def in_order(names: list[str], *others: str) -> list[str]:
    """Return ``names`` in the table's order. The names that are in ``others`` come last.

    Raises ValueError for wrong or repeated names.
    """
    allowed = [*PASSES, *others]
    if not {*names} <= {*allowed} or not names or len(set(names)) < len(names):
        raise ValueError(f"must be a list, each once, of {', '.join(allowed)}")
    return [name for name in allowed if name in names]
