"""The page's programs: modules that a browser's editor follows, joined into one script of a page.

The templates hold ES modules, and shaders in files of their own. A page is one file, and a browser
that opens it from a disk loads no module beside it. So `joined` puts modules one after the other.
"""

import json
import re
from pathlib import Path

# import { a, b } from "./module.js";   import shader from "./shaders/name.glsl";
_IMPORT = re.compile(r'^import (?P<names>[^;]+) from "(?P<path>[^"]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=async|const|function)", re.MULTILINE)


def modules(entry: Path) -> list[Path]:
    """Return ``entry`` and all modules that it imports, each after those that it imports itself."""
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

    They share one scope: two modules must not give the same name to different things.
    """
    return '"use strict";\n' + "\n".join(_as_script(module) for module in ordered)


def _as_script(module: Path) -> str:
    def inlined(statement: re.Match[str]) -> str:
        imported = module.parent / statement["path"]
        if imported.suffix == ".js":
            return ""
        return f"const {statement['names']} = {json.dumps(imported.read_text('utf-8'))};\n"

    return _EXPORT.sub("", _IMPORT.sub(inlined, module.read_text("utf-8")))
