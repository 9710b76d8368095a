"""Families of scenes: one scene YAML stands for many, which differ by seed, model or values.

A member's name and values follow from the member's own seed or path alone. So they are the same on
every machine, and new members change none of the others.
"""

import copy
import glob
import hashlib
import itertools
import json
import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Self

from pydantic import Field, model_validator

from lightfield.configuration.corpus import CorpusOptions, evenly_spread
from lightfield.configuration.own_builder import is_own
from lightfield.core.errors import UserError
from lightfield.core.names import MODELS
from lightfield.settings.base import Settings, as_list, pattern

# Planning more members would take minutes.
_MOST_MEMBERS = 100_000
# The record of a member, in its folder.
RECORD = "member.json"
# The name of its receipt, without a suffix.
RECEIPT = "member"
FORMAT = "plenoforge member"

_Glob = Annotated[str, Field(min_length=1, max_length=1000)]
_Bounds = Annotated[tuple[float, float], as_list(2)]


class Draw(Settings):
    """How a value is drawn for each member."""

    uniform: _Bounds | None = Field(
        None, description="Draw a number between two bounds. All numbers are equally likely."
    )
    log_uniform: _Bounds | None = Field(
        None,
        description="Draw a number between two bounds above 0. Its logarithm is uniform, so 1 to "
        "10 is as likely as 10 to 100.",
    )
    integers: Annotated[tuple[int, int], as_list(2)] | None = Field(
        None,
        description="Draw a whole number from the first bound to the last. Both bounds are "
        "included.",
    )
    choice: list[Any] | None = Field(None, min_length=1, description="Draw one of these values.")

    @model_validator(mode="after")
    def _one_of_four(self) -> Self:
        if len(self.model_fields_set) != 1:
            raise ValueError("must have one of uniform, log_uniform, integers and choice")
        (key,) = self.model_fields_set
        bounds = self.uniform or self.log_uniform or self.integers
        if bounds and bounds[0] > bounds[1]:
            raise ValueError(f"{key}: is {list(bounds)}; must have the smaller bound first")
        if self.log_uniform and self.log_uniform[0] <= 0:
            raise ValueError(f"log_uniform: is {list(self.log_uniform)}; must be above 0")
        return self

    def value(self, part: float) -> Any:
        """Return the value at a ``part`` of the range, 0 to below 1."""
        if self.choice:
            return self.choice[int(part * len(self.choice))]
        if self.integers:
            first, last = self.integers
            return first + int(part * (last - first + 1))
        if self.uniform:
            low, high = self.uniform
            value = low + (high - low) * part
        else:
            assert self.log_uniform
            low, high = self.log_uniform
            value = low * (high / low) ** part
        # The last digits of a power differ between machines. Rounding may leave the bounds.
        return min(max(low, float(f"{value:.6g}")), high)


class Member(Settings):
    """A member of a family: its name, and its own seed or model."""

    name: str = Field(description="Name of the member's folder.")
    seed: int | None = Field(None, description="Seed that the builder gets for this member.")
    model: str | None = Field(None, description="Path of the member's model file.")


