"""The scene YAML and the top-level configuration: read, checked, and resolved into datasets.

The two JSON schemas in configs/schema/ hold what each key may be and its default; what they cannot
say (which key goes with which) is checked here. Nothing else in the project reads a scene YAML.
"""

import copy
import difflib
import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import yaml

from lightfield import rigs
from lightfield.errors import UserError
from lightfield.files import read_json

ROOT = Path(__file__).resolve().parents[2]
SCENES = ROOT / "configs" / "scenes"
BUILDERS = ROOT / "scripts" / "scenes"
SCHEMAS = ROOT / "configs" / "schema"

# Folders of a dataset that a reprojection may not take.
RESERVED_NAMES = ("exr", "report")
# Folders of a sequence's frames.
FRAME_FOLDER = re.compile(r"f\d{5,7}")
# In `exports: … sources:`, the rendered views themselves.
VIEWS = "views"


@dataclass(frozen=True)
class Dataset:
    """One scene seen by one rig, with every default filled in and the preset applied.

    ``scene`` names the folder in the results: the scene YAML's name, followed by the preset's
    unless that is ``full``, so that presets never overwrite each other. ``rig`` names the folder
    in it: the rig's name, followed in a sequence by the frame's folder, as in LFSphere/f00001.
    """

    name: str
    scene: str
    rig: str
    source: Mapping[str, Any]
    render: Mapping[str, Any]
    cameras: Mapping[str, Any]
    reprojections: Mapping[str, Mapping[str, Any]]
    exports: Mapping[str, Mapping[str, Any]]

    @property
    def rig_name(self) -> str:
        """The rig's name in the scene YAML."""
        return self.rig.partition("/")[0]

    @property
    def view_count(self) -> int:
        """Number of views of the rig."""
        return rigs.view_count(self.cameras)

    @property
    def depth(self) -> str | None:
        """What channel Z of the rendered views means: ``z``, ``distance``, or None for no depth."""
        return depth_meaning(self.render["depth"], self.cameras["camera"])


def depth_meaning(wanted: str, camera: Mapping[str, Any]) -> str | None:
    """Resolve ``render.depth``: Z-depth is unusable for lenses that see beyond 180 degrees."""
    if wanted == "none":
        return None
    if wanted == "auto":
        return "distance" if _sees_behind(camera) else "z"
    return wanted


def load_config(content: Mapping[str, Any], file: str = "config.yaml") -> dict[str, Any]:
    """Check the top-level configuration and fill in its defaults; raises `UserError`."""
    config = _validated(content, "config", file)
    if config["preset"] not in config["presets"]:
        known = ", ".join(config["presets"])
        raise UserError(f"{file}: preset: is {config['preset']!r}; must be one of {known}")
    for key in ("results", "work"):
        if Path(config[key]).resolve() in (ROOT, *ROOT.parents):
            raise UserError(f"{file}: {key}: is {config[key]!r}; must be a folder of its own")
    return config


def load_datasets(config: Mapping[str, Any]) -> list[Dataset]:
    """Read the scene YAMLs that a checked configuration chooses and resolve their datasets.

    Raises `UserError` for a scene that is not there, not right, or without the rigs asked for.
    """
    found: list[Dataset] = []
    for scene in config["scenes"]:
        found += scene_datasets(scene, config["preset"], config["presets"][config["preset"]])
        _check_presence(scene, found[-1].source)
    if config["rigs"] == "all":
        return found
    known = {dataset.rig_name for dataset in found}
    for rig in config["rigs"]:
        if rig not in known:
            raise UserError(
                f"config.yaml: rigs: {rig!r} is in none of the scenes {', '.join(config['scenes'])}"
                f"; must be all or some of {', '.join(sorted(known))}"
            )
    for scene in config["scenes"]:
        # A sequence has a dataset for each frame.
        own = dict.fromkeys(dataset.rig_name for dataset in found if dataset.name == scene)
        if not own.keys() & set(config["rigs"]):
            raise UserError(
                f"config.yaml: rigs: none of {', '.join(config['rigs'])} is in {scene}; "
                f"it has {', '.join(own)}; all takes them all"
            )
    return [dataset for dataset in found if dataset.rig_name in config["rigs"]]


