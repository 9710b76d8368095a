"""Write the pages of docs/reference/ that follow from the models of settings and the programs.

Run this after changing a key of a settings model or a flag of a program, and also
scripts/schema.py.
"""

import argparse
import ast
import json
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, TypeAdapter

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.configuration import (
    config_file,
    corpus,
    family,
    publication,
    render_settings,
    reprojections,
    scene_blocks,
    scene_source,
    scene_yaml,
)
from lightfield.configuration.json_schema import Generator
from lightfield.core.cli import run
from lightfield.core.files import write_text
from lightfield.core.names import ROOT
from lightfield.core.units import limit
from lightfield.exporters import EXPORTERS, SEQUENCE_EXPORTS, Exports
from lightfield.exporters.base import Developed, Export, ForTraining
from lightfield.formats import render_block, sensors
from lightfield.geometry import boards, inertia, rigs
from lightfield.geometry.lenses import LENSES
from lightfield.geometry.lenses.calibration_settings import LensFileSettings
from lightfield.geometry.lenses.rectilinear import FileSettings
from lightfield.geometry.rigs import mount, path, rig, split_setting
from lightfield.settings.base import MEANINGS

PROGRAMS = ROOT / "scripts"
LIBRARY = PROGRAMS / "lightfield"
NOTE = "<!-- Written by docs/reference.py. Change the models or the programs instead. -->"


@dataclass(frozen=True)
class Section:
    """The table of a model's keys. ``shared`` is a model whose keys another section has."""

    title: str
    model: type[BaseModel]
    shared: type[BaseModel] | None = None


@dataclass(frozen=True)
class Page:
    """A page of keys. ``text`` is its first paragraph."""

    title: str
    text: str
    sections: list[Section]


def _models(annotation: Any) -> list[type[BaseModel]]:
    """Return the models of a union, in its order."""
    union = annotation.__args__[0] if hasattr(annotation, "__metadata__") else annotation
    return list(union.__args__)


def _literal(model: type[BaseModel], key: str) -> str:
    """Return the only value of a model's key, such as the name of a rig's type."""
    return str(model.model_fields[key].annotation.__args__[0])  # type: ignore[union-attr]


def _export_section(name: str) -> Section:
    """Return the section of an exporter's own keys."""
    model = EXPORTERS[name]
    shared = next(base for base in (ForTraining, Developed, Export) if issubclass(model, base))
    return Section(name, model, shared)


def _to_train_with() -> str:
    """Return the names of the exports on this page that are for training."""
    *names, last = [
        f"`{name}`"
        for name, model in EXPORTERS.items()
        if name not in SEQUENCE_EXPORTS and issubclass(model, ForTraining)
    ]
    return f"{', '.join(names)} and {last}"


def _without_pictures() -> str:
    """Return the names of the exports on this page that develop no pictures."""
    *names, last = [
        f"`{name}`"
        for name, model in EXPORTERS.items()
        if name not in SEQUENCE_EXPORTS and not issubclass(model, Developed)
    ]
    return f"{', '.join(names)} and {last}"


RIG_MODELS = _models(rigs.AnyRig)


LENS_MODELS: list[type[BaseModel]] = [
    *[lens.Settings for lens in LENSES.values() if lens.Settings],
    FileSettings,
    LensFileSettings,
]

