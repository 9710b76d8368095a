"""Finds the libraries of materials of an OBJ, and what Blender misreads in the OBJ and in them.

Blender takes all that follows mtllib for one name. If it does not know an option of a texture, it
takes the option for the beginning of the name. So it gets a copy, in which each line has one name.
"""

import os
import re
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from lightfield.core.files import special_kind
from lightfield.rendering.models.model_references import (
    FileReference,
    Survey,
    printable,
    refuse_special,
)
from lightfield.rendering.models.second_readers.text_lines import lines_with

_TEXTURE = re.compile(rb"\s*(map_\w+|bump|disp|decal|refl|norm)\s+(.*?)\s*$", re.IGNORECASE)
# Blender does not know the keyword of normals, and takes a texture of bumps for one.
_NORMALS, _BUMP = b"norm", b"map_Bump"
# The models of illumination in which light passes through surfaces.
TRANSMITTING = ([b"4"], [b"6"], [b"7"], [b"9"])
# The options of a texture, and the most words that follow each.
_OPTIONS = {
    **dict.fromkeys((b"-blendu", b"-blendv", b"-boost", b"-bm", b"-cc", b"-clamp"), 1),
    **dict.fromkeys((b"-colorspace", b"-imfchan", b"-texres", b"-type"), 1),
    **{b"-mm": 2, b"-o": 3, b"-s": 3, b"-t": 3},
}
# Blender skips as many words as these can have, but there may be fewer.
_SKIPPED = (b"-mm", b"-t")
_NUMBER = re.compile(rb"[-+\d.eE]+")
_COLOUR_SPACE = b"-colorspace"
# Blender takes these textures for sRGB, unless the file holds linear light.
_COLOURS = (b"map_ka", b"map_kd", b"map_ke", b"map_ks")
_LINEAR_FILES = (".exr", ".hdr")


class Texture(NamedTuple):
    """A line of a library that names a texture: its keyword, options with their words, and file."""

    keyword: bytes
    options: list[list[bytes]]
    file: Path
    is_escaped: bool

    @property
    def is_misread(self) -> bool:
        return self.is_escaped or not all(map(_is_read, self.options))


def survey(path: Path) -> Survey:
    """Return the libraries of an OBJ, and the colour spaces of textures that Blender leaves out.

    Raises `UserError` if a texture is a FIFO or a device.
    """
    references = [
        FileReference(path, os.fsdecode(name), _in_folder(path, name))
        for name in _libraries(path, _mentions(path))
    ]
    libraries = [reference.path for reference in references if _is_file(reference.path)]
    for library in libraries:
        files = [texture.file for texture in _textures(library)]
        refuse_special(path, [FileReference(library, os.path.relpath(f), f) for f in files])
    return Survey(references, [each for library in libraries for each in _colour_spaces(library)])


def own_library(path: Path) -> Path:
    """Return the library with the name of an OBJ, which Blender also reads if it exists."""
    return path.with_suffix(".mtl")


@contextmanager
def readable(path: Path) -> Iterator[Path]:
    """Yield an OBJ that Blender reads right: the file itself, or a copy if Blender misreads it."""
    mentions = _mentions(path)
    libraries = _library_files(path, mentions)
    misread = [
        file
        for file in libraries
        if any(each.is_misread for each in _textures(file)) or _is_corrected(file)
    ]
    if not misread and all(_names(path, text) == [text] for text in mentions):
        yield path
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(os.path.realpath(name))
        copies = {file: folder / f"{number}.mtl" for number, file in enumerate(misread)}
        for file, copy in copies.items():
            _copy_library(file, copy)
        _copy_obj(path, folder / path.name, [copies.get(file, file) for file in libraries])
        yield folder / path.name


def _copy_obj(path: Path, copy: Path, libraries: list[Path]) -> None:
    """Copy an OBJ, with a line for each of its ``libraries`` in place of its own lines."""
    with copy.open("wb") as file:
        file.writelines(b"mtllib %s\n" % _relative(each, copy) for each in libraries)
        file.writelines(line for line in read_lines(path) if not _mentioned(line))


