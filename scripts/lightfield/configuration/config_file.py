"""The top-level configuration, config.yaml: which scenes to build, at which quality, and where."""

import os
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, TypeAdapter, model_validator

from lightfield.core.errors import UserError
from lightfield.core.names import ROOT
from lightfield.settings.base import Name, Settings, checked_yaml, pattern
from lightfield.settings.types import AtLeastOne, Auto, DenoisePrefilter, Folder, unique_names

_FILE = "config.yaml"
# Folders of the project, of a user's inputs, and of programs such as Snakemake.
_RESERVED = {
    ".ci",
    ".snakemake",
    ".venv",
    "benchmarks",
    "captions",
    "configs",
    "docs",
    "envs",
    "profiles",
    "rules",
    "scripts",
    "tests",
}
# Names that a scene's folder cannot have, because other folders beside it have them.
_SCENE_NEIGHBOURS = {"benchmarks", "logs", "receipts", "removed", "settings", "tables"}


def _listed(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


# A single word on the command line is a list of one name.
def _place(value: str) -> str:
    """Refuse a storage that jobs in other folders could not find."""
    if value and "://" not in value and not Path(value).is_absolute():
        raise ValueError("must be a URL, or a path from /")
    return value


Names = Annotated[
    list[Name],
    BeforeValidator(_listed),
    AfterValidator(unique_names),
]


class Preset(Settings):
    """A preset limits the values of scene YAMLs. A key that is left out limits nothing."""

    resolution: AtLeastOne | None = Field(
        None,
        description="Largest length of an image's longer side. Larger images are made smaller.",
        json_schema_extra={"unit": "pixels"},
    )
    samples: AtLeastOne | None = Field(
        None,
        description="Largest number of paths for each pixel.",
        json_schema_extra={"unit": "paths"},
    )
    views: AtLeastOne | None = Field(
        None,
        description="Largest number of views of a rig. Rigs with more are thinned.",
        json_schema_extra={"unit": "views"},
    )
    denoise: bool | None = Field(
        None, description="Whether to denoise the views even if the scene YAML does not."
    )
    denoise_prefilter: DenoisePrefilter | None = Field(
        None, description="Prefilter of the denoiser, unless the scene YAML names one."
    )


class Energy(Settings):
    """The power from which report/costs.json computes energy."""

    watts: float = Field(
        65,
        ge=0,
        le=1e6,
        description="Power of the machine when all its cores work.",
        json_schema_extra={"unit": "W"},
    )
    cores: Auto | AtLeastOne = Field(
        "auto",
        description="Number of cores of that machine. auto: as many as the machine that computes "
        "the costs has.",
        json_schema_extra={"unit": "cores"},
    )

    @property
    def core_count(self) -> int:
        """The number of cores. auto means all cores of this machine."""
        return os.cpu_count() or 1 if self.cores == "auto" else self.cores


class Configuration(Settings):
    """Which scenes to build, at which quality, and into which folders."""

    scenes: Names = Field(
        description="Scenes to build: names of files in configs/scenes/, without .yaml. A single "
        "name needs no list."
    )
    rigs: Literal["all"] | Names = Field(
        "all", description="Rigs to build, by their names in the scene YAMLs. all: every rig."
    )
    preset: str = Field(description="Name of the preset to apply: one of those in presets.")
    presets: dict[
        Annotated[
            str,
            Field(
                pattern=pattern(
                    "^[a-z][a-z0-9]*$", "a name of small letters and digits with a letter first"
                ),
                max_length=30,
            ),
        ],
        Preset,
    ] = Field(
        min_length=1,
        description="Presets by their names. Each sets upper limits for values of the scene YAMLs.",
    )
    results: Folder = Field("results", description="Folder in which the datasets are built.")
    work: Folder = Field(
        "work",
        description="Folder for intermediate files: scenes, lens maps, records and timings.",
    )
    device: Literal["auto", "cpu", "optix", "cuda", "hip", "oneapi", "metal"] = Field(
        "auto",
        description="Device on which Cycles renders. auto: a GPU if there is one, else the CPU.",
    )
    views_per_shard: Auto | AtLeastOne = Field(
        "auto",
        description="How many views one render job makes. auto: chosen from the expected time of a "
        "view, and on a cluster also from cluster_jobs. A dataset that "
        "was begun with auto keeps its jobs.",
        json_schema_extra={"unit": "views"},
    )
    storage: Annotated[str, AfterValidator(_place)] = Field(
        "",
        description="URL, or path from /, of the storage for machines without a common folder. "
        "Empty: all jobs see results and work.",
    )
    cluster_jobs: AtLeastOne | None = Field(
        None,
        description="How many jobs a cluster runs at once, as --jobs says. Profiles of clusters "
        "set it. Without this key, this machine renders.",
        json_schema_extra={"unit": "jobs"},
    )
    partition_minutes: AtLeastOne | None = Field(
        None,
        description="Longest run time of a job that the cluster's partition allows. Shards get so "
        "few views that no job requests more. Without this key, nothing limits it.",
        json_schema_extra={"unit": "min"},
    )
    package_gigabytes: Annotated[float, Field(gt=0)] | None = Field(
        None,
        description="Largest size of a package's parts. Without this key, a package is one file.",
        json_schema_extra={"unit": "GB"},
    )
    energy: Energy = Field(
        Energy(),
        description="Power of the machine, from which the energy of a dataset is computed.",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.preset not in self.presets:
            names = ", ".join(self.presets)
            raise ValueError(f"preset: is {self.preset!r}; must be one of {names}")
        for name in self.scenes:
            if "." in name or name in _SCENE_NEIGHBOURS:
                used_names = ", ".join(sorted(_SCENE_NEIGHBOURS))
                raise ValueError(
                    f"scenes: {name} cannot be the name of a scene; must have no dots, and not be "
                    f"one of {used_names}"
                )
        for key in ("results", "work"):
            _check_folder(key, getattr(self, key))
        results = Path(self.results).resolve()
        work = Path(self.work).resolve()
        if results == work or results in work.parents or work in results.parents:
            raise ValueError(
                f"work: is {self.work!r}, and results is {self.results!r}; "
                "must be two folders, neither in the other"
            )
        return self


def _check_folder(key: str, folder: str) -> None:
    """Refuse a folder of the project, of the user's inputs, or of Git."""
    path = Path(os.path.normpath(Path(folder).absolute()))
    parents = [Path.cwd(), *Path.cwd().parents, ROOT, *ROOT.parents]
    reserved = {home / name for home in (Path.cwd(), ROOT) for name in _RESERVED}
    is_inside = not reserved.isdisjoint([path, *path.parents]) or ".git" in path.parts
    if path in parents or path.resolve() in parents or is_inside:
        raise ValueError(f"{key}: is {folder!r}; must be a folder that is used for nothing else")
    if path.exists() and not path.is_dir():
        raise ValueError(f"{key}: is {folder!r}, which is a file; must be a folder")


_CONFIGURATION = TypeAdapter(Configuration)


def load_config(content: Any) -> Configuration:
    """Return the top-level configuration. Raises `UserError`."""
    return checked_yaml(_CONFIGURATION, content, f"{_FILE}: {{}}".format)


def with_lines(message: str, files_of: Callable[[str], Sequence[Path | str]]) -> str:
    """Return the message of an error with the place of each key that it names in a config.yaml.

    ``files_of`` returns where a key at the top may stand, the place that counts first: files, and
    texts for places without lines. Without any, the message keeps ``config.yaml``.
    """

    def with_line(message_line: str) -> str:
        problem = message_line.removeprefix(f"{_FILE}: ")
        if problem == message_line:
            return message_line
        return _located(problem, files_of(re.split("[.:]", problem)[0])) or message_line

    return "\n".join(map(with_line, message.splitlines()))


def _located(problem: str, places: Iterable[Path | str]) -> str | None:
    """Return a problem after the place that has most of the keys with which it begins. Or None."""
    from lightfield.settings.yaml_files import find_key, read_settings_text

    most_keys, located = 0, None
    for place in places:
        if isinstance(place, str):
            return f"{place}: {problem}"
        name = _shown(place)
        depth, line = find_key(problem, read_settings_text(place, name))
        if depth > most_keys:
            most_keys, located = depth, f"{name}:{line}: {problem}"
    return located


def _shown(path: Path) -> str:
    """Return the path of a config.yaml for messages."""
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


def read_config(path: Path) -> dict[str, Any]:
    """Read a config.yaml. Raises `UserError` if it is not a mapping. Does not check its keys."""
    # Import it only here: stages import this module for its settings, and their --help needs no
    # YAML.
    from lightfield.settings.yaml_files import read_yaml

    content = read_yaml(path, _shown(path))
    if not isinstance(content, dict):
        raise UserError(f"{_shown(path)}: must be a mapping of keys to values")
    return content
