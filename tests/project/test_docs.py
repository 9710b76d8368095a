"""The documents: working links, pages of readable length, and a true reference."""

import inspect
import os
import re
import subprocess
import sys
import typing
from pathlib import Path

import pytest
import yaml

import lightfield
from lightfield.configuration import reprojections
from lightfield.configuration.keys import VERSIONS as VIEW_VERSIONS
from lightfield.configuration.scene_checks import rigs
from lightfield.configuration.scene_yaml import Scene
from lightfield.geometry import frames
from lightfield.geometry.rigs.poses import LARGEST_FILE
from lightfield.imaging.images import HALF_MAX, Image
from lightfield.reading.dataset import OpenDataset, OpenView
from lightfield.reading.files import Files
from lightfield.reading.surface import SeenSurface
from lightfield.settings.base import checked
from lightfield.stages.registry import VERSIONS as STAGE_VERSIONS

# isort: split
from pydantic import TypeAdapter

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted([*ROOT.glob("*.md"), *DOCS.rglob("*.md")])
KINDS = ("tutorials", "how-to", "reference", "explanation")
# Of a page of prose. Tables that are written from the code are as long as they must be.
MOST_LINES = 149
GENERATED = "<!-- Written by docs/reference.py."

CODE_BLOCK = re.compile(r"^(```+).*?^\1$", re.M | re.S)
CODE = re.compile(r"`[^`]*`")
LINK = re.compile(r"\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ (.*)$", re.M)
# Names of pages in code, messages and comments.
NAMED_PAGE = re.compile(r"\bdocs/[\w/.-]+\.md\b")


def name_of(page):
    return str(page.relative_to(ROOT))


def text_of(page):
    """Return a page without its blocks of code."""
    return CODE_BLOCK.sub("", page.read_text())