# The pages of keys, by the names of their files.
KEY_PAGES: dict[str, Page] = {
    "config-keys.md": Page(
        "The keys of config.yaml",
        "`config.yaml` says which scenes to build, at which quality, and into which folders. The "
        "command line can replace each key: `snakemake --config preset=full`.",
        [
            Section("config.yaml", config_file.Configuration),
            Section("presets", config_file.Preset),
            Section("energy", config_file.Energy),
        ],
    ),
    "scene-keys.md": Page(
        "The keys of a scene YAML",
        "A scene YAML in `configs/scenes/` describes one scene and everything that is made from "
        "it. Only `scene` is always required. Large blocks, such as `render`, have pages of their "
        "own.",
        [
            Section("A scene YAML", scene_yaml.Scene),
            Section("scene", scene_source.SceneSource, scene_source.ModelOptions),
            Section("scene: of a model", scene_source.ModelOptions),
            Section("scene: parameters", scene_source.Parameters),
            Section("scene: targets: all boards", boards.Board),
            *[
                Section(f"scene: targets: {_literal(model, 'type')}", model, boards.Board)
                for model in _models(boards.AnyBoard)
            ],
            Section("flow", scene_blocks.Flow),
            Section("mesh", scene_blocks.MeshFiles),
            Section("video", scene_blocks.Video),
            Section("report", scene_blocks.Report),
            Section("publish", publication.Publication),
            Section("publish: a creator", publication.Creator),
        ],
    ),
    "family-keys.md": Page(
        "The keys of `family`",
        "`family` in a scene YAML makes many scenes of it, which differ by seed, model or drawn "
        "values. [Build a family](../how-to/build-a-family.md) shows how.",
        [
            Section("family", family.Family),
            Section("family: values", family.Draw),
            Section("family: corpus", corpus.CorpusOptions),
            Section("family: corpus: splits", corpus.Shares),
        ],
    ),
    "render-keys.md": Page(
        "The keys of `render`",
        "`render` in a scene YAML says how Cycles renders the views. Either `samples` or "
        "`target_error` is required.",
        [
            Section("render", render_settings.Render),
            Section("render: target_error", render_block.TargetError),
            Section("render: camera_motion", render_block.CameraMotion),
        ],
    ),
    "rig-keys.md": Page(
        "The keys that all rigs share",
        "A rig in a scene YAML has a `type`, a `camera`, and these keys. It also has "
        "[the keys of its type](rig-type-keys.md). [Rigs](rigs.md) shows where each type "
        "places its cameras.",
        [
            Section("All rigs", rig.Rig),
            Section("frames", rig.Frames),
            Section("stereo", rig.Stereo),
            Section("A camera of a head", mount.HeadCameraSettings),
            Section("split", split_setting.Chosen),
        ],
    ),
    "rig-type-keys.md": Page(
        "The keys of each type of rig",
        "The key `type` of a rig is the title of one of these tables, which lists its keys. All "
        "rigs "
        "also have "
        "[the shared keys](rig-keys.md). [Rigs](rigs.md) shows where each type places its "
        "cameras.",
        [
            *[Section(_literal(model, "type"), model, rig.Rig) for model in RIG_MODELS],
            Section("A key of a path", path.Key),
            Section("The imu of a path", inertia.Imu),
        ],
    ),
    "camera-keys.md": Page(
        "The keys of a camera",
        "`camera` describes the lens and the image of a rig or of a reprojection. Its key `lens` "
        "is "
        "the title of one of these tables, which lists the other keys. [Lenses](lenses.md) has "
        "the equations.",
        [Section(_literal(model, "lens"), model) for model in LENS_MODELS],
    ),
    "reprojection-keys.md": Page(
        "The keys of a reprojection",
        "An entry of `reprojections` in a scene YAML makes versions of the views: through another "
        "lens, or as other files. Its name is the name of their folder.",
        [Section("A reprojection", reprojections.ReprojectionEntry)],
    ),
    "sensor-keys.md": Page(
        "The keys of `sensor`",
        "`sensor` in a scene YAML develops views as a camera would: with noise, vignetting and a "
        "response. The clean views stay. [Simulate a sensor](../how-to/simulate-a-sensor.md) shows "
        "how.",
        [
            Section("sensor", sensors.Sensor),
            Section("A value that varies", sensors.Varied),
            Section("vignetting", sensors.Vignetting),
            Section("response", sensors.Response),
            Section("noise", sensors.Noise),
            Section("In a settings file", sensors.SensorSettings, sensors.SensorOptions),
        ],
    ),
    "export-keys.md": Page(
        "The keys of exports",
        "An entry of `exports` in a scene YAML writes files in one format. "
        "[Export formats](export-formats.md) says which programs read each format. All but "
        f"{_without_pictures()} are exports of pictures, so they have those keys, too. "
        f"{_to_train_with()} are for training, and have the keys of such exports.",
        [
            Section("exports", Exports),
            Section("All exports", Export),
            Section("Exports of pictures", Developed, Export),
            Section("Exports for training", ForTraining, Developed),
            *[_export_section(name) for name in EXPORTERS if name not in SEQUENCE_EXPORTS],
        ],
    ),
    "sequence-export-keys.md": Page(
        "The keys of exports of a sequence",
        "These entries of `exports` in a scene YAML need a rig with `frames`. Each writes one "
        "export "
        "of all frames. [Train on a sequence](../how-to/train-on-a-sequence.md) shows how.",
        [Section(name, EXPORTERS[name]) for name in SEQUENCE_EXPORTS],
    ),
}

