"""Writes read.py, a file of a package that reads the dataset without Plenoforge."""

from collections.abc import Mapping
from typing import Any

import jinja2

from lightfield.formats.layout import IMAGES
from lightfield.formats.lightfield import OMNIDIRECTIONAL, LightField
from lightfield.imaging import images
from lightfield.imaging.primaries import REC_709, are_rec_709, conversion
from lightfield.report import snippet
from lightfield.report.lens_source import LensSource
from lightfield.report.page import TEMPLATES


def source(
    lightfields: Mapping[str, LightField], is_sequence: bool = False, shards: bool = False
) -> str:
    """Return the content of read.py.

    ``lightfields`` has the dataset's own by the name "", and that of each reprojection by its name.
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
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template("read.py.j2").render(
        **definitions,
        arrays=arrays,
        bases=lens_source.bases,
        depths=lens_source.text(depths, "DEPTHS = "),
        has_centre=OMNIDIRECTIONAL not in own.content,
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
        folder = lightfield.folder if name else lightfield.folder / IMAGES
        path = folder / f"{lightfield.views[0].name}.exr"
        chromaticities = images.read_header(path).chromaticities if path.is_file() else None
        if chromaticities and not are_rec_709(chromaticities):
            matrices[name] = conversion(chromaticities, REC_709)
    return matrices
