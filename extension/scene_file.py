"""Reads the rigs of a scene YAML, and writes them without changing its other lines."""

import math
from collections.abc import Iterator, Mapping
from contextlib import chdir
from pathlib import Path
from typing import Any

import yaml

from .scripts.lightfield.configuration.blend_lock import record_blend
from .scripts.lightfield.configuration.scene_yaml import check_scene
from .scripts.lightfield.core.errors import UserError
from .scripts.lightfield.core.files import atomic_path, sha256
from .scripts.lightfield.geometry.rigs import as_written
from .scripts.lightfield.settings.yaml_files import parse_yaml, read_settings_text

Rigs = Mapping[str, Mapping[str, Any]]
Edit = tuple[int, int, str]


def home(path: Path) -> Path:
    """Return the folder in which the workflow runs. A scene YAML's paths start from there."""
    return path.parents[2] if path.parts[-3:-1] == ("configs", "scenes") else path.parent


def read(path: Path) -> dict[str, dict[str, Any]]:
    """Return the keys of each rig in a scene YAML, without those that have a head.

    Raises `UserError` if the YAML is not valid.
    """
    text = read_settings_text(path, path.name)
    with chdir(home(path)):
        scene = check_scene(text, path.name)
    rigs = parse_yaml(text, path.name).get("rigs", {})
    return {
        name: rigs.get(name) or as_written(rig) for name, rig in scene.rigs.items() if not rig.mount
    }


def write(path: Path, rigs: Rigs, removed: set[str], blend: Path | None, is_saved: bool) -> str:
    """Write the rigs to a scene YAML, and record the .blend if the scene is the ``blend``.

    Rigs of the file stay unless they are ``removed``. A file that does not exist becomes the YAML
    of the .blend. Returns what was written, in one line. Raises `UserError` without writing
    anything if the YAML would not be valid, or if the .blend is not saved.
    """
    folder = home(path)
    text = read_settings_text(path, path.name) if path.exists() else _new(path, blend, folder)
    text = _with_rigs(text, rigs, removed, path.name)
    with chdir(folder):
        scene = check_scene(text, path.name)
        source = scene.scene.blend
        is_of_blend = bool(source and blend and Path(source).resolve() == blend.resolve())
        if is_of_blend and not is_saved:
            raise UserError(f"{blend.name}: has changes that are not saved; save it first")
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    if is_of_blend and scene.scene.sha256 is None:
        record_blend(blend, sha256(blend), path.with_suffix(".lock.json"))
        return f"{path.name} and {path.stem}.lock.json written"
    return f"{path.name} written"


def _new(path: Path, blend: Path | None, folder: Path) -> str:
    """Return the text of a scene YAML for a .blend, with no rigs yet.

    In the repository, its first line tells editors the schema.
    """
    if blend is None:
        raise UserError("the .blend has no file yet; save it, or open a scene YAML")
    inside = blend.is_relative_to(folder)
    source = blend.relative_to(folder) if inside else blend
    schema = "schema/scene.schema.json"
    # The folder scenes may not exist yet.
    has_schema = (path.parent.parent / schema).is_file()
    first_line = f"# yaml-language-server: $schema=../{schema}\n" if has_schema else ""
    blocks = f"scene:\n  blend: {_flow(str(source))}\n\nrender:\n  samples: file\n\nrigs:\n"
    return first_line + blocks


def _with_rigs(text: str, rigs: Rigs, removed: set[str], file: str) -> str:
    """Return a scene YAML's text with these rigs. All other lines stay as they are."""
    content = parse_yaml(text, file) or {}
    if text.endswith("rigs:\n"):
        blocks = "".join(_block(name, settings, "  ") for name, settings in rigs.items())
        return text + blocks
    old = content.get("rigs")
    if old is None:
        raise UserError(f"{file}: rigs: come with scene.dataset, so they cannot be changed")
    if not text.endswith("\n"):
        text += "\n"
    edits = list(_edits(text, old, rigs, removed))
    for start, end, replacement in sorted(edits, reverse=True):
        text = text[:start] + replacement + text[end:]
    kept = {name: settings for name, settings in old.items() if name not in removed}
    try:
        is_right = parse_yaml(text, file) == {**content, "rigs": {**kept, **rigs}}
    except UserError:
        is_right = False
    if not is_right:
        raise UserError(
            f"{file}: rigs: cannot be changed alone, because of anchors, merges or braces there; "
            "edit them by hand, or write another file"
        )
    return text


def _edits(text: str, old: Rigs, rigs: Rigs, removed: set[str]) -> Iterator[Edit]:
    """Yield what to replace in a YAML's text: start, end, and the new text."""
    block = _values(yaml.compose(text, Loader=yaml.SafeLoader))["rigs"][1]
    nodes = _values(block)
    for name in removed & nodes.keys():
        key, value = nodes[name]
        start = text.rindex("\n", 0, key.start_mark.index) + 1
        yield start, _end(text, value), ""
    for name, settings in rigs.items():
        if name not in old:
            indent = " " * block.start_mark.column
            end = _end(text, block)
            yield end, end, _block(name, settings, indent)
            continue
        keys = _values(nodes[name][1])
        for key, value in settings.items():
            if old[name].get(key) == value:
                continue
            if key in keys:
                node = keys[key][1]
                yield node.start_mark.index, node.end_mark.index, _flow(value)
            elif nodes[name][1].flow_style:
                (first, _), *_ = keys.values()
                yield first.start_mark.index, first.start_mark.index, f"{key}: {_flow(value)}, "
            else:
                end = _end(text, nodes[name][1])
                indent = " " * nodes[name][1].start_mark.column
                yield end, end, f"{indent}{key}: {_flow(value)}\n"


def _values(node: yaml.MappingNode) -> dict[str, tuple[yaml.Node, yaml.Node]]:
    """Return the nodes of each key of a mapping, and of its value."""
    return {key.value: (key, value) for key, value in node.value}


def _end(text: str, node: yaml.Node) -> int:
    """Return where the lines of a node end. Empty lines and comments below it do not count."""
    end = node.end_mark.index
    if isinstance(node, yaml.CollectionNode) and not node.flow_style:
        lines = text[:end].splitlines(keepends=True)
        while not lines[-1].strip() or lines[-1].lstrip().startswith("#"):
            lines.pop()
        return len("".join(lines))
    return text.find("\n", end) + 1 or len(text)


def _block(name: str, settings: Mapping[str, Any], indent: str) -> str:
    lines = [f"{indent}  {key}: {_flow(value)}\n" for key, value in settings.items()]
    return f"{indent}{name}:\n{''.join(lines)}"


def _flow(value: Any) -> str:
    """Return a value as YAML in one line."""
    text = yaml.safe_dump(value, default_flow_style=True, width=math.inf, sort_keys=False)
    return text.removesuffix("\n").removesuffix("\n...")
