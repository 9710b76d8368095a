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
    exports,
    family,
    publication,
    render_settings,
    reprojections,
    scene_source,
    scene_yaml,
)
from lightfield.configuration.capture import LightfieldSettings
from lightfield.configuration.exports import SEQUENCE_EXPORTS
from lightfield.configuration.json_schema import Generator
from lightfield.core import flags
from lightfield.core.cli import run
from lightfield.core.files import write_text
from lightfield.core.names import ROOT
from lightfield.core.settings import MEANINGS
from lightfield.core.units import limit
from lightfield.formats import render_block, sensors
from lightfield.geometry import rigs
from lightfield.geometry.lenses import LENSES
from lightfield.geometry.lenses.rectilinear import FileSettings
from lightfield.geometry.rigs import path, rig, split_setting
from lightfield.stages import checks, measurement, publishing, report
from lightfield.stages import exports as export_stages
from lightfield.stages import family as family_stages
from lightfield.stages import rig as rig_stages
from lightfield.stages import scene as scene_stages
from lightfield.stages.registry import BY_NAME

PROGRAMS = ROOT / "scripts"
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
    model = exports.settings_of(name)
    develops = issubclass(model, exports.Developed)
    return Section(name, model, exports.Developed if develops else exports.Export)


RIG_MODELS = _models(rigs.AnyRig)


LENS_MODELS: list[type[BaseModel]] = [
    *[lens.Settings for lens in LENSES.values() if lens.Settings],
    FileSettings,
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
            Section("flow", scene_yaml.Flow),
            Section("mesh", scene_yaml.MeshFiles),
            Section("report", scene_yaml.Report),
            Section("publish", publication.Publication),
            Section("publish: a creator", publication.Creator),
            # The other programs' settings files fill a page of their own.
            Section(
                "The settings file of import_model.py",
                scene_stages.ImportSettings,
                scene_source.ModelOptions,
            ),
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
            # The settings files of its jobs.
            Section("The settings file of build_members.py", family_stages.BatchSettings),
            Section("The settings file of build_members.py: members", family.Member),
            Section("The settings file of count_members.py", family_stages.CountSettings),
            Section("The settings file of corpus.py", family_stages.CorpusSettings),
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
        "`instant_ngp` and `poses_csv` are exports of pictures, so they have those keys, too.",
        [
            Section("exports", exports.Exports),
            Section("All exports", exports.Export),
            Section("Exports of pictures", exports.Developed, exports.Export),
            *[
                _export_section(name)
                for name in exports.Exports.model_fields
                if name not in SEQUENCE_EXPORTS
            ],
        ],
    ),
    "sequence-export-keys.md": Page(
        "The keys of exports of a sequence",
        "These entries of `exports` in a scene YAML need a rig with `frames`. Each writes one "
        "export "
        "of all frames. [Train on a sequence](../how-to/train-on-a-sequence.md) shows how.",
        [Section(name, exports.settings_of(name)) for name in SEQUENCE_EXPORTS],
    ),
    "job-keys.md": Page(
        "The keys of the programs' settings files",
        "A settings file is a JSON with everything that one job takes from the scene YAML and "
        "config.yaml. Snakemake writes these files in its plan, and the programs read them with "
        "`--settings`. You can also write one by hand.",
        [
            Section("build_scene.py", scene_stages.BuildSettings),
            Section("make_lightfield.py", LightfieldSettings),
            Section("free_places.py", rig_stages.FreePlacesSettings),
            Section("surface.py", export_stages.MeshSettings),
            Section("reproject.py and lens_map.py", reprojections.Reprojection),
            Section("export.py and export_instant_ngp.py", exports.ExportSettings[exports.Export]),
            Section("validate.py", checks.ValidationSettings),
            Section("validate_sequence.py", checks.SequenceValidationSettings),
            Section("package.py and publish.py", publishing.PackSettings),
            Section("package.py and publish.py: scene", scene_yaml.Credits),
            Section("report_figures.py", report.FiguresSettings),
            Section("report_html.py", report.PageSettings),
            Section("report_html.py: measurements", report.MeasurementFile),
        ],
    ),
    "measurement-keys.md": Page(
        "The keys of the settings files of measurements",
        "These programs measure or estimate something. They read a "
        "[settings file](job-keys.md) like the other programs.",
        [
            Section("evaluate.py", measurement.EvaluationSettings),
            Section("evaluate_surface.py", measurement.SurfaceSettings),
            Section("synthesis_quality.py", measurement.SynthesisSettings),
            Section("costs.py", measurement.CostSettings),
            Section("costs.py: full_size", measurement.FullSize),
            Section("probe.py", measurement.ProbeSettings),
            Section("calibrate.py", measurement.CalibrationSettings),
            Section("error_vs_time.py", measurement.ErrorVsTimeSettings),
            Section("gpu_check.py", measurement.GpuCheckSettings),
        ],
    ),
}

# The pages of the programs' settings files.
JOB_PAGES = ("job-keys.md", "measurement-keys.md")

