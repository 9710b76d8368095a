"""The diffs in CONTRIBUTING.md apply one after the other, and the tests of the result pass."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text()
DIFFS = re.findall(r"^```diff\n(.*?)^```$", PAGE, re.M | re.S)
CODE = re.compile(r"^```.*?^```$", re.M | re.S)
# What belongs to a checkout, and not to the code.
LEFT_OUT = shutil.ignore_patterns(
    *(".git", ".venv*", ".snakemake", "__pycache__", ".*_cache", "work", "results", "build", "site")
)
TESTS = [
    ["tests/geometry/test_lenses.py", "-k", "thoby or registry"],
    ["tests/publishing/test_reader.py", "-k", "thoby or short"],
    ["tests/geometry/test_rigs.py"],
    ["tests/export/test_exports.py", "-k", "tum or decimals or exporter"],
    ["tests/configuration/test_mistakes.py", "-k", "arc or decimals or tum or perspective.camera"],
    ["tests/publishing/test_package.py", "-k", "load"],
    ["tests/core/test_start.py", "-k", "export or schema"],
    ["tests/project/test_docs.py"],
    ["tests/project/test_architecture.py"],
]


@pytest.fixture(scope="module")
def changed(tmp_path_factory):
    """Return a copy of the code to which all diffs were applied, with new generated files."""
    folder = tmp_path_factory.mktemp("contributing") / "plenoforge"
    shutil.copytree(ROOT, folder, ignore=LEFT_OUT)
    for diff in DIFFS:
        subprocess.run(["git", "apply", "-"], input=diff, text=True, cwd=folder, check=True)
    for program in ("scripts/schema.py", "docs/reference.py"):
        run(folder, program)
    return folder


def run(folder, *words):
    result = subprocess.run(
        [sys.executable, *words], cwd=folder, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def added_files():
    """Return the paths of the Python files that a diff adds or changes."""
    return sorted(set(re.findall(r"^\+\+\+ b/(.*\.py)$", "\n".join(DIFFS), re.M)))


def test_a_lens_a_rig_a_setting_and_an_exporter_have_an_example():
    assert len(DIFFS) == 4


def recipes():
    """Return the sections that say how to add something, by their titles."""
    sections = re.split(r"^## ", CODE.sub("", PAGE), flags=re.M)[1:]
    return {
        title: text
        for title, _, text in (section.partition("\n") for section in sections)
        if title.startswith(("A ", "An ", "Generated"))
    }


@pytest.mark.parametrize("title", recipes())
def test_a_recipe_names_the_test_that_holds_it(title):
    named = re.findall(r"\btests/[\w/]+\.py\b", recipes()[title])
    assert [path for path in named if Path(path).name.startswith("test_")]
    assert [path for path in named if not (ROOT / path).is_file()] == []


def test_there_are_recipes_and_the_commands_that_the_page_names():
    assert {"A lens", "A rig", "An exporter", "A stage", "A page of the documents"} <= {*recipes()}
    targets = re.findall(r"^([a-z-]+):(?!=)", (ROOT / "Makefile").read_text(), re.M)
    named = re.findall(r"`make ([a-z-]+)`", PAGE)
    assert {"check", "test"} <= {*named} <= {*targets}


def test_an_exporter_touches_its_file_its_tests_and_a_table():
    touched = re.findall(r"^\+\+\+ b/(.*)$", DIFFS[3], re.M)
    code = [path for path in touched if path.startswith(("scripts/", "rules/", "workflow/"))]
    assert code == ["scripts/lightfield/exporters/tum.py"]


@pytest.mark.slow
def test_the_examples_pass_the_checks_of_make_test(changed):
    run(changed, "-m", "ruff", "check", ".")
    run(changed, "-m", "ruff", "format", "--check", ".")
    library = [path for path in added_files() if path.startswith("scripts/lightfield/")]
    assert library
    run(changed, "-m", "mypy", "--num-workers", "0", *library)


@pytest.mark.slow
@pytest.mark.parametrize("tests", TESTS, ids=lambda words: Path(words[0]).stem)
def test_the_tests_pass_with_all_examples(tests, changed):
    assert " passed" in run(changed, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests)
