"""Writes pages from templates. A page is one file, with styles, programs and pictures inside.

Scripts and shaders are files of their own in the templates, so that editors understand them. A
browser that opens a page from a disk loads no module beside it. So a page has its modules joined.
"""

import json
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from lightfield.core import units
from lightfield.core.files import read_bytes, write_text
from lightfield.core.units import number
from lightfield.imaging import images, pictures
from lightfield.report.packing import data_uri, webp

TEMPLATES = Path(__file__).resolve().parent / "templates"

# A plot stays sharp as SVG. A plot of thousands of points is smaller as PNG.
_LARGEST_SVG = 300_000
_PHOTO_QUALITY = 84
# import { a, b } from "./module.js";   import "./module.js";   import shader from "./name.glsl";
_IMPORT = re.compile(r'^import (?:(?P<names>[^;"]+) from )?"(?P<path>[^"]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=async|const|function)", re.MULTILINE)


def write(output: Path, template: str, **content: Any) -> None:
    """Fill in one of `TEMPLATES`, and write the page atomically. Escapes all of ``content``."""
    write_text(output, environment().get_template(template).render(**content))


def of_templates(**options: Any) -> jinja2.Environment:
    """Return an environment that fills in `TEMPLATES`, with Jinja's ``options``."""
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES), trim_blocks=True, lstrip_blocks=True, **options
    )


@cache
def environment() -> jinja2.Environment:
    """Return the environment that fills in `TEMPLATES`. Each process compiles a template once."""
    environment = of_templates(autoescape=True, undefined=jinja2.StrictUndefined)
    environment.filters |= {"number": number, "cell": cell, "measure": measure, "named": title}
    # These are the project's own files: they need no escaping.
    page_modules = script_modules(TEMPLATES / "page/main.js")
    walk_modules = script_modules(TEMPLATES / "walk/main.js")
    relight_modules = script_modules(TEMPLATES / "relight/main.js")
    # A page has the modules that they share only once.
    only_of_walk = [module for module in walk_modules if module not in page_modules]
    only_of_relight = [module for module in relight_modules if module not in page_modules]
    focus_modules = script_modules(TEMPLATES / "focus/main.js")
    only_of_focus = [module for module in focus_modules if module not in page_modules]
    environment.globals |= {
        "corpus_js": Markup(joined_script(script_modules(TEMPLATES / "corpus/main.js"))),
        "focus_js": Markup(joined_script(only_of_focus)),
        "index_js": Markup(joined_script(script_modules(TEMPLATES / "index/main.js"))),
        "page_css": Markup((TEMPLATES / "page.css").read_text("utf-8")),
        "page_js": Markup(joined_script(page_modules)),
        "walk_js": Markup(joined_script(only_of_walk)),
        "only_walk_js": Markup(joined_script(script_modules(TEMPLATES / "walk_alone/main.js"))),
        "relight_js": Markup(joined_script(only_of_relight)),
        "sequence_css": Markup((TEMPLATES / "sequence/page.css").read_text("utf-8")),
        "sequence_js": Markup(joined_script(script_modules(TEMPLATES / "sequence/main.js"))),
    }
    return environment


def script_modules(entry: Path) -> list[Path]:
    """Return ``entry`` and all modules that it imports. Each comes after its own imports."""
    ordered: list[Path] = []
    visited: set[Path] = set()

    def visit(module: Path) -> None:
        if module in visited:
            return
        visited.add(module)
        for statement in _IMPORT.finditer(module.read_text("utf-8")):
            imported = (module.parent / statement["path"]).resolve()
            if imported.suffix == ".js":
                visit(imported)
        ordered.append(module)

    visit(entry.resolve())
    return ordered


def joined_script(ordered: list[Path]) -> str:
    """Return one script that does what these modules do.

    The modules share one scope: a name must not have two meanings.
    """
    return '"use strict";\n' + "\n".join(_as_script(module) for module in ordered)


def _as_script(module: Path) -> str:
    def inlined(statement: re.Match[str]) -> str:
        imported = module.parent / statement["path"]
        if imported.suffix == ".js":
            return ""
        return f"const {statement['names']} = {json.dumps(imported.read_text('utf-8'))};\n"

    return _EXPORT.sub("", _IMPORT.sub(inlined, module.read_text("utf-8")))


def photo(path: Path, widest: int) -> str | None:
    """Return a picture as a data URI, at most ``widest`` pixels wide. None if it does not exist."""
    if not path.is_file():
        return None
    shown = images.read_image(path).srgb
    height, width = shown.shape[:2]
    if width > widest:
        shown = pictures.shrunk_8_bit(shown, widest, max(1, round(height * widest / width)))
    return webp(shown, _PHOTO_QUALITY)


def plot(stem: Path) -> str | None:
    """Return the plot ``stem``.svg or .png as a data URI. None if neither exists."""
    svg = stem.with_name(f"{stem.name}.svg")
    png = stem.with_name(f"{stem.name}.png")
    if svg.is_file() and (svg.stat().st_size <= _LARGEST_SVG or not png.is_file()):
        return data_uri(read_bytes(svg), "image/svg+xml")
    return data_uri(read_bytes(png), "image/png") if png.is_file() else None


def cell(value: Any) -> str:
    """Return a table's cell as text. Shortens numbers, joins lists, and shows None as a dash."""
    if value is None or value == "":
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return number(value)
    if isinstance(value, list | tuple):
        return ", ".join(cell(part) for part in value)
    if isinstance(value, dict):
        return ", ".join(
            f"{str(key).replace('_', ' ')} {cell(part)}" for key, part in value.items()
        )
    try:
        return number(float(value))
    except (TypeError, ValueError):
        return str(value)


_UNITS: dict[str, Callable[[float], str]] = {
    "seconds": units.duration,
    "bytes": units.size,
    "kwh": units.energy,
    "gigabytes": lambda value: units.size(1e9 * value),
    "hours": lambda value: f"{number(value)} h",
    "watts": lambda value: f"{value:g} W",
}


# How to write some words of keys.
_SPELLINGS = {
    "mse": "MSE",
    "psnr": "PSNR",
    "ssim": "SSIM",
    "flip": "FLIP",
    "cpu": "CPU",
    "kwh": "kWh",
}


def measure(value: Any, name: str) -> str:
    """Return the cell of a quantity called ``name``, in the unit at the end of the name."""
    with_unit = _UNITS.get(name.rpartition("_")[2])
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if with_unit and is_number and "_per_" not in name:
        return with_unit(value)
    return cell(value)


def title(name: str) -> str:
    """Return a key as a title, without the unit that `measure` writes beside the value."""
    parts = name.split("_")
    if len(parts) > 1 and parts[-1] in _UNITS and parts[-1] != "hours" and "per" not in parts:
        parts.pop()
    text = " ".join(_SPELLINGS.get(part, part) for part in parts)
    return {"bytes": "size", "gigabytes": "size", "watts": "power"}.get(name, text)