# The programs of each page, in the order of the pages.
PROGRAM_PAGES = {
    "programs-scene.md": (
        "Programs that prepare a scene",
        "These programs build or check a scene, and place its cameras.",
        [
            "build_scene", "import_model", "fetch_blend", "check_blend", "inventory",
            "make_lightfield", "free_places", "check_cameras", "import_views",
        ],
    ),
    "programs-family.md": (
        "Programs that build families",
        "These programs build the members of families of scenes, collect them, and count them.",
        ["build_members", "corpus", "count_members"],
    ),
    "programs-render.md": (
        "Programs that render",
        "These programs render views, or find out how to render them.",
        ["check_device", "probe", "calibrate", "render_shard"],
    ),
    "programs-reproject.md": (
        "Programs that reproject",
        "These programs make views through another lens from finished views.",
        ["lens_map", "reproject"],
    ),
    "programs-export.md": (
        "Programs that export",
        "These programs write finished views in other formats, and compute more from them.",
        ["flow", "surface", "splits", "export", "export_instant_ngp", "synthesize"],
    ),
    "programs-publish.md": (
        "Programs that publish and fetch",
        "These programs pack finished datasets, or copy them from a storage.",
        ["publish_checksums", "package", "publish", "take_dataset"],
    ),
    "programs-check.md": (
        "Programs that check",
        "These programs check files, or show the progress of a build.",
        ["validate", "validate_sequence", "verify", "diff", "status"],
    ),
    "programs-report.md": (
        "Programs that report",
        "These programs make pictures, pages, tables and schemas.",
        [
            "report_figures", "report_html", "report_index", "costs", "schema",
        ],
    ),
    "programs-measure.md": (
        "Programs that measure",
        "These programs measure error, quality, and time.",
        [
            "evaluate", "evaluate_surface", "synthesis_quality", "error_vs_time",
            "plan", "gpu_check",
        ],
    ),
}  # fmt: skip


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
        if file not in JOB_PAGES
        for section in page.sections
    }
    jobs = {
        schema_of(section.model)["title"]: f"{file}#{slug(section.title)}"
        for file in JOB_PAGES
        for section in KEY_PAGES[file].sections
    }
    # A scene YAML's `rigs` may be any of these.
    any_rig = {schema_of(model)["title"]: "rig-type-keys.md" for model in RIG_MODELS}
    return jobs | targets | any_rig | {"CameraSettings": "camera-keys.md"}


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


def code(text: str) -> str:
    """Return text as code in a table. Not all readers of Markdown agree on a bar in backticks."""
    return f"<code>{text.replace('|', '&#124;')}</code>" if "|" in text else f"`{text}`"


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


def section_of_program(name: str) -> list[str]:
    """Return the lines about one program."""
    file = PROGRAMS / f"{name}.py"
    text = (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").strip()
    parser = flags.parser_of(BY_NAME[name], text)
    lines = [f"## {file.name}", ""]
    for paragraph in text.split("\n\n"):
        is_code = paragraph.startswith(" ")
        lines += ["```", paragraph, "```", ""] if is_code else [escaped(paragraph), ""]
    lines += ["| argument | value | default | meaning |", "| --- | --- | --- | --- |"]
    # argparse itself names the first two groups, in other words in each version.
    for number, group in enumerate(parser._action_groups):
        rows = [row_of(action) for action in group._group_actions if action.dest != "help"]
        if rows and number > 1:
            lines.append(f"| *{escaped(group.title or '')}* | | | |")
        lines += rows
    return [*lines, ""]


def row_of(action: argparse.Action) -> str:
    """Return the row of one argument."""
    flags = ", ".join(f"`{flag}`" for flag in action.option_strings)
    is_required = action.required and action.nargs not in ("?", "*")
    default = "required" if is_required else "–"
    given = re.search(r" \(default: (\S+)\)$", action.help or "")
    if given and not is_required:
        default = f"`{given[1]}`"
    values = action.choices if action.choices is not None else []
    metavar = action.metavar if action.metavar is not None else action.dest.upper()
    placeholder = metavar if isinstance(metavar, str) else " ".join(metavar)
    value_text = ", ".join(f"`{choice}`" for choice in values) or code(placeholder)
    if action.nargs == 0:
        value_text = "–"
    elif action.nargs in ("+", "*"):
        value_text += " …"
    meaning = escaped((action.help or "").replace("%%", "%"))
    if not meaning:
        raise AssertionError(f"{flags or action.dest}: has no help text")
    return f"| {flags or f'`{action.dest}`'} | {value_text} | {default} | {meaning} |"


def page_of_programs(title: str, text: str, names: list[str]) -> str:
    """Return a page of programs."""
    lines = [f"# {title}", "", NOTE, ""]
    lines += [
        f"{text} Snakemake runs them. To run one by hand: `python scripts/NAME.py`.",
        "",
    ]
    for name in names:
        lines += section_of_program(name)
    return "\n".join(lines)


def reference() -> dict[str, str]:
    """Return the pages' texts, by the names of their files."""
    listed = sorted(name for _, _, names in PROGRAM_PAGES.values() for name in names)
    existing = sorted(file.stem for file in PROGRAMS.glob("*.py"))
    if listed != existing:
        different = ", ".join(sorted({*listed} ^ {*existing}))
        raise AssertionError(f"PROGRAM_PAGES: differs from scripts/: {different}")
    table = Table(link_targets())
    texts = {file: page_of_keys(page, table) for file, page in KEY_PAGES.items()}
    programs = {file: page_of_programs(*content) for file, content in PROGRAM_PAGES.items()}
    return texts | programs


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