# The programs, by what they are for.
PROGRAM_GROUPS = {
    "Prepare a scene": [
        "new_scene", "build_scene", "import_model", "fetch_blend", "check_blend", "inventory",
        "make_lightfield", "free_places", "check_cameras", "corners", "import_views",
    ],
    "Build a family": ["build_members", "corpus", "count_members", "list_scenes", "prune"],
    "Render": ["check_device", "probe", "calibrate", "render_shard"],
    "Reproject": ["lens_map", "reproject"],
    "Export": [
        "flow",
        "surface",
        "splits",
        "heads",
        "export",
        "export_instant_ngp",
        "synthesize",
        "video",
    ],
    "Publish and fetch": ["publish_checksums", "package", "publish", "take_dataset"],
    "Check": ["validate", "validate_sequence", "verify", "diff", "status"],
    "Report": [
        "report_figures", "report_html", "report_sequence", "report_walk", "report_index", "costs",
        "schema",
    ],
    "Measure": [
        "evaluate", "evaluate_surface", "evaluate_calibration", "synthesis_quality",
        "error_vs_time", "plan", "gpu_check",
    ],
}  # fmt: skip


@dataclass(frozen=True)
class Part:
    """A function or a class of the library that people use in Python.

    The page shows all public members of a class, or only ``members``.
    """

    file: str
    name: str
    members: tuple[str, ...] = ()


# The reader's interface, in the order of its page.
API = [
    Part("reading/opening.py", "open_dataset"),
    Part("reading/opening.py", "open_corpus"),
    Part("reading/dataset.py", "OpenDataset"),
    Part("reading/dataset.py", "OpenViews"),
    Part("reading/dataset.py", "OpenView"),
    Part("reading/dataset.py", "Reprojections"),
    Part("reading/surface.py", "SeenSurface"),
    Part("reading/files.py", "Files"),
    Part(
        "formats/lightfield.py",
        "LightField",
        ("content", "views", "path", "lens", "depth", "world_from_cameras", "light_groups"),
    ),
    Part(
        "formats/lightfield.py",
        "View",
        (
            "name", "world_from_camera", "position", "rotation", "others", "split", "exposure",
            "flow", "to_camera",
        ),
    ),
    Part(
        "geometry/lenses/base.py",
        "Lens",
        (
            "width", "height", "sensor", "center", "description", "field_of_view", "has_z_depth",
            "K", "rays", "pixels", "in_frame", "pixel_rays", "resized",
        ),
    ),
    Part("imaging/images.py", "Image"),
    Part("core/errors.py", "UserError"),
]  # fmt: skip


def schema_of(model: type[BaseModel]) -> dict[str, Any]:
    """Return a model's JSON schema."""
    return TypeAdapter(model).json_schema(schema_generator=Generator)


def slug(heading: str) -> str:
    """Return the anchor of a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def link_targets() -> dict[str, str]:
    """Return where the keys of each model stand, by the model's name in JSON schemas."""
    targets = {
        schema_of(section.model)["title"]: f"{file}#{slug(section.title)}"
        for file, page in KEY_PAGES.items()
        for section in page.sections
    }
    # A scene YAML's `rigs` may be any of these.
    any_rig = {schema_of(model)["title"]: "rig-type-keys.md" for model in RIG_MODELS}
    return targets | any_rig | {"CameraSettings": "camera-keys.md"}


