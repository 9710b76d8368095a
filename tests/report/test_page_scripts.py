"""A page's modules become one script: each name means one thing, and each import is an export."""

import re
from collections import Counter
from pathlib import Path

import pytest

from lightfield.report import page

MODULES = sorted(page.TEMPLATES.glob("*/*.js"))
# The scripts of a dataset's page share a scope. Other pages have one of their own.
OF_DATASET = ("page", "walk", "relight", "focus", "walk_alone")
OTHERS = ("index", "corpus", "sequence")
DECLARED = re.compile(r"^(export )?(?:async function|function|const|let) (\w+)", re.MULTILINE)
IMPORTED = re.compile(r'^import {(.+)} from "(.+)";', re.MULTILINE)


def test_modules_share_a_scope_without_giving_a_name_twice():
    names = Counter(
        name
        for module in MODULES
        if module.parent.name in OF_DATASET
        for _, name in DECLARED.findall(module.read_text("utf-8"))
    )
    assert [name for name, count in names.items() if count > 1] == []


@pytest.mark.parametrize(
    "module", MODULES, ids=lambda module: f"{module.parent.name}/{module.name}"
)
def test_every_imported_name_is_exported(module):
    for names, path in IMPORTED.findall(module.read_text("utf-8")):
        imported = (module.parent / path).read_text("utf-8")
        exported = {name for export, name in DECLARED.findall(imported) if export}
        assert {name.strip() for name in names.split(",")} <= exported


def test_every_module_is_in_the_page():
    entries = [page.TEMPLATES / f"{name}/main.js" for name in OF_DATASET + OTHERS]
    assert {module for entry in entries for module in page.script_modules(entry)} == set(MODULES)


def test_a_module_follows_what_it_imports_and_holds_its_shaders(tmp_path: Path):
    (tmp_path / "main.js").write_text('import { one } from "./one.js";\nsay(one, text);\n')
    (tmp_path / "one.js").write_text('import text from "./a.glsl";\nexport const one = 1;\n')
    (tmp_path / "a.glsl").write_text('say "this";\n')
    script = page.joined_script(page.script_modules(tmp_path / "main.js"))
    assert script.splitlines()[1:3] == [r'const text = "say \"this\";\n";', "const one = 1;"]
    assert "say(one, text);" in script.splitlines()[-1]
    assert "import" not in script


def test_a_module_may_import_another_one_only_to_run_it(tmp_path: Path):
    (tmp_path / "main.js").write_text('import "./one.js";\nsay(2);\n')
    (tmp_path / "one.js").write_text("say(1);\n")
    script = page.joined_script(page.script_modules(tmp_path / "main.js"))
    assert script.splitlines()[1:] == ["say(1);", "", "say(2);"]
