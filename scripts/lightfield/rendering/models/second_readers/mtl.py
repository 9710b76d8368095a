"""Reads the libraries of materials of an OBJ a second time."""

import math
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from lightfield.rendering.models import obj_files
from lightfield.rendering.models.model_references import printable
from lightfield.rendering.models.second_readers.facts import MaterialFacts

# The part of a material that a texture gives, by its keyword.
_ROLES = {
    b"map_kd": "base colour",
    b"map_d": "opacity",
    b"map_ke": "emission",
    b"map_pr": "roughness",
    b"map_pm": "metallic",
    b"map_ns": "roughness",
    b"map_refl": "metallic",
    b"map_bump": "normal",
    b"bump": "normal",
    b"norm": "normal",
}
# What Blender leaves out of a material.
_UNUSED = {
    b"map_ka": "the ambient colour's texture (map_Ka)",
    b"map_tr": "a texture of transparency (map_Tr)",
    b"disp": "displacement (disp)",
    b"map_disp": "displacement (map_disp)",
    b"decal": "decals (decal)",
    b"map_aat": "anti-aliasing of textures (map_aat)",
    b"map_pc": "a clear coat by a texture (map_Pc)",
    b"map_pcr": "a clear coat by a texture (map_Pcr)",
    b"map_aniso": "anisotropy by a texture (map_aniso)",
    b"refl": "a picture that is mirrored (refl), which becomes a texture of metal",
    b"sharpness": "sharpness of reflections (sharpness)",
}


# Options of textures that Blender skips, and the words that change nothing.
_IGNORED_OPTIONS = {
    b"-mm": [b"0", b"1"],
    b"-clamp": [b"off"],
    b"-cc": [b"off"],
    b"-imfchan": [b"l"],
}


@dataclass
class _Material:
    """The words after each keyword of a material, and its textures by keyword, in small letters."""

    words: dict[bytes, list[bytes]] = field(default_factory=dict)
    textures: dict[bytes, obj_files.Texture] = field(default_factory=dict)

    def opacity(self) -> float | None:
        """Return the alpha of a material without a picture of it. `Tr` is its opposite."""
        if b"map_d" in self.textures:
            return None
        if b"d" in self.words:
            return _number(self.words[b"d"])
        transparency = _number(self.words.get(b"tr", [b"0"]))
        return None if transparency is None else 1 - transparency

    def filters_colours(self) -> bool:
        """Return whether light of other colours passes through it. Otherwise `Tf` is left out."""
        is_glass = self.words.get(b"illum") in obj_files.TRANSMITTING
        return is_glass and len(set(self.words.get(b"tf", []))) > 1

    def colour(self) -> tuple[float, float, float] | None:
        """Return the base colour of a material without a picture of it. One number is grey."""
        words = self.words.get(b"kd", [])
        if b"map_kd" in self.textures or not words:
            return None
        numbers = [_number([word]) for word in (words * 3 if len(words) == 1 else words)[:3]]
        match numbers:
            case [float(red), float(green), float(blue)]:
                return red, green, blue
            case _:
                return None


def _number(words: list[bytes]) -> float | None:
    """Return the one number of a line. None if it is something else."""
    try:
        (number,) = map(float, words)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


class Materials:
    """The materials of libraries by name. A later line of a material counts, as in Blender."""

    def __init__(self, libraries: Iterable[Path]) -> None:
        self._materials: dict[bytes, _Material] = {}
        for library in libraries:
            self._read(library)

    def _read(self, library: Path) -> None:
        material = _Material()
        for line in obj_files.read_lines(library):
            keyword, *words = line.split() or [b""]
            if keyword == b"newmtl":
                name = line.strip()[len(keyword) :].strip()
                material = self._materials.setdefault(name, _Material())
            elif texture := obj_files.texture_of(library, line):
                material.textures[texture.keyword.lower()] = texture
            else:
                material.words[keyword.lower()] = words

    def __contains__(self, name: bytes) -> bool:
        return name in self._materials

    def facts(self, name: bytes) -> MaterialFacts:
        """Return what the libraries say of a material."""
        material = self._materials[name]
        textures = {
            _ROLES[keyword]: texture.file.name
            for keyword, texture in material.textures.items()
            if keyword in _ROLES
        }
        return MaterialFacts(os.fsdecode(name), material.colour(), material.opacity(), textures)

    def lost(self, name: bytes) -> Iterator[str]:
        """Yield values of a material that Blender cannot show, so that views would be wrong."""
        material = self._materials[name]
        by_picture = material.textures
        if b"kd" in material.words and b"map_kd" not in by_picture and material.colour() is None:
            yield f"the colour {_text(b'Kd', *material.words[b'kd'])} of the material {_text(name)}"
        if b"map_d" not in by_picture and material.opacity() is None:
            words = [b"d", *material.words.get(b"d", material.words.get(b"tr", []))]
            yield f"the opacity {_text(*words)} of the material {_text(name)}"

    def unused(self, name: bytes) -> Iterator[str]:
        """Yield features of a material that no view shows."""
        material = self._materials[name]
        for keyword, title in _UNUSED.items():
            if keyword in material.words or keyword in material.textures:
                yield f"{title} of the material {_text(name)}"
        if material.filters_colours():
            yield f"the colours of the filter of light (Tf) of the material {_text(name)}"
        for texture in material.textures.values():
            for option, *words in texture.options:
                if _IGNORED_OPTIONS.get(option, words) != words:
                    file = _text(os.fsencode(texture.file.name))
                    yield f"the option {_text(option, *words)} of the texture {file}"


def _text(*words: bytes) -> str:
    return printable(os.fsdecode(b" ".join(words)))