def scene_datasets(scene: str, preset: str, limits: Mapping[str, Any]) -> list[Dataset]:
    """Resolve every dataset of one scene YAML under a preset's upper ``limits``."""
    settings = load_scene(scene)
    label = scene if preset == "full" else f"{scene}_{preset}"
    source = settings["scene"]
    if "blend" in source:
        checksum = blend_sha256(scene)[0]
        source = {**source, **({"sha256": checksum} if checksum else {})}
    render = _limited_render(settings["render"], limits)
    found = []
    for name, rig in settings["rigs"].items():
        cameras = rigs.thin(_located(rig), limits["views"]) if "views" in limits else _located(rig)
        cameras = {**cameras, "camera": _limited(rig["camera"], limits)}
        reprojections = {
            key: {**reprojection, "camera": _limited(reprojection["camera"], limits)}
            for key, reprojection in settings["reprojections"].items()
            if name in reprojection.get("rigs", settings["rigs"])
        }
        exports = {}
        for key, export in settings["exports"].items():
            sources = [s for s in export["sources"] if s == VIEWS or s in reprojections]
            exports[key] = {**export, "sources": sources}
        for folder, frame in _frames(name, rig, source):
            found.append(
                Dataset(
                    name=scene,
                    scene=label,
                    rig=folder,
                    source={**source, "frame": frame},
                    render=render,
                    cameras=cameras,
                    reprojections=reprojections,
                    exports=exports,
                )
            )
    return found


def blend_sha256(scene: str) -> tuple[str | None, Path]:
    """Return the SHA-256 that a scene's .blend must have, or None if no one knows it yet.

    The second value is the file that says so, or that shall: the scene YAML or its lock file.
    """
    source = load_scene(scene)["scene"]
    if "sha256" in source:
        return source["sha256"], SCENES / f"{scene}.yaml"
    lock = SCENES / f"{scene}.lock.json"
    return (str(read_json(lock)["sha256"]) if lock.exists() else None), lock


def _check_presence(scene: str, source: Mapping[str, Any]) -> None:
    """Check that the user's .blend is where the scene YAML says, or can be downloaded."""
    if "blend" in source and "url" not in source and not (ROOT / source["blend"]).is_file():
        page = f"get it from {source['page']} and " if "page" in source else ""
        raise UserError(
            f"configs/scenes/{scene}.yaml: scene.blend: there is no file {source['blend']}; "
            f"{page}put it there"
        )


def _frames(
    name: str, rig: Mapping[str, Any], source: Mapping[str, Any]
) -> Iterator[tuple[str, int]]:
    """Yield the folder and the frame number of each dataset of a rig."""
    if "frames" not in rig:
        yield name, source["frame"]
        return
    frames = rig["frames"]
    for frame in range(frames["first"], frames["last"] + 1, frames["step"]):
        yield f"{name}/f{frame:05d}", frame


def load_scene(scene: str) -> dict[str, Any]:
    """Read and check one scene YAML; raises `UserError` with file, key, value and what is right."""
    path = SCENES / f"{scene}.yaml"
    if not path.is_file():
        known = ", ".join(sorted(file.stem for file in SCENES.glob("*.yaml")))
        raise UserError(f"config.yaml: scenes: there is no scene {scene!r}; there are {known}")
    return read_scene(path)


def read_scene(path: Path) -> dict[str, Any]:
    """Read and check the scene YAML at ``path``, as `load_scene` does by name."""
    file = str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else str(path)
    content = read_yaml(path, file)
    settings = _validated(content, "scene", file)

    def fail(key: str, problem: str) -> None:
        raise UserError(f"{file}: {key}: {problem}")

    _check_source(settings["scene"], fail)
    _check_render(content["render"], fail)
    for name, rig in settings["rigs"].items():
        _check_rig(f"rigs.{name}", rig, settings["render"]["depth"], fail)
    for name, reprojection in settings["reprojections"].items():
        key = f"reprojections.{name}"
        if name in RESERVED_NAMES or FRAME_FOLDER.fullmatch(name):
            fail(key, f"the name {name} is taken; choose another")
        _check_camera(f"{key}.camera", reprojection["camera"], fail)
        for rig in reprojection.get("rigs", []):
            if rig not in settings["rigs"]:
                fail(f"{key}.rigs", f"there is no rig {rig!r}{_suggestion(rig, settings['rigs'])}")
    for name, export in settings["exports"].items():
        known = [VIEWS, *settings["reprojections"]]
        for source in export["sources"]:
            if source not in known:
                fail(f"exports.{name}.sources", f"is {source!r}; must be of {', '.join(known)}")
    return settings


