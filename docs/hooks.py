"""Show the formulas of Markdown pages as MathML, which needs no script and no other host."""

import re
from typing import Any

from latex2mathml.converter import convert

FORMULA = re.compile(r"^\$\$(.+?)\$\$$", re.M | re.S)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace each ``$$…$$``. MkDocs calls this with a page's text."""
    return FORMULA.sub(lambda found: convert(found[1], display="block"), markdown)
