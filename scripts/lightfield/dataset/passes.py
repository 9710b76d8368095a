"""The passes that a view can have beside its colour and depth, each in an EXR of its own.

They lie in a folder of the pass's name beside lightfield.json: normal/view_0000f.exr. This table
is the only one: settings, rendering, validation and reprojection follow it.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

# Beside the images of ids: a JSON of names and the id of each.
NAMES = "names.json"


@dataclass(frozen=True)
class Pass:
    """One pass.

    ``kind`` is how it is resampled: "light" as colour is, a "normal" too, but it is made a unit
    vector again, an "id" and a "matte" are those of the source pixel that the ray falls in, and
    "motion" and "flow", which count in pixels of their own lens, are not resampled at all.
    ``cycles`` are the passes of Cycles that it is the sum of, times Cycles' pass ``factor`` if it
    has one; a matte is made of them side by side. Those of colour are means over all samples, the
    others are of the surface at the pixel's centre, as depth is.
    """

    name: str
    kind: Literal["light", "matte", "normal", "id", "motion", "flow"]
    channels: tuple[str, ...]
    dtype: str
    meaning: str
    cycles: tuple[str, ...]
    factor: str | None = None

    @property
    def of_colour(self) -> bool:
        """Whether it comes from the samples of the colour, and not from the geometry."""
        return self.kind in ("light", "matte")

    @property
    def needed(self) -> tuple[str, ...]:
        """All of Cycles' passes that it follows from."""
        return (*self.cycles, self.factor) if self.factor else self.cycles

    @property
    def bytes(self) -> int:
        """Of a pixel, uncompressed."""
        return len(self.channels) * (2 if self.dtype == "float16" else 4)

    def path(self, folder: Path, view: str) -> Path:
        """Return a view's file of this pass; ``folder`` is that of lightfield.json."""
        return folder / self.name / f"{view}.exr"


def _light(name: str, meaning: str, *cycles: str, factor: str | None = None) -> Pass:
    return Pass(name, "light", ("R", "G", "B"), "float16", meaning, cycles, factor)


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


PASSES = {
    found.name: found
    for found in (
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
        _light("albedo", "diffuse reflectance; black on metal and glass", "Diffuse Color"),
        _scattered("diffuse"),
        _scattered("glossy"),
        _scattered("transmission"),
        _light("volume_light", "light scattered by volumes", "Volume Direct", "Volume Indirect"),
        _light("emission", "light that the surface itself emits", "Emission"),
        _light("environment", "light of the world, seen directly", "Environment"),
    )
}

# Not rendered but made of depth and poses: see `lightfield.geometry.flow`. Its files have the names
# of two views, as in view_0000f_to_view_0001f.exr.
FLOW = Pass(
    "flow",
    "flow",
    ("X", "Y", "V"),
    "float32",
    "where the other view has what is here, in pixels from here, x to the right and y down, and "
    "whether it is visible there (1) or hidden or out of its frame (0)",
    (),
)

# In the header of a matte, by the specification of Cryptomatte: a layer's key is the beginning of
# the hash of its name, and the manifest a JSON of the objects' names and hashes.
_LAYER = "cryptomatte/3ae39a5/"
MANIFEST = f"{_LAYER}manifest"


def matte_header(manifest: Mapping[str, str]) -> dict[str, str | int | float]:
    """Return the attributes of a matte's EXR, by which other programs read it."""
    return {
        f"{_LAYER}name": "CryptoObject",
        f"{_LAYER}hash": "MurmurHash3_32",
        f"{_LAYER}conversion": "uint32_to_float32",
        MANIFEST: json.dumps(manifest),
    }


# Their sum is the view's colour.
PARTS_OF_LIGHT = (
    *("diffuse_light", "glossy_light", "transmission_light"),
    *("volume_light", "emission", "environment"),
)


def wanted(settings: Mapping[str, Any]) -> list[Pass]:
    """Return the passes that ``settings``, with a key ``passes`` or without, ask for."""
    return [PASSES[name] for name in settings.get("passes", ())]


def without(render: Mapping[str, Any]) -> dict[str, Any]:
    """Return a ``render`` block that asks for no passes."""
    return {key: value for key, value in render.items() if key != "passes"}


def in_order(names: list[str]) -> list[str]:
    """Return names of passes in the table's order; a ValueError for a wrong or repeated one."""
    unknown = [name for name in names if name not in PASSES]
    if unknown or not names or len(set(names)) < len(names):
        raise ValueError(f"must be a list, each once, of {', '.join(PASSES)}")
    return [name for name in PASSES if name in names]