class Table:
    """Rows for the keys of JSON schemas. ``targets`` are links to models' tables."""

    def __init__(self, targets: dict[str, str]) -> None:
        self.targets = targets
        self.definitions: dict[str, Any] = {}

    def of(self, section: Section) -> list[str]:
        """Return the lines of a model's table."""
        content = schema_of(section.model)
        self.definitions = content.get("$defs", {})
        shared = schema_of(section.shared)["properties"] if section.shared else {}
        rows = [
            self.row(key, value, key in content.get("required", ()))
            for key, value in content["properties"].items()
            if key not in shared or value.get("description") != shared[key].get("description")
            if not _selects_table(key, value)
        ]
        header = "| key | type | unit | default | allowed | meaning |"
        return [header, "| --- | --- | --- | --- | --- | --- |", *rows]

    def row(self, key: str, value: dict[str, Any], is_required: bool) -> str:
        """Return the row of one key."""
        default = "required" if is_required else _default(value)
        meaning = value.get("description", "") or self._meaning_of_model(value)
        if not meaning:
            raise AssertionError(f"{key}: has no description in its model")
        cells = (
            f"`{key}`",
            self.kind(value),
            value.get("unit", "–"),
            default,
            " or ".join(dict.fromkeys(self.limits(value))) or "–",
            escaped(meaning),
        )
        return f"| {' | '.join(cells)} |"

    def _meaning_of_model(self, value: dict[str, Any]) -> str:
        """Return what a model says of itself. Pydantic leaves out a key's equal description."""
        name = value.get("$ref", "").rpartition("/")[2]
        return str(self.definitions.get(name, {}).get("description", "")).partition("\n\n")[0]

    def kind(self, value: dict[str, Any], is_plural: bool = False) -> str:
        """Return a value's type in words."""
        ending = "s" if is_plural else ""
        match value:
            case {"$ref": reference}:
                return self._reference(reference, is_plural)
            case {"anyOf": choices} | {"oneOf": choices}:
                kinds = [self.kind(choice, is_plural) for choice in choices]
                return " or ".join(dict.fromkeys(kinds))
            case {"const": _} | {"enum": _}:
                return f"word{ending}" if not _numbers(value) else f"whole number{ending}"
            case {"type": "array", "prefixItems": items}:
                return f"list of {len(items)} {self.kind(items[0], True)}"
            case {"type": "array", "items": item}:
                return f"list of {self.kind(item, True)}"
            case {"type": "object", "patternProperties": patterns}:
                (content,) = patterns.values()
                return f"mapping of names to {self.kind(content, True)}"
            case {"type": "object", "additionalProperties": dict(content)}:
                return f"mapping of names to {self.kind(content, True)}"
            case {"type": name}:
                return f"{NAMES_OF_TYPES[name]}{ending}"
        return "any"

    def _reference(self, reference: str, is_plural: bool) -> str:
        name = reference.rpartition("/")[2]
        if name in self.targets:
            return f"[mapping{'s' if is_plural else ''}]({self.targets[name]})"
        return self.kind(self.definitions[name], is_plural)

    def limits(self, value: dict[str, Any]) -> Iterator[str]:
        """Yield the allowed values and ranges of each of a value's types."""
        match value:
            case {"$ref": reference}:
                name = reference.rpartition("/")[2]
                if name not in self.targets:
                    yield from self.limits(self.definitions[name])
            case {"anyOf": choices} | {"oneOf": choices}:
                for choice in choices:
                    yield from self.limits(choice)
            case {"const": word}:
                yield f"`{_text(word)}`"
            case {"enum": words}:
                yield ", ".join(f"`{_text(word)}`" for word in words)
            case {"type": "array", "prefixItems": items}:
                yield from self.limits(items[0])
            case {"type": "array", "items": item}:
                yield from self.limits(item)
            case {"type": "boolean"}:
                yield "`true`, `false`"
            case {"pattern": expression} if expression in MEANINGS:
                yield escaped(MEANINGS[expression])
            case _:
                yield from filter(None, [_range(value)])


NAMES_OF_TYPES = {
    "string": "text",
    "integer": "whole number",
    "number": "number",
    "boolean": "switch",
    "object": "mapping",
    "array": "list",
}


def _selects_table(key: str, value: dict[str, Any]) -> bool:
    """Return whether a key says only which of a page's tables to read."""
    return key in ("type", "lens") and "const" in value


def _numbers(value: dict[str, Any]) -> bool:
    """Return whether the allowed values are numbers."""
    allowed = value["enum"] if "enum" in value else [value["const"]]
    return all(isinstance(each, int) for each in allowed)


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _default(value: dict[str, Any]) -> str:
    default = value.get("default")
    if default is None or isinstance(default, dict):
        return "–"
    return f"`{_text(default)}`"


def _range(value: dict[str, Any]) -> str:
    """Return the range of a number in words. Empty without limits."""
    least = value.get("minimum")
    most = value.get("maximum")
    if "exclusiveMinimum" in value:
        lower = f"above {value['exclusiveMinimum']:.10g}"
    else:
        lower = "" if least is None else limit(least)
    if "exclusiveMaximum" in value:
        upper = f"below {value['exclusiveMaximum']:.10g}"
    else:
        upper = "" if most is None else limit(most)
    match (lower, upper):
        case ("", ""):
            return ""
        case (_, ""):
            return lower if lower.startswith("above") else f"at least {lower}"
        case ("", _):
            return upper if upper.startswith("below") else f"at most {upper}"
    connection = " and " if upper.startswith("below") else " to "
    return lower + connection + upper