def anchors(page):
    """Return the anchors of a page's headings, as GitHub makes them."""
    names = [
        re.sub(r"[^\w\- ]", "", re.sub(r"\]\([^)]*\)", "", heading).lower()).replace(" ", "-")
        for heading in HEADING.findall(text_of(page))
    ]
    assert len(names) == len(set(names)), page
    return set(names)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_link_leads_to_a_file_and_a_heading(page):
    for link in LINK.findall(CODE.sub("", text_of(page))):
        if re.match(r"https?://", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        # The site holds only these pages.
        assert target.is_relative_to(DOCS) or not page.is_relative_to(DOCS), link
        assert not anchor or anchor in anchors(target), link


@pytest.mark.parametrize("page", [page for page in PAGES if page.is_relative_to(DOCS)], ids=name_of)
def test_a_page_is_short_and_begins_with_a_paragraph(page):
    text = page.read_text()
    if GENERATED not in text:
        assert text.count("\n") <= MOST_LINES
    assert text.startswith("# ")
    rest = re.sub(r"<!--.*?-->", "", text.partition("\n")[2]).strip()
    first_paragraph = rest.partition("\n\n")[0]
    assert not first_paragraph.startswith(("#", "|", "```", "-", "!", "1."))
    assert len(first_paragraph.split()) > 5


def test_every_page_is_of_one_kind_and_can_be_reached():
    pages = {page.relative_to(DOCS) for page in DOCS.rglob("*.md")} - {Path("index.md")}
    assert {page.parts[0] for page in pages} == set(KINDS)
    listed = {Path(link.partition("#")[0]) for link in LINK.findall(text_of(DOCS / "index.md"))}
    assert pages <= listed
    navigation = re.findall(r"- ([\w/-]+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.M)
    assert pages == {Path(page) for page in navigation}


def test_code_comments_and_messages_name_pages_that_exist():
    listing = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    files = [ROOT / name for name in listing.stdout.splitlines()] or [*ROOT.rglob("*.py")]
    texts = [f for f in files if f.suffix in (".py", ".smk", ".yaml", ".def", ".toml", ".j2", "")]
    for file in texts:
        if file.is_file() and ".venv" not in file.parts:
            for named in NAMED_PAGE.findall(file.read_text(errors="ignore")):
                assert (ROOT / named).is_file(), f"{file}: {named}"


def complete_scenes():
    """Return the examples of whole scene YAMLs, with the first Python code on their pages."""
    examples = []
    for page in PAGES:
        builder = re.search(r"^```python\n(.*?)^```$", page.read_text(), re.M | re.S)
        for code in re.findall(r"^```yaml\n(.*?)^```$", page.read_text(), re.M | re.S):
            content = yaml.safe_load(code.replace("…", "x"))
            if {"scene", "render", "rigs"} <= content.keys():
                example = pytest.param(content, builder and builder[1], id=name_of(page))
                examples.append(example)
    return examples


def test_the_schemas_that_examples_name_exist():
    """An example is in configs/scenes/, unless a comment above it says which file it is."""
    found = 0
    for page in PAGES:
        for file, code in re.findall(
            r"^(?:<!-- file: (.*?) -->\n)?^```yaml\n(.*?)^```$", page.read_text(), re.M | re.S
        ):
            if schema := re.match(r"# yaml-language-server: \$schema=(\S+)\n", code):
                folder = (ROOT / (file or "configs/scenes/mine.yaml")).parent
                # The folder of a tutorial does not exist here.
                path = Path(os.path.normpath(folder / schema[1]))
                assert path.is_file(), page
                found += 1
    assert found > 3


@pytest.mark.parametrize(("content", "builder"), complete_scenes())
def test_an_example_of_a_scene_yaml_is_valid(content, builder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if content["scene"].get("builder", "").endswith(".py"):
        file = Path(content["scene"]["builder"])
        file.parent.mkdir()
        file.write_text(builder)
    checked(TypeAdapter(Scene), content, "example")


def test_pictures_are_shown_somewhere():
    shown = {
        (page.parent / link).resolve()
        for page in PAGES
        for link in LINK.findall(text_of(page))
        if not link.startswith("http")
    }
    assert set((DOCS / "pictures").iterdir()) <= shown


def test_the_reference_says_what_the_models_and_programs_say(tmp_path):
    program = ROOT / "docs/reference.py"
    subprocess.run([sys.executable, program, "--folder", tmp_path], check=True)
    written = {path.name: path.read_text() for path in tmp_path.iterdir()}
    committed = {name: (DOCS / "reference" / name).read_text() for name in written}
    assert committed == written, "run docs/reference.py"
    generated = {p.name for p in (DOCS / "reference").glob("*.md") if GENERATED in p.read_text()}
    assert generated == set(written)


def rows_of(page, heading):
    """Return the first cells of the table below a heading, without their backticks."""
    section = page.read_text().partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    return [cell.strip("`") for cell in re.findall(r"^\| (`[^|]+`) \|", section, re.M)]


API = DOCS / "reference/api.md"


def first_heading(page):
    return HEADING.search(page.read_text())[1]


def types_of(member):
    """Return the types of a method or a property. None for another member."""
    function = getattr(member, "fget", None) or getattr(member, "func", None) or member
    function = getattr(function, "__func__", function)
    return typing.get_type_hints(function).values() if callable(function) else ()


def library_classes(annotation):
    """Return the classes of the library in a type, such as list[OpenDataset]."""
    inner = [each for part in typing.get_args(annotation) for each in library_classes(part)]
    is_own = inspect.isclass(annotation) and annotation.__module__.startswith("lightfield.")
    return [annotation, *inner] if is_own else inner


def reached_classes():
    """Return the names of the classes to which the public functions lead, by types on the page."""
    functions = [getattr(lightfield, name) for name in lightfield.__all__]
    queue = [typing.get_type_hints(function)["return"] for function in functions]
    reached = set()
    while queue:
        for model in library_classes(queue.pop()):
            if model not in reached:
                reached.add(model)
                queue += getattr(model, "__orig_bases__", ())
                fields = typing.get_type_hints(model)
                for row in rows_of(API, model.__name__):
                    name = row.partition("(")[0]
                    member = inspect.getattr_static(model, name, None)
                    queue += [fields[name]] if name in fields else types_of(member)
    return {model.__name__ for model in reached}


def test_the_page_of_the_library_has_each_class_to_which_its_functions_lead():
    reached = reached_classes()
    assert {"OpenDataset", "OpenViews", "OpenView", "LightField", "View", "Lens"} <= reached
    headings = {heading.partition("(")[0] for heading in HEADING.findall(API.read_text())}
    # An exception is in no type.
    expected = {*reached, *lightfield.__all__, "UserError"}
    assert expected == headings - {first_heading(API)}


@pytest.mark.parametrize("model", [OpenDataset, OpenView, SeenSurface, Image, Files])
def test_the_page_of_the_library_has_each_public_member_of_what_a_reader_gets(model):
    members = {*inspect.get_annotations(model), *vars(model)}
    shown = {row.partition("(")[0] for row in rows_of(API, model.__name__)}
    assert shown == {name for name in members if not name.startswith("_")}


# What a text says of a number: its unit, its range, or what it counts.
UNIT = re.compile(
    r"metres|radians|pixel|\bmm\b|0 to 1|0 for (the|its) first|units|unit (rays|normals)|"
    r"linear light|Rec\. 709|uint8|frame of the animation|file's dtype|divided|x and y of|"
    r"numbers in a pass"
)


def test_each_number_and_array_of_the_library_has_its_unit():
    rows = re.findall(r"^\| (`[^|]+`) \| ([^|]+) \| (.*) \|$", API.read_text(), re.M)
    assert len(rows) > 80
    for name, kind, meaning in rows:
        assert meaning.strip(), name
        assert "see the text" not in meaning, name
        if re.search(r"\b(floats?|int|float32|float64|(?<!bool )array)\b", kind):
            assert UNIT.search(meaning), (name, meaning)


def test_the_page_of_the_library_has_each_function_with_its_parameters():
    text = API.read_text()
    for name in lightfield.__all__:
        function = getattr(lightfield, name)
        assert f"\n## {name}({', '.join(inspect.signature(function).parameters)})\n" in text


def test_the_page_of_changes_has_each_version_of_stages_and_of_views():
    versions = {name: version for name, version in STAGE_VERSIONS.items() if version is not None}
    text = (DOCS / "reference/changes.md").read_text()
    rows = {
        name: int(number) for name, number in re.findall(r"^\| `(\w+)` \| (\d+) \|", text, re.M)
    }
    assert rows == versions | VIEW_VERSIONS


def test_the_page_of_limits_has_the_numbers_of_the_code():
    text = (DOCS / "reference/limits.md").read_text()
    both = f"{rigs.MOST_VIEWS:,}, {rigs.MOST_FRAMES:,}"
    for name, limit in [
        ("views of a dataset", f"{frames.MOST_VIEWS:,}"),
        ("views of a scene YAML, frames of a sequence", both),
        ("samples along a side of a pixel in a reprojection", f"{reprojections.MOST_SAMPLES}"),
        ("light in a file", f"{HALF_MAX:,.0f}"),
        ("a file of poses", f"{LARGEST_FILE / 1e6:.0f} MB"),
    ]:
        assert f"| {name} | {limit} |" in text