class Family(Settings):
    """Many scenes from one scene YAML, its members. Each member has datasets of its own."""

    seeds: str | None = Field(
        None,
        pattern=pattern(r"^\d{1,9}-\d{1,9}$", "the first and the last seed, such as 0-999"),
        description="First and last seed: each seed between them makes a member. The builder gets "
        "it as its seed, and also as its place, unless scene.parameters.place is given. Your own "
        "builder gets only the seed.",
    )
    models: _Glob | Annotated[list[_Glob], Field(min_length=1)] | None = Field(
        None,
        description="Model files, each of which makes a member: a path with * and **, such as "
        "models/**/*.glb, or a list of such paths. They are relative to the folder in which "
        "Snakemake runs. Leave out scene.model.",
    )
    values: dict[str, Draw] = Field(
        {},
        description="Other keys of the scene YAML that are drawn anew for each member, and how. "
        "Their names have dots, such as scene.parameters.detail.",
    )
    batch: Annotated[int, Field(ge=1, le=10_000)] = Field(
        32,
        description="About how many members one job builds at most.",
        json_schema_extra={"unit": "members"},
    )
    corpus: CorpusOptions = Field(
        CorpusOptions(),
        description="How the members form one corpus: its split into training, validation and "
        "test, and its shards.",
    )

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if (self.seeds is None) == (self.models is None):
            raise ValueError("must have one of seeds and models")
        key_of_member = "scene.parameters.seed" if self.seeds else "scene.model"
        for key in self.values:
            if not re.fullmatch(r"\w[\w-]*(\.\w[\w-]*)+", key) or key.startswith("family."):
                raise ValueError(f"values: {key!r} is not a key with dots, as scene.frame is")
            if key == key_of_member:
                raise ValueError(f"values: {key} cannot be drawn, because each member has its own")
        if self.seeds and len(self._seeds) > _MOST_MEMBERS:
            raise ValueError(f"seeds: is {self.seeds!r}; must be at most {_MOST_MEMBERS} seeds")
        if self.seeds and not self._seeds:
            raise ValueError(f"seeds: is {self.seeds!r}; must have the smaller seed first")
        return self

    @property
    def _seeds(self) -> range:
        assert self.seeds
        first, last = map(int, self.seeds.split("-"))
        return range(first, last + 1)

    @property
    def example_model(self) -> str:
        """The name of a model file that may match. Of several formats, OBJ takes the most keys."""
        suffixes = {Path(each).suffix.lower() for each in self._globs}
        suffix = suffixes.pop() if len(suffixes) == 1 else ""
        return f"model{suffix if suffix in MODELS else '.obj'}"

    @property
    def _globs(self) -> list[str]:
        assert self.models
        return [self.models] if isinstance(self.models, str) else self.models

    def members(self) -> list[Member]:
        """Return all members.

        Raises `UserError` if a path of models matches no file, if there are too many files, or if
        several paths match one file or make members of one name.
        """
        if self.seeds:
            return [Member.of(name=f"{seed:04d}", seed=seed) for seed in self._seeds]
        models = [*itertools.chain.from_iterable(map(_models, self._globs))]
        if len(models) > _MOST_MEMBERS:
            raise UserError(
                f"family.models: {self.models!r} has {len(models)} files; "
                f"must be at most {_MOST_MEMBERS}"
            )
        _check_once(models)
        return [Member.of(name=each.name, model=each.path) for each in models]

    def batches(self) -> dict[str, list[Member]]:
        """Return the members that each job builds, by the batch's name.

        A new seed changes one batch at most. New models change the batches that they belong to. The
        number of batches doubles only when the number of models has doubled.
        """
        batches: dict[str, list[Member]] = {}
        members = self.members()
        count = 2 ** max(0, math.ceil(math.log2(len(members) / self.batch)))
        for member in members:
            if member.seed is not None:
                first = member.seed // self.batch * self.batch
                name = f"seeds_{first:04d}_{first + self.batch - 1:04d}"
            else:
                number = int(hashlib.sha256(member.name.encode()).hexdigest()[:8], 16) % count
                name = f"models_{number:04d}_of_{count:04d}"
            batches.setdefault(name, []).append(member)
        return batches


def drawn(values: Mapping[str, Draw], member: Member) -> dict[str, Any]:
    """Return the drawn values of a member, by their keys with dots."""
    return {key: draw.value(_part(member.name, key)) for key, draw in values.items()}