def escaped(text: str) -> str:
    """Return text on one line, as Markdown that shows its characters unchanged."""
    line = " ".join(text.split()).replace("``", "`")
    # Code keeps its characters.
    parts = line.split("`")
    parts[::2] = [part.replace("<", "&lt;").replace("*", r"\*") for part in parts[::2]]
    return "`".join(parts).replace("|", r"\|")


def page_of_keys(page: Page, table: Table) -> str:
    """Return a page of keys."""
    lines = [f"# {page.title}", "", NOTE, "", page.text, ""]
    for section in page.sections:
        lines += [f"## {section.title}", ""]
        text = (section.model.__doc__ or "").partition("\n\n")[0]
        if text.startswith("The settings of scripts/"):
            text = ""
        rows = table.of(section)
        has_keys = len(rows) > 2
        if not has_keys:
            text = f"{text} It has no keys of its own.".strip()
        if text:
            lines += [escaped(text), ""]
        if has_keys:
            lines += [*rows, ""]
    return "\n".join(lines)


def page_of_programs() -> str:
    """Return the page with a table of the programs."""
    lines = ["# Which program does what?", "", NOTE, "", PROGRAMS_TEXT, ""]
    for group, names in PROGRAM_GROUPS.items():
        lines += [f"## {group}", "", "| program in `scripts/` | what it does |", "| --- | --- |"]
        for name in names:
            file = PROGRAMS / f"{name}.py"
            text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
            lines.append(f"| `{file.name}` | {escaped(text.partition(chr(10))[0])} |")
        lines.append("")
    return "\n".join(lines)


PROGRAMS_TEXT = """\
Each program in `scripts/` is one step of a build, and Snakemake runs it. You can also run it by
hand. Its help has its flags, its files and examples:

```
python scripts/reproject.py --help
```

Many programs read a *settings file* (`--settings`): a JSON with what the job takes from the scene
YAML. Its keys have the names that they have in the YAML, and the program's help lists them. A run
writes the file of each of its jobs to `work/<scene>/<rig>/settings/`, so you can copy one.
[Settings files](../explanation/settings-files.md) has an example."""


class Interface:
    """Writes the page of the library's interface from its source."""

    def __init__(self) -> None:
        self.lines = ["# What does the Python library offer?", "", NOTE, "", API_TEXT, ""]

    def page(self) -> str:
        """Return the page."""
        for part in API:
            tree = ast.parse((LIBRARY / part.file).read_text(encoding="utf-8"))
            (node,) = (each for each in tree.body if getattr(each, "name", "") == part.name)
            types = Types(tree)
            if isinstance(node, ast.FunctionDef):
                self._function(node, types)
            else:
                assert isinstance(node, ast.ClassDef)
                self._class(node, types, part.members)
        return "\n".join(self.lines)

    def _function(self, node: ast.FunctionDef, types: "Types") -> None:
        names = ", ".join(argument.arg for argument in node.args.args)
        self.lines += [f"## {node.name}({names})", "", *_docstring(node).split("\n"), ""]
        self.lines += [f"`{types.of_call(node)}` returns {types.of(node.returns)}.", ""]

    def _class(self, node: ast.ClassDef, types: "Types", chosen: tuple[str, ...]) -> None:
        """Add a class: its text, and the table of its attributes and methods."""
        meanings = dict(FIELD.findall(_docstring(node)))
        rows = {
            name: row
            for child in node.body
            for name, row in _row_of_member(child, types, node.name, meanings)
        }
        shown = chosen or [name for name in rows if not name.startswith("_")]
        # The table has the attributes that it shows.
        text = FIELD.sub(lambda field: "" if field[1] in shown else field[0], _docstring(node))
        paragraphs = re.sub(r"\n\n+", "\n\n", text.strip())
        self.lines += [f"## {node.name}", "", *paragraphs.split("\n"), ""]
        if shown:
            self.lines += ["| member | type | meaning |", "| --- | --- | --- |"]
            self.lines += [*(rows[name] for name in shown), ""]