# What each kind of rig is placed by, beside the keys that all of them have.
_RIG_KEYS: dict[str, dict[str, int | None]] = {
    "plane": {"cameras": 2},
    "cylinder": {"cameras": 2},
    "cuboid": {"cameras": 3},
    "lattice": {"cameras": 3},
    "sphere": {"subdivisions": None},
    "poses": {"file": None},
}

# What each lens needs and may have, beside resolution and principal_point; fov's upper limit in
# degrees, where the mapping of DESIGN's table has one.
_LENS_NEEDS: dict[str, tuple[set[str], set[str], float]] = {
    "equidistant": ({"fov"}, {"sensor_size"}, 360),
    "equisolid": ({"fov", "focal_length"}, {"sensor_size"}, 360),
    "stereographic": ({"fov"}, {"sensor_size"}, 359.9),
    "orthographic": ({"fov"}, {"sensor_size"}, 180),
    "polynomial": ({"coefficients", "fov"}, {"sensor_size"}, 360),
    "kannala_brandt": ({"coefficients", "focal_length"}, {"sensor_size", "fov"}, 360),
    "equirectangular": (set(), {"longitude", "latitude"}, 0),
}

# Lenses that Cycles has; any other is reached by reprojection.
_RENDERED = ("rectilinear", "equidistant", "equisolid", "polynomial", "equirectangular")

_Fail = Callable[[str, str], None]


def _check_source(source: Mapping[str, Any], fail: _Fail) -> None:
    if ("builder" in source) == ("blend" in source):
        fail("scene", "must have one of builder and blend")
    if "builder" in source:
        known = builders()
        if source["builder"] not in known:
            fail("scene.builder", f"is {source['builder']!r}; must be one of {', '.join(known)}")
        for name in ("sha256", "url", "page"):
            if name in source:
                fail(f"scene.{name}", "goes with blend, not with builder")


# What a calibration chooses for a target error.
_CHOSEN = ("samples", "adaptive_threshold", "denoise")


def _check_render(render: Mapping[str, Any], fail: _Fail) -> None:
    """Check a ``render`` block as it was written, before any default is filled in."""
    if "target_error" in render:
        for name in _CHOSEN:
            if name in render:
                fail(f"render.{name}", "goes without target_error, for which it is chosen")
    elif "samples" not in render:
        fail("render", "is missing the key samples (or target_error)")


def _check_rig(key: str, rig: Mapping[str, Any], depth: str, fail: _Fail) -> None:
    wanted = _RIG_KEYS[rig["type"]]
    for name in ("cameras", "subdivisions", "file"):
        if name in wanted and name not in rig:
            fail(key, f"is missing the key {name}, which a rig of type {rig['type']} needs")
        if name in rig and name not in wanted:
            fail(f"{key}.{name}", f"does not go with a rig of type {rig['type']}")
    count = wanted.get("cameras")
    if count and len(rig["cameras"]) != count:
        fail(
            f"{key}.cameras",
            f"is {rig['cameras']}; must be {count} whole numbers for a rig of type {rig['type']}",
        )
    if "frames" in rig and rig["frames"]["first"] > rig["frames"]["last"]:
        fail(f"{key}.frames", f"first is {rig['frames']['first']}; must be at most last")
    if rig["type"] == "poses" and not (ROOT / rig["file"]).is_file():
        fail(f"{key}.file", f"is {rig['file']!r}; there is no such file")
    camera = rig["camera"]
    _check_camera(f"{key}.camera", camera, fail)
    if camera["lens"] not in _RENDERED:
        fail(
            f"{key}.camera.lens",
            f"is {camera['lens']!r}, which Cycles does not have; must be one of "
            f"{', '.join(_RENDERED)} (reproject for the others)",
        )
    if depth == "z" and _sees_behind(camera):
        fail(
            "render.depth",
            f"is 'z', but {key}.camera sees beyond 180 degrees; must be auto, distance or none",
        )
    if rig["cube_map"] and (camera["lens"], camera.get("fov")) != ("rectilinear", 90):
        fail(f"{key}.camera", "must be rectilinear with fov 90 for a rig with cube_map")
    if rig["cube_map"] and camera["resolution"][0] != camera["resolution"][1]:
        fail(
            f"{key}.camera.resolution",
            f"is {camera['resolution']}; must be square for a rig with cube_map",
        )