def _copy_library(path: Path, copy: Path) -> None:
    """Copy a library so that Blender reads it right.

    It lacks the options that Blender misreads, and filters of light that passes through no surface.
    `Tr` is `d`, and a texture of normals has Blender's keyword. The textures stay in their place.
    In the copy, their names begin at the copy's folder.
    """
    materials = _values(path)
    name = b""
    with copy.open("wb") as file:
        for line in read_lines(path):
            name = _material_name(line) or name
            values = materials.get(name, {})
            if texture := texture_of(path, line):
                options = [b" ".join(words) for words in texture.options if _is_read(words)]
                keyword = _BUMP if texture.keyword.lower() == _NORMALS else texture.keyword
                line = b" ".join([keyword, *options, _relative(texture.file, copy)]) + b"\n"
            elif _is_opposite(line, values):
                line = b"d %r\n" % (1 - float(values[b"tr"][0]))
            elif _filters_nothing(line, values):
                line = b""
            file.write(line)


def corrects_materials(path: Path) -> bool:
    """Return whether the OBJ that Blender gets has other values of materials, or normals."""
    return any(map(_is_corrected, libraries(path)))


def _is_corrected(library: Path) -> bool:
    return any(texture.keyword.lower() == _NORMALS for texture in _textures(library)) or any(
        _is_opposite(b"Tr", values) or _filters_nothing(b"Tf", values)
        for values in _values(library).values()
    )


def _values(path: Path) -> dict[bytes, dict[bytes, list[bytes]]]:
    """Return the words after each keyword of each material of a library, in small letters."""
    values: dict[bytes, dict[bytes, list[bytes]]] = {}
    name = b""
    for line in read_lines(path):
        name = _material_name(line) or name
        keyword, *words = line.split() or [b""]
        values.setdefault(name, {})[keyword.lower()] = words
    return values


def _is_opposite(line: bytes, values: dict[bytes, list[bytes]]) -> bool:
    """Return whether a line has the only opacity of a material, by its opposite, `Tr`."""
    words = values.get(b"tr", [])
    is_number = len(words) == 1 and _NUMBER.fullmatch(words[0])
    return bool(line.lower().split()[:1] == [b"tr"] and is_number and b"d" not in values)


def _filters_nothing(line: bytes, values: dict[bytes, list[bytes]]) -> bool:
    """Return whether a line filters light that passes through a surface through which none does.

    Of such a line, Blender makes glass.
    """
    is_filter = line.lower().split()[:1] == [b"tf"] and b"tf" in values
    return is_filter and values.get(b"illum", [b"2"]) not in TRANSMITTING


def _material_name(line: bytes) -> bytes:
    """Return the name of the material that a line of a library begins, or b""."""
    words = line.split(None, 1)
    return words[1].strip() if words[:1] == [b"newmtl"] and len(words) == 2 else b""


def _relative(path: Path, named_by: Path) -> bytes:
    return os.fsencode(os.path.relpath(path, named_by.parent))


def libraries(path: Path) -> list[Path]:
    """Return the libraries of an OBJ that exist."""
    return _library_files(path, _mentions(path))


def _library_files(path: Path, mentions: Iterable[bytes]) -> list[Path]:
    """Return the libraries of an OBJ that exist."""
    places = dict.fromkeys(_in_folder(path, name) for name in _libraries(path, mentions))
    return list(filter(_is_file, places))


def _libraries(path: Path, mentions: Iterable[bytes]) -> list[bytes]:
    """Return the names of an OBJ's libraries. The library with its own name is one if it exists."""
    names = [name for text in mentions for name in _names(path, text)]
    if own_library(path).is_file():
        names.append(os.fsencode(own_library(path).name))
    return list(dict.fromkeys(names))


def _mentions(path: Path) -> list[bytes]:
    """Return what follows mtllib in the lines of an OBJ."""
    return [text for text in map(_mentioned, lines_with(path, b"mtllib")) if text]


