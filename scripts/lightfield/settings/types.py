"""Types that the values of several settings have: folders, numbers and lists of names."""

import re
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from lightfield.settings.base import pattern


def _plain_path(folder: str) -> str:
    """Return a path without ``./`` and without a slash at its end: Snakemake compares texts.

    A path such as ``./-x`` keeps them, because programs would take ``-x`` for a flag.
    """
    path = str(Path(folder))
    return path if re.match(r"[\w./]", path) else folder


# The rules write this path into commands with {wildcards}.
Folder = Annotated[
    str,
    Field(
        pattern=pattern(
            r"^[\w./][\w./+=@-]*$", "a path of letters, digits and . _ / + = @ - without blanks"
        ),
        max_length=1000,
    ),
    AfterValidator(_plain_path),
]
# The characters of a path that the rules quote in commands.
QUOTED = r"[^{}*?\[\]\x00-\x1f\x7f]{1,1000}"
# An exposure, in stops.
Stops = Annotated[float, Field(ge=-100, le=100)]
# The value of light that Reinhard tone mapping makes white.
White = Annotated[float, Field(ge=1e-9, le=1e9)]
REINHARD = (
    "value of light that becomes white. If it is above 1, Reinhard tone mapping compresses light "
    "up to it. If it is 1, light stays as it is, and values above 1 are clipped."
)
AtLeastOne = Annotated[int, Field(ge=1, le=2**31 - 1)]
Auto = Literal["auto"]
DenoisePrefilter = Literal["accurate", "fast", "none"]
Primaries = Literal["rec709", "acescg"]
# How EXR files are compressed. All of these keep every bit.
Compression = Literal["zip", "zips", "piz", "htj2k", "zstd"]


def unique_names(names: list[str]) -> list[str]:
    if not names or len(set(names)) < len(names):
        raise ValueError("must be a list of one or more names, each once")
    return names
