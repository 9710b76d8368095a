"""What a finished dataset says of itself: its settings and its inputs, by keys for readers.

The lightfield.json files and the lists of exports have most of them, also in a copy. The receipts
of the jobs have more. They are found only where the dataset was built: in the folder ``work``
beside the folder of all datasets.
"""

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.core.names import MESH, VIDEO
from lightfield.engine import receipts
from lightfield.exporters import BESIDE_VIEWS, list_path
from lightfield.formats.export_lists import MANIFEST
from lightfield.formats.layout import FRAME_FOLDERS, IMAGES
from lightfield.formats.lightfield import MACHINE, NAME, LightField, View
from lightfield.imaging import images

_WORK = "work"
_FRAME = re.compile(r"f\d{5,7}")
# Keys of lightfield.json that have a form of their own below.
_OTHER_FORMS = {
    *("camera", "resolution", "sensor_size", "scene", "frame", "render", "reprojection"),
    MACHINE,
}


@dataclass(frozen=True)
class DatasetFacts:
    """What a dataset says of itself.

    ``lightfields`` are its lightfield.json files, by their folders in it. ``settings`` have the
    keys of a scene YAML. ``of_receipts`` are further settings and inputs from receipts, None
    without receipts.
    """

    folder: Path
    lightfields: Mapping[str, LightField]
    settings: Mapping[str, Any]
    inputs: Mapping[str, Any]
    of_receipts: "ReceiptFacts | None"


@dataclass(frozen=True)
class ReceiptFacts:
    """What only receipts say: keys of the rig, versions of stages, and sums of the user's files."""

    rig: Mapping[str, Any] = field(default_factory=dict)
    inputs: Mapping[str, Any] = field(default_factory=dict)


def read(folder: Path) -> DatasetFacts:
    """Return what a dataset says of itself. Raises `UserError` for a folder that is no dataset."""
    if not folder.is_dir():
        hint = "; unpack a package first" if folder.suffix == ".tar" else ""
        raise UserError(f"{folder}: is no folder; must be the folder of a dataset{hint}")
    is_sequence = not (folder / NAME).is_file()
    parts = sorted(folder.glob(FRAME_FOLDERS)) if is_sequence else [folder]
    lightfields = {
        path.parent.relative_to(folder).as_posix().removeprefix("."): LightField.read(path)
        for part in parts
        for path in (*part.glob(NAME), *sorted(part.glob(f"*/{NAME}")))
    }
    if not lightfields:
        datasets = [path.parent.name for path in sorted(folder.glob(f"*/{NAME}"))]
        hint = f", such as {datasets[0]} in it" if datasets else ""
        raise UserError(f"{folder}: has no {NAME}; must be the folder of a dataset{hint}")
    settings = _merged(
        [_settings(reprojection_of(place), lightfield) for place, lightfield in lightfields.items()]
        + [_of_export(name, path) for name, path in _lists(folder)]
    )
    inputs = _merged([*map(_inputs, lightfields.values()), *_versions(folder, lightfields)])
    return DatasetFacts(folder, lightfields, settings, inputs, _of_receipts(folder, lightfields))


def reprojection_of(place: str) -> str:
    """Return the reprojection whose lightfield.json lies in a folder of a dataset. "" for views."""
    name = place.rpartition("/")[2]
    return "" if _FRAME.fullmatch(name) else name


def in_frame(name: str) -> str:
    """Return the path of a dataset's file in the folder of its frame. Without one, the path."""
    folder, _, inner_path = name.partition("/")
    return inner_path if _FRAME.fullmatch(folder) else name


def _settings(reprojection: str, lightfield: LightField) -> dict[str, Any]:
    """Return the settings in a lightfield.json."""
    content = lightfield.content
    prefix = f"reprojections.{reprojection}." if reprojection else ""
    settings = _flat(f"{prefix}camera", lightfield.lens.settings())
    if reprojection:
        return settings | _flat(prefix[:-1], content.get("reprojection", {}))
    scene = dict(content.get("scene", {}))
    scene.pop("fingerprint", None)
    if "frame" in content:
        scene["frame"] = content["frame"]
    others = {key: value for key, value in content.items() if key not in _OTHER_FORMS}
    return (
        _flat("scene", scene)
        | settings
        | _flat("render", content.get("render", {}))
        | _flat("", others)
    )


def _inputs(lightfield: LightField) -> dict[str, Any]:
    """Return the inputs that a lightfield.json names."""
    scene = lightfield.content.get("scene", {})
    inputs = {"fingerprint of the scene": scene.get("fingerprint")}
    inputs["machine"] = lightfield.content.get(MACHINE)
    return {key: value for key, value in inputs.items() if value is not None}