def _check_camera(key: str, camera: Mapping[str, Any], fail: _Fail) -> None:
    lens = camera["lens"]
    given = camera.keys() - {"lens", "resolution", "principal_point"}
    if lens == "rectilinear":
        # Either the field of view, or focal length and sensor.
        fov, focal = {"fov"}, {"focal_length"}
        needs, may, limit = (fov, set(), 180.0) if "fov" in given else (focal, {"sensor_size"}, 180)
    else:
        needs, may, limit = _LENS_NEEDS[lens]
    for name in sorted(needs - given):
        other = " (or fov)" if lens == "rectilinear" else ""
        fail(key, f"is missing the key {name}{other}, which the {lens} lens needs")
    for name in sorted(given - needs - may):
        beside = " beside fov" if lens == "rectilinear" and "fov" in given else ""
        fail(f"{key}.{name}", f"does not go with the {lens} lens{beside}")
    fov = camera.get("fov", 0)
    if fov > limit or (lens == "rectilinear" and fov == limit):
        bound = "below" if lens == "rectilinear" else "at most"
        fail(f"{key}.fov", f"is {fov}; must be {bound} {limit:g} degrees for the {lens} lens")
    if lens == "equirectangular" and "principal_point" in camera:
        fail(f"{key}.principal_point", "does not go with the equirectangular lens; use its ranges")
    for name in ("longitude", "latitude"):
        if name in camera and camera[name][0] >= camera[name][1]:
            fail(f"{key}.{name}", f"is {camera[name]}; the smaller value must come first")


def builders() -> list[str]:
    """Names of the scene builders, the folders of scripts/scenes/ that are not their library."""
    folders = (file.parent.name for file in BUILDERS.glob("*/__init__.py"))
    return sorted(name for name in folders if name != "library")


def _sees_behind(camera: Mapping[str, Any]) -> bool:
    return bool(camera["lens"] == "equirectangular" or camera.get("fov", 0) > 180)