API_TEXT = """\
`open_dataset` and `open_corpus` open finished datasets, and return objects with pixels, rays and
projections. [Read a dataset in Python](../how-to/read-a-dataset.md) has examples. Positions and
depth are in metres, angles in radians, pixels from the image's top left corner. A mistake raises
`lightfield.core.errors.UserError`, one line."""

# An attribute in the docstring of its class.
FIELD = re.compile(r"^- `(\w+)`: (.*(?:\n  .*)*)\n?", re.M)

# The names of types in the source, as the page shows them. Arrays have the names of their dtypes.
TYPES = {
    "ArrayLike": "array",
    "npt.ArrayLike": "array",
    "npt.DTypeLike": "dtype",
    "np.ndarray[Any, Any]": "array",
    "images.Image": "Image",
    "AbstractContextManager[Path]": "context manager of a Path",
    "str | os.PathLike[str]": "str or Path",
    "Self": "Lens",
    "Pair": "two floats",
    "Attribute": "str or number",
    "Chromaticities": "eight floats",
}
ARRAY = re.compile(r"(?:npt\.)?NDArray\[(?:np\.)?(\w+)\]")


class Types:
    """The types in a module, as the page shows them."""

    def __init__(self, tree: ast.Module) -> None:
        # The module's own names of arrays' types, such as Floats.
        arrays = {
            ast.unparse(node.targets[0]): ast.unparse(node.value)
            for node in tree.body
            if isinstance(node, ast.Assign) and ARRAY.fullmatch(ast.unparse(node.value))
        }
        self.names = arrays | TYPES

    def of(self, annotation: ast.expr | None) -> str:
        """Return a type as the page shows it."""
        text = ast.unparse(annotation).strip("'") if annotation else ""
        for name, plain in self.names.items():
            text = re.sub(rf"(?<![\w.]){re.escape(name)}(?![\w\[])", plain, text)
        text = ARRAY.sub(lambda array: f"{array[1].rstrip('_')} array", text)
        return text.replace("Any array", "array").replace("'", "").replace(" | ", " or ")

    def of_call(self, node: ast.FunctionDef) -> str:
        """Return how a function is called: its name, and its parameters with their types."""
        parameters = [
            f"{argument.arg}: {self.of(argument.annotation)}"
            for argument in node.args.args
            if argument.arg not in ("self", "cls")
        ]
        return f"{node.name}({', '.join(parameters)})"


def _docstring(node: ast.FunctionDef | ast.ClassDef) -> str:
    """Return a docstring as Markdown."""
    text = ast.get_docstring(node)
    if not text:
        raise AssertionError(f"{node.name}: has no docstring")
    return text.replace("``", "`")


def _row_of_member(
    node: ast.stmt, types: Types, owner: str, meanings: dict[str, str]
) -> Iterator[tuple[str, str]]:
    """Yield the name and the row of an attribute or a method.

    The docstring of the ``owner`` has the ``meanings`` of attributes.
    """
    if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
        name = node.target.id
        meaning = escaped(meanings.get(name) or f"see the text on `{owner}`")
        yield name, f"| `{name}` | {escaped(types.of(node.annotation))} | {meaning} |"
    elif isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
        decorators = [ast.unparse(each) for each in node.decorator_list]
        is_property = any(each.endswith("property") for each in decorators)
        call = node.name if is_property else types.of_call(node)
        kind = escaped(types.of(node.returns))
        # Only what the page does not show may have no docstring.
        yield node.name, f"| `{call}` | {kind} | {escaped(ast.get_docstring(node) or '')} |"


def reference() -> dict[str, str]:
    """Return the pages' texts, by the names of their files."""
    listed = sorted(name for names in PROGRAM_GROUPS.values() for name in names)
    existing = sorted(file.stem for file in PROGRAMS.glob("*.py"))
    if listed != existing:
        different = ", ".join(sorted({*listed} ^ {*existing}))
        raise AssertionError(f"PROGRAM_GROUPS: differs from scripts/: {different}")
    table = Table(link_targets())
    texts = {file: page_of_keys(page, table) for file, page in KEY_PAGES.items()}
    return texts | {"programs.md": page_of_programs(), "api.md": Interface().page()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    folder = ROOT / "docs" / "reference"
    parser.add_argument(
        "--folder", type=Path, default=folder, help="folder to write (default: %(default)s)"
    )
    target: Path = parser.parse_args().folder
    for name, text in reference().items():
        write_text(target / name, text)


if __name__ == "__main__":
    run(main)