def _versions(folder: Path, lightfields: Mapping[str, LightField]) -> Iterator[dict[str, Any]]:
    """Yield the versions of bpy, and the machines, that the views' headers name."""
    for place, lightfield in lightfields.items():
        for view in () if reprojection_of(place) else lightfield.views:
            path = folder / place / IMAGES / f"{view.name}.exr"
            # The comparison of files reports what is missing or damaged.
            with suppress(UserError):
                attributes = images.read_header(path).attributes
                names = {"bpy": images.BPY_ATTRIBUTE, "machine": images.MACHINE_ATTRIBUTE}
                yield {key: attributes[name] for key, name in names.items() if name in attributes}


def _lists(folder: Path) -> Iterator[tuple[str | None, Path]]:
    """Yield the lists of all exports, each with its format. None for a list that names it."""
    yield from ((None, path) for path in sorted(folder.rglob(MANIFEST)))
    for name in BESIDE_VIEWS:
        yield from ((name, path) for path in sorted(folder.rglob(list_path(name))))


def _of_export(name: str | None, path: Path) -> dict[str, Any]:
    """Return the options of an export, from its list."""
    content = read_json(path)
    if not isinstance(content, dict) or "options" not in content:
        return {}
    name = name or content["format"]
    prefix = name if name in (MESH, VIDEO) else f"exports.{name}"
    return {prefix: "made"} | _flat(prefix, content["options"])


def _of_receipts(folder: Path, lightfields: Mapping[str, LightField]) -> ReceiptFacts | None:
    """Return what the receipts of a dataset's jobs say. None if there are none."""
    found = _receipt_folder(folder)
    if not found:
        return None
    receipt_folder, results = found
    scene = next(iter(lightfields.values())).content.get("scene", {}).get("name", "")
    of_scene = receipt_folder.parents[len(folder.absolute().relative_to(results).parts) - 1] / scene
    rig: list[dict[str, Any]] = []
    inputs: list[dict[str, Any]] = []
    for path in [*sorted(receipt_folder.rglob("*.jsonl")), *sorted(of_scene.glob("*.jsonl"))]:
        receipt = receipts.read(path)
        if receipt is None:
            continue
        if "rig" in receipt.settings and path.name == "lightfield.jsonl":
            keys = {key: value for key, value in receipt.settings["rig"].items() if key != "camera"}
            rig.append(_flat("rig", keys))
        inputs.append({f"version of {receipt.stage}": receipt.version})
        inputs.append(
            {
                name: digest
                for name, digest in receipt.inputs.items()
                if not name.startswith((f"{results.name}/", f"{_WORK}/"))
            }
        )
    return ReceiptFacts(_merged(rig), _merged(inputs))


def _receipt_folder(folder: Path) -> tuple[Path, Path] | None:
    """Return the folder of a dataset's receipts, and the folder of all datasets. None without."""
    folder = folder.absolute()
    for results in folder.parents[1:4]:
        receipt_folder = results.parent / _WORK / receipts.FOLDER / folder.relative_to(results)
        if receipt_folder.is_dir():
            return receipt_folder, results
    return None


def _flat(prefix: str, value: Any) -> dict[str, Any]:
    """Return the values of nested mappings by their keys with dots."""
    if not isinstance(value, Mapping):
        return {prefix: value}
    return {
        key: nested_value
        for name, nested in value.items()
        for key, nested_value in _flat(f"{prefix}.{name}".removeprefix("."), nested).items()
    }


def _merged(parts: list[dict[str, Any]]) -> dict[str, Any]:
    """Return all keys of all parts. A key with several values has a `Several`."""
    values: dict[str, list[Any]] = {}
    for part in parts:
        for key, value in part.items():
            if value not in values.setdefault(key, []):
                values[key].append(value)
    return {key: value[0] if len(value) == 1 else Several(value) for key, value in values.items()}


class Several(list[Any]):
    """The values of a key that differ between the parts of a dataset, such as its frames."""


def shortened(value: Any) -> str:
    """Return a value as a short text."""
    if isinstance(value, Several):
        return f"{shortened(value[0])} … {shortened(value[-1])}"
    text = str(value)
    if re.fullmatch("[0-9a-f]{64}", text):
        return f"{text[:12]}…"
    return text if len(text) <= 60 else f"{text[:59]}…"


def changed_poses(a: LightField, b: LightField) -> dict[str, tuple[float, float]]:
    """Return how far each view is moved, in metres and degrees, by the names of moved views."""
    of_b = {view.name: view for view in b.views}
    moved = {}
    for view in a.views:
        other = of_b.get(view.name)
        if other and not np.array_equal(view.world_from_camera, other.world_from_camera):
            moved[view.name] = _movement(view, other)
    return moved


def _movement(a: View, b: View) -> tuple[float, float]:
    distance = np.linalg.norm(b.world_from_camera[:3, 3] - a.world_from_camera[:3, 3])
    # The length of the chord between unit vectors gives small angles exactly.
    chords = np.linalg.norm(b.world_from_camera[:3, :3] - a.world_from_camera[:3, :3])
    angle = 2 * np.arcsin(min(chords / np.sqrt(8), 1))
    return float(distance), float(np.degrees(angle))