def _located(rig: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the rig with the path of its poses made independent of the current folder."""
    return {**rig, "file": str(ROOT / rig["file"])} if "file" in rig else rig


def _limited_render(render: Mapping[str, Any], limits: Mapping[str, Any]) -> dict[str, Any]:
    """Return the ``render`` block under a preset's ``limits``.

    With a ``target_error``, samples, threshold and denoising are not known before the calibration;
    what the preset says of them limits its choice: at most ``most_samples``, and ``denoise``.
    """
    if "target_error" not in render:
        samples = min(render["samples"], limits.get("samples", render["samples"]))
        return {**render, "samples": samples, "denoise": limits.get("denoise", render["denoise"])}
    kept = {key: render[key] for key in render if key not in _CHOSEN}
    if "samples" in limits:
        kept["most_samples"] = limits["samples"]
    if "denoise" in limits:
        kept["denoise"] = limits["denoise"]
    return kept


def _limited(camera: Mapping[str, Any], limits: Mapping[str, Any]) -> dict[str, Any]:
    """Return the camera with its image's longer side at most ``limits["resolution"]`` pixels."""
    width, height = camera["resolution"]
    scale = min(1.0, limits.get("resolution", max(width, height)) / max(width, height))
    limited = {
        **camera,
        "resolution": [max(1, round(width * scale)), max(1, round(height * scale))],
    }
    if "principal_point" in camera:
        limited["principal_point"] = [value * scale for value in camera["principal_point"]]
    return limited


class _UniqueKeyLoader(yaml.SafeLoader):
    """Safe YAML in which a key given twice is an error, not a silent overwrite."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[Any] = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, str):
                problem = f"the key {key!r} is not a text; put it in quotes"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key_node.start_mark)
            if key in seen:
                problem = f"the key {key!r} is given twice"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep)


def read_yaml(path: Path, file: str) -> Any:
    try:
        return yaml.load(path.read_text(encoding="utf-8"), Loader=_UniqueKeyLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        raise UserError(f"{file}: {where}{error.problem}") from None
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise UserError(f"{file}: cannot be read as YAML: {error}") from None


@cache
def _schema(name: str) -> dict[str, Any]:
    schema: dict[str, Any] = json.loads((SCHEMAS / f"{name}.schema.json").read_text("utf-8"))
    return schema


def _validated(content: Any, schema_name: str, file: str) -> dict[str, Any]:
    """Check ``content`` against a schema and return a copy with the schema's defaults filled in."""
    schema = _schema(schema_name)
    validator = jsonschema.Draft202012Validator(schema)
    errors = sorted(validator.iter_errors(content), key=lambda error: list(map(str, error.path)))
    if errors:
        raise UserError(f"{file}: {_describe(errors[0])}")
    filled: dict[str, Any] = copy.deepcopy(dict(content))
    _fill_defaults(filled, schema, schema)
    return filled


def _fill_defaults(content: Any, schema: Mapping[str, Any], root: Mapping[str, Any]) -> None:
    if not isinstance(content, dict):
        return
    for key, part in _resolved(schema, root).get("properties", {}).items():
        if "default" in part:
            content.setdefault(key, copy.deepcopy(part["default"]))
    for key, value in content.items():
        part = _resolved(schema, root)
        part = part.get("properties", {}).get(key, part.get("additionalProperties"))
        if isinstance(part, Mapping):
            _fill_defaults(value, part, root)


def _resolved(schema: Mapping[str, Any], root: Mapping[str, Any]) -> Mapping[str, Any]:
    if "$ref" in schema:
        definition: Mapping[str, Any] = root["$defs"][schema["$ref"].rsplit("/", 1)[-1]]
        return {**definition, **schema}
    return schema


def _describe(error: jsonschema.ValidationError) -> str:
    """Say in one line which key is wrong, its value, and what is allowed."""
    path = ".".join(_key_parts(error.absolute_path))
    prefix = f"{path}: " if path else ""
    schema: Any = error.schema
    value: Any = error.instance
    if error.validator == "required":
        missing = next(key for key in schema["required"] if key not in value)
        return f"{prefix}is missing the key {missing}"
    if error.validator == "additionalProperties":
        known = schema.get("properties", {})
        unknown = next(key for key in value if key not in known)
        full = f"{path}.{unknown}" if path else str(unknown)
        hint = _suggestion(str(unknown), known) or f"; allowed here: {', '.join(known)}"
        return f"{full}: unknown key{hint}"
    if "propertyNames" in map(str, error.absolute_schema_path):
        return (
            f"{prefix}{value!r} is no name; use letters, digits and . _ - , "
            "with a letter or digit first"
        )
    text = json.dumps(value, default=str)
    text = text if len(text) <= 60 else f"{text[:57]}..."
    return f"{prefix}is {text}; must be {_allowed(schema)}"


def _key_parts(path: Any) -> Iterator[str]:
    yield from (f"[{part}]" if isinstance(part, int) else str(part) for part in path)


def _allowed(schema: Mapping[str, Any]) -> str:
    """Say in words what a schema allows."""
    if "const" in schema:
        return str(schema["const"])
    if "enum" in schema:
        return "one of " + ", ".join(map(str, schema["enum"]))
    if "anyOf" in schema:
        return " or ".join(_allowed(part) for part in schema["anyOf"])
    kinds = {
        "integer": "a whole number",
        "number": "a number",
        "string": "a text",
        "boolean": "true or false",
        "object": "a mapping of keys to values",
    }
    kind = schema.get("type")
    if kind == "array":
        low, high = schema.get("minItems", 0), schema.get("maxItems")
        count = f"{low}" if low == high else f"{low} to {high}" if high else f"at least {low}"
        each = _allowed(schema["items"]) if "items" in schema else "values"
        return f"a list of {count} values, each {each}"
    if kind == "object" and schema.get("minProperties"):
        return "a mapping with at least one key"
    parts = [kinds[kind]] if kind in kinds else []
    bounds = {
        "minimum": "at least {}",
        "exclusiveMinimum": "above {}",
        "maximum": "at most {}",
        "exclusiveMaximum": "below {}",
        "pattern": "of the form {}",
    }
    parts += [text.format(schema[key]) for key, text in bounds.items() if key in schema]
    return " ".join(parts[:1]) + ("" if len(parts) < 2 else " " + " and ".join(parts[1:]))


def _suggestion(name: str, known: Any) -> str:
    close = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean {close[0]}?" if close else ""
