"""Joins the ES modules of the templates into one script of a page.

The modules and shaders are files of their own, so that editors understand them. A page is one file:
a browser that opens it from a disk loads no module beside it. So `joined` concatenates the modules.
"""

import json
import re
from pathlib import Path

# import { a, b } from "./module.js";   import shader from "./shaders/name.glsl";
_IMPORT = re.compile(r'^import (?P<names>[^;]+) from "(?P<path>[^"]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=async|const|function)", re.MULTILINE)


def modules(entry: Path) -> list[Path]:
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


def joined(ordered: list[Path]) -> str:
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
