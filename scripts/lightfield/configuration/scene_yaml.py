"""Reads and checks scene YAMLs, as typed models, which say what each key may be.

scripts/schema.py makes the JSON schemas in configs/schema/ from the models of scene_blocks.py and
config_file.py. With the schemas, editors complete and check the files.
"""

import difflib
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

from pydantic import TypeAdapter, ValidationError, model_validator

from lightfield.configuration.family import Family, stand_in
from lightfield.configuration.heads import keys_as_written
from lightfield.configuration.misplaced_keys import with_place
from lightfield.configuration.scene_blocks import SceneBlocks
from lightfield.configuration.scene_checks import (
    exports,
    family,
    flow_and_mesh,
    reprojections,
    rigs,
    sensor,
    source,
    splits,
    video,
)
from lightfield.core.errors import UserError
from lightfield.core.names import ROOT
from lightfield.formats import published
from lightfield.settings.base import checked, checked_yaml
from lightfield.settings.yaml_files import (
    find_key,
    located,
    parse_yaml,
    read_settings_text,
    read_yaml,
)

SCENES = ROOT / "configs" / "scenes"
# The user's own scene YAMLs, relative to Snakemake's working folder.
OWN_SCENES = Path("configs", "scenes")

# In the order in which a user is told of mistakes.
_CHECKS = (
    source.check,
    rigs.check,
    source.check_render,
    flow_and_mesh.check_mesh,
    reprojections.check,
    sensor.check,
    exports.check,
    source.check_looks,
    flow_and_mesh.check,
    video.check,
    splits.check,
    family.check,
)


class Scene(SceneBlocks):
    """One scene: where it comes from, how its rigs render it, and what is made of the views."""

    @model_validator(mode="before")
    @classmethod
    def _rigs_of_dataset(cls, content: Any) -> Any:
        match content:
            case {"scene": {"dataset": str(dataset)}}:
                for key in ("render", "rigs"):
                    if key in content:
                        raise ValueError(f"{key}: does not go with scene.dataset, which brings it")
                try:
                    return {**content, "rigs": published.rigs(dataset)}
                except UserError as error:
                    raise ValueError(f"scene.dataset: {error}") from None
        return content

    @model_validator(mode="before")
    @classmethod
    def _developed_lights(cls, content: Any) -> Any:
        """Add a reprojection for each entry of relight, which develops the views in that light."""
        match content:
            case {"relight": dict(lights)}:
                reprojections = content.get("reprojections", {})
                if not isinstance(reprojections, dict):
                    return content
                for name in lights:
                    if name in reprojections:
                        raise ValueError(f"relight.{name}: is the name of a reprojection, too")
                relit = {name: {"relight": name, "format": "exr"} for name in lights}
                return {**content, "reprojections": {**reprojections, **relit}}
        return content

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for check in _CHECKS:
            check(self)
        return self


_SCENE = TypeAdapter(Scene)


def load_scene(scene: str) -> Scene:
    """Read and check one scene YAML. Raises `UserError` with file, key, value and what is right."""
    path = scene_path(scene)
    if not path.is_file():
        files = {*SCENES.glob("*.yaml"), *OWN_SCENES.glob("*.yaml")}
        scenes = sorted({file.stem for file in files})
        similar = " or ".join(difflib.get_close_matches(scene, scenes))
        hint = f"is {similar} meant?" if similar else f"there are {', '.join(scenes)}"
        raise UserError(f"config.yaml: scenes: there is no scene {scene!r}; {hint}")
    return read_scene(path)


def scene_path(scene: str) -> Path:
    """Return the path of a scene's YAML: the user's own, or else the repository's."""
    own_file = OWN_SCENES / f"{scene}.yaml"
    is_in_repository = OWN_SCENES.resolve() == ROOT / OWN_SCENES
    if own_file.is_file() and not is_in_repository:
        return own_file
    return SCENES / f"{scene}.yaml"


def family_of(scene: str) -> Family | None:
    """Return the block `family` of a scene YAML, if it has one. Raises `UserError`."""
    return load_scene(scene).family


def scene_content(scene: str) -> Any:
    """Return the content of a scene YAML as it is written. Raises `UserError`."""
    return read_yaml(scene_path(scene), f"{OWN_SCENES}/{scene}.yaml")


def check_member(content: Any, name: str) -> Scene:
    """Return the content of a member's scene YAML as settings. Errors begin with ``name``."""
    return checked(_SCENE, content, name)


def read_scene(path: Path) -> Scene:
    """Read and check the scene YAML at ``path``, as `load_scene` does by name."""
    file = _shown(path)
    return check_scene(read_settings_text(path, file), file)


def check_scene(text: str, file: str) -> Scene:
    """Return a scene YAML's text as settings. Raises `UserError`, which calls the YAML ``file``."""
    return _checked_scene(text, file, Path.cwd())


def mistake(scene: str, problem: str) -> UserError:
    """Return the error for a mistake in a scene YAML, with the line of the problem's key."""
    path = scene_path(scene)
    file = _shown(path)
    text = read_settings_text(path, file)
    problem = keys_as_written(problem, parse_yaml(text, file))
    return UserError(_located_in_family(problem, text, file))


def _shown(path: Path) -> str:
    """Return the path of a scene YAML for messages."""
    return str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else str(path)


# The rules ask for the same scenes many times.
@lru_cache(maxsize=100)
def _checked_scene(text: str, file: str, _folder: Path) -> Scene:
    """Return a scene YAML's text as settings. Its relative paths start from ``_folder``."""
    content = parse_yaml(text, file)
    is_family = False
    if isinstance(content, dict) and "family" in content:
        # The check below reports a block `family` that is wrong itself.
        with suppress(ValidationError, TypeError):
            content = stand_in(content)
            is_family = True
    locate = _located_in_family if is_family else located

    def located_key(problem: str) -> str:
        problem = keys_as_written(with_place(problem, Scene.model_fields), content)
        return locate(problem, text, file)

    return checked_yaml(_SCENE, content, located_key)


def _located_in_family(problem: str, text: str, file: str) -> str:
    """Return `located`. The line of a value that a family draws is in family.values."""
    depth, line = find_key(f"family.values.{problem}", text)
    return f"{file}:{line}: {problem}" if depth > 2 else located(problem, text, file)
