"""Writes the walk of a dataset's page as a file of its own, for a site or a package."""

import json
import re
from html import unescape
from pathlib import Path
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.files import read_text, write_text
from lightfield.report.page import environment
from lightfield.stages.report import ReportWalk

# What the page alone shows.
_ONLY_OF_PAGE = ("points", "row", "lights")
_DATA = re.compile(r'<script type="application/json" id="data">(.*?)</script>', re.DOTALL)
_TITLE = re.compile(r"<title>(.*?)</title>")


def write(job: ReportWalk) -> None:
    """Write the walk of a page. Raises `UserError` if the page has none."""
    content = of_page(job.page)
    if content is None:
        raise UserError(f"{job.page}: has no walk, because its views have no depth")
    write_text(job.output, content)


def of_page(path: Path) -> str | None:
    """Return the HTML with the walk of a dataset's page alone. None if it has no walk.

    Raises `UserError` if this is not a dataset's page.
    """
    page = read_text(path)
    found = _DATA.search(page)
    title = _TITLE.search(page)
    if not found or not title:
        raise UserError(f"{path}: is no page of a dataset, which scripts/report_html.py writes")
    data: dict[str, Any] = json.loads(found[1])
    if not data.get("walk"):
        return None
    for key in _ONLY_OF_PAGE:
        data.pop(key, None)
    for view in data["embedded"]:
        view.pop("sensor", None)
    return environment().get_template("walk.html.j2").render(data=data, title=unescape(title[1]))
