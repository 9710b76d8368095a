"""Writes read.py, a file of a package that reads the dataset without Plenoforge."""

from collections.abc import Iterator, Mapping
from typing import Any

import jinja2

from lightfield.formats.layout import IMAGES
from lightfield.formats.lightfield import OMNIDIRECTIONAL, LightField
from lightfield.imaging import images
from lightfield.imaging.primaries import REC_709, are_rec_709, conversion
from lightfield.publishing.lens_source import LensSource
from lightfield.report import snippet
from lightfield.report.page import of_templates


def source(
    lightfields: Mapping[str, LightField], is_sequence: bool = False, shards: bool = False
) -> str:
    """Return the content of read.py.

    ``lightfields`` has the dataset's own by the name "", and each reprojection's by its name.
    With ``shards``, read.py reads the shards beside it, or else the folder that it lies in.
    """
    own = lightfields[""]
    arrays = snippet.arrays(own)
    lens_source = LensSource(each.lens for each in lightfields.values())
    lenses = {name: each.lens for name, each in lightfields.items()}
    depths = {name: each.depth for name, each in lightfields.items()}
    matrices = _matrices(lightfields)
    definitions = {
        "classes": lens_source.classes,
        "functions": lens_source.functions,
        "constants": lens_source.constants,
        "lenses": lens_source.text(lenses, "LENSES = "),
    }
    environment = of_templates(undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    return environment.get_template("read.py.j2").render(
        **definitions,
        arrays=arrays,
        bases=lens_source.bases,
        depths=lens_source.text(depths, "DEPTHS = "),
        has_centre=OMNIDIRECTIONAL not in own.content,
        has_windows=_has_windows(lightfields),
        is_sequence=is_sequence,
        matrices=lens_source.text(matrices, "TO_REC_709 = ") if matrices else None,
        needs_math="math." in repr(definitions),
        reprojections=len(lightfields) > 1,
        shards=shards,
    )


def _matrices(lightfields: Mapping[str, LightField]) -> dict[str, Any]:
    """Return the matrix (3, 3) to Rec. 709 of each light field in other primaries, by its name."""
    matrices = {}
    for name, lightfield in lightfields.items():
        header = next(_headers(name, lightfield), None)
        if header and header.chromaticities and not are_rec_709(header.chromaticities):
            matrices[name] = conversion(header.chromaticities, REC_709)
    return matrices


def _has_windows(lightfields: Mapping[str, LightField]) -> bool:
    """Return whether files store only a part of a view's pixels, or pixels beside them."""
    return any(
        not header.window.is_stored_whole
        for name, lightfield in lightfields.items()
        for header in _headers(name, lightfield)
    )


def _headers(name: str, lightfield: LightField) -> Iterator[images.Header]:
    """Yield the headers of the EXR files of a light field, by its name in the dataset."""
    folder = lightfield.folder if name else lightfield.folder / IMAGES
    for view in lightfield.views:
        path = folder / f"{view.name}.exr"
        if path.is_file():
            yield images.read_header(path)