def stand_in(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return a family's scene YAML with the values of a member that stands for all of them.

    It keeps the block `family`. So a check of it finds mistakes that all members have.
    """
    family = Family(**content["family"])
    member = (
        Member(name="", seed=0) if family.seeds else Member(name="", model=family.example_model)
    )
    values = {key: draw.value(0) for key, draw in family.values.items()}
    return member_content(content, member, values) | {"family": content["family"]}


def member_content(
    content: Mapping[str, Any], member: Member, values: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the content of a member's scene YAML: the family's, with the member's drawn values."""
    scene_yaml = copy.deepcopy({key: value for key, value in content.items() if key != "family"})
    if member.model is not None:
        _set(scene_yaml, "scene.model", member.model)
    else:
        _set(scene_yaml, "scene.parameters.seed", member.seed)
        if _takes_place(scene_yaml):
            _set(scene_yaml, "scene.parameters.place", member.seed)
    for key, value in values.items():
        _set(scene_yaml, key, copy.deepcopy(value))
    return scene_yaml


def _takes_place(content: Mapping[str, Any]) -> bool:
    """Return whether members get places: of a built-in builder, if the YAML names no place."""
    scene = content.get("scene")
    scene = scene if isinstance(scene, Mapping) else {}
    parameters = scene.get("parameters")
    has_place = isinstance(parameters, Mapping) and "place" in parameters
    return not has_place and not is_own(str(scene.get("builder")))


def _set(content: dict[str, Any], key: str, value: Any) -> None:
    """Set a key with dots. If a parent is no mapping, the check of the content reports it."""
    *parents, last = key.split(".")
    for parent in parents:
        content = content.setdefault(parent, {})
        if not isinstance(content, dict):
            return
    content[last] = value


def _part(*names: str) -> float:
    """Return a number from 0 to below 1 that follows from some names."""
    return evenly_spread(json.dumps(names))


class _Model(NamedTuple):
    """A model file, the path with * that it matches, and the name of its member."""

    path: str
    glob: str
    name: str


def _models(glob_pattern: str) -> list[_Model]:
    """Return the model files that match. Raises `UserError` if there is none."""
    folders = Path(glob_pattern).parent.parts
    fixed = list(itertools.takewhile(lambda part: not glob.has_magic(part), folders))
    # Path.glob() takes no path from /.
    paths = sorted(glob.glob(glob_pattern, recursive=True))  # noqa: PTH207
    models = [
        _Model(path, glob_pattern, _member_name(os.path.relpath(path, Path(*fixed))))
        for path in paths
        if path.lower().endswith(MODELS) and os.path.isfile(path)  # noqa: PTH113, many files
    ]
    if not models:
        raise UserError(f"family.models: is {glob_pattern!r}; there is no such model file")
    return models


def _check_once(models: Iterable[_Model]) -> None:
    """Raise `UserError` for a file that several paths match, and for two members of one name."""
    by_file: dict[str, _Model] = {}
    by_name: dict[str, _Model] = {}
    for model in models:
        other = by_file.setdefault(os.path.normpath(model.path), model)
        if other is not model:
            raise UserError(
                f"family.models: {model.path} matches {other.glob!r} and {model.glob!r}; must "
                "match one of them alone"
            )
        other = by_name.setdefault(model.name, model)
        if other is not model:
            raise UserError(
                f"family.models: {other.path} and {model.path} would both be the member "
                f"{model.name}; rename one, or give one path with * for both, which keeps their "
                "folders in the names"
            )


def _member_name(path: str) -> str:
    """Return the name of the member with a model at ``path`` from the folder of all models.

    It has _ in place of other characters. Unless the path is a plain name, part of its SHA-256
    follows, because several paths may look alike.
    """
    if re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_]{0,60}\.[A-Za-z]+", path):
        return path.replace(".", "_")
    readable = re.sub(r"[^A-Za-z0-9]+", "_", path)[-40:].strip("_")
    return f"{readable}-{hashlib.sha256(os.fsencode(path)).hexdigest()[:8]}"


def summary(family: str, built: int, failures: Sequence[tuple[str, str]], listing: str) -> str:
    """Return the last line of a run: how many members are built, and which failed first.

    ``failures`` are names and causes of the failed members, and ``listing`` is the file with all.
    """
    total = built + len(failures)
    line = f"{built:,} of {total:,} members of {family} built"
    if not failures:
        return line
    first = "; ".join(f"{name}: {cause}" for name, cause in failures[:3])
    more = f"; and {len(failures) - 3:,} more" if failures[3:] else ""
    return f"{line}, {len(failures):,} failed: {listing}: {first}{more}"