def _mentioned(line: bytes) -> bytes | None:
    """Return what follows mtllib in a line, as Blender reads it. None if there is no such word."""
    words = line.split(None, 1)
    if words[:1] != [b"mtllib"]:
        return None
    text = words[-1].strip()
    return text[1:-1] if len(text) > 2 and text[:1] == text[-1:] == b'"' else text


def _names(path: Path, text: bytes) -> list[bytes]:
    """Return the names in the text after mtllib. A name may have blanks, with or without escape."""
    if _is_file(_in_folder(path, text)):
        return [text]
    return [_unescaped(name) for name in re.split(rb"(?i)(?<=\.mtl)\s+", text)]


def _unescaped(name: bytes) -> bytes:
    return name.replace(b"\\ ", b" ")


def _in_folder(path: Path, name: bytes) -> Path:
    """Return the path of a name in a file. Blender puts the folder before absolute paths, too."""
    return Path(os.path.normpath(f"{path.parent}/{os.fsdecode(name)}"))


def _is_file(path: Path) -> bool:
    # Path.is_file() raises for a path that is too long.
    return os.path.isfile(path)  # noqa: PTH113


def _textures(path: Path) -> Iterator[Texture]:
    """Yield the textures that a library names."""
    yield from filter(None, (texture_of(path, line) for line in read_lines(path)))


def texture_of(path: Path, line: bytes) -> Texture | None:
    """Return the texture that a line of a library names. None if it names none."""
    match = _TEXTURE.match(line)
    if not match:
        return None
    keyword, rest = match.groups()
    options = []
    while (found := rest.split(None, 1)[:1]) and found[0] in _OPTIONS:
        words, rest = _option(rest)
        options.append(words)
    file, is_escaped = _texture_file(path, rest)
    return Texture(keyword, options, file, is_escaped)


def _option(text: bytes) -> tuple[list[bytes], bytes]:
    """Return the option with which a text begins, with its words, and the rest of the text."""
    option, *rest = text.split(None, 1)
    words = [option]
    while rest and len(words) <= _OPTIONS[option]:
        word, *after = rest[0].split(None, 1)
        if _OPTIONS[option] > 1 and not _NUMBER.fullmatch(word):
            break
        words.append(word)
        rest = after
    return words, b"".join(rest)


def _texture_file(path: Path, name: bytes) -> tuple[Path, bool]:
    """Return a texture's file, where Blender looks for it, and whether its name is escaped."""
    plain, unescaped = _in_folder(path, name), _in_folder(path, _unescaped(name))
    if unescaped != plain and _is_file(unescaped):
        return unescaped, True
    absolute, beside = Path(os.fsdecode(name)), path.parent / Path(os.fsdecode(name)).name
    places = [plain, *([absolute] if absolute.is_absolute() else []), beside]
    # Blender opens a FIFO or a device, too.
    return next((each for each in places if _is_file(each) or special_kind(each)), plain), False


def _is_read(words: list[bytes]) -> bool:
    """Return whether Blender reads or skips an option with its words."""
    return words[0] != _COLOUR_SPACE and (
        words[0] not in _SKIPPED or len(words) == 1 + _OPTIONS[words[0]]
    )


def _colour_spaces(path: Path) -> Iterator[str]:
    """Yield the colour spaces in a library that differ from what Blender takes textures for."""
    for texture in _textures(path):
        name = printable(texture.file.name)
        taken = b"linear" if texture.file.suffix.lower() in _LINEAR_FILES else b"srgb"
        for option, *words in texture.options if texture.keyword.lower() in _COLOURS else ():
            if option == _COLOUR_SPACE and words and words[0].lower() != taken:
                yield f"the colour space {printable(os.fsdecode(words[0]))} of {name}"


def read_lines(path: Path) -> Iterator[bytes]:
    """Yield the lines of an OBJ or a library. A backslash at the end of a line continues it."""
    begun = b""
    with path.open("rb") as file:
        for line in file:
            if line.endswith((b"\\\n", b"\\\r\n")):
                begun += line.rstrip()[:-1] + b" "
            else:
                yield begun + line
                begun = b""
    yield begun
