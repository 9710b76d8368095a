"""Fills in the Markdown templates of packages and published datasets.

Texts of a scene YAML may hold Markdown. They begin no HTML element: a browser would run a script.
"""

import re
from functools import cache
from typing import Any

import jinja2
from markupsafe import Markup

from lightfield.report.page import of_templates

# An opening angle bracket, unless an address in angle brackets follows: a link in Markdown.
_OPENING = re.compile(r"""<(?!https?://[^\s"'<>]*>)""")


def markdown(template: str, **values: Any) -> str:
    """Return a template filled in. Values that the template calls safe stay as they are."""
    return _environment().get_template(template).render(**values)


@cache
def _environment() -> jinja2.Environment:
    return of_templates(finalize=_without_html)


def _without_html(value: Any) -> Any:
    is_text = isinstance(value, str) and not isinstance(value, Markup)
    return _OPENING.sub("&lt;", value) if is_text else value


def one_line(text: str) -> str:
    """Return a text in one line, for a heading or an entry of BibTeX."""
    return " ".join(text.split())
