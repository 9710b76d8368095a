"""Makes the program of a stage. Its flags follow from the fields of the stage and its settings.

A field may have these keys in its ``json_schema_extra``: ``short``, a list of short flags;
``flag``, in place of the field's name; ``metavar``; ``positional``; ``commas``, for a list in one
word; and ``may_be_empty``: the flag without a value means an empty list, or None. A flag of a list
may be given again, for more values. A list of tuples takes one tuple each time. ``group`` is a
title in --help. A command line may have only one of the flags with the same ``one_of``.
"""

import argparse
import types
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, TypeAdapter
from pydantic.fields import FieldInfo

from lightfield.core import cli
from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.engine.stage import ByHand, NoSettings, Stage
from lightfield.settings.base import checked, read_settings

Model = TypeVar("Model", bound=BaseModel)


def program(stage: type[Stage[Any]], description: str | None) -> None:
    """Run a stage on the command line's arguments, as a program that ends with an exit status."""
    cli.run(lambda: parsed(stage, description).run(), stage.error_status)


def parsed(
    stage: type[Stage[Any]], description: str | None, words: Sequence[str] | None = None
) -> Stage[Any]:
    """Return the job that the ``words`` of a command line describe.

    Raises `UserError` for a value that is not allowed. argparse ends the process for a wrong flag.
    """
    given = vars(parser_of(stage, description).parse_args(words))
    own = {name: given.pop(name) for name in stage.model_fields if name in given}
    settings_file = own.get("settings")
    own["settings"] = _settings(stage, own, given)
    job = checked_flags(stage, own)
    if settings_file:
        job.note_settings(read_json(settings_file))
    return job


def parser_of(stage: type[Stage[Any]], description: str | None) -> argparse.ArgumentParser:
    """Return the parser of a stage's program. It leaves out flags that are not given."""
    parser = argparse.ArgumentParser(
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        argument_default=argparse.SUPPRESS,
    )
    model = stage.model_fields["settings"].annotation
    if model is not NoSettings:
        parser.add_argument(
            "--settings",
            type=Path,
            metavar="JSON",
            required=stage.by_hand is None and stage.model_fields["settings"].is_required(),
            help="settings file",
        )
    groups = _Groups(parser)
    for name, field in stage.model_fields.items():
        if name != "settings":
            _add(groups.of(field), name, field, may_be_required=True)
    if stage.by_hand:
        groups.default = parser.add_argument_group("Instead of --settings")
        for name, field, _ in _flags_of(stage.by_hand):
            _add(groups.of(field), name, field, may_be_required=False)
    return parser


class _Groups:
    """A parser's groups of flags, by their titles. ``default`` has the flags without a title."""

    def __init__(self, parser: argparse.ArgumentParser) -> None:
        self.parser = parser
        self.default: Any = parser
        self.titled: dict[str, Any] = {}
        self.exclusive: dict[str, Any] = {}

    def of(self, field: FieldInfo) -> Any:
        """Return the group to which the flag of a field belongs."""
        extra = _extra(field)
        group = self.default
        if title := extra.get("group"):
            group = self.titled.get(title) or self.parser.add_argument_group(title)
            self.titled[title] = group
        if choice := extra.get("one_of"):
            group = self.exclusive.get(choice) or group.add_mutually_exclusive_group()
            self.exclusive[choice] = group
        return group


def _settings(stage: type[Stage[Any]], own: dict[str, Any], flags: dict[str, Any]) -> Any:
    """Return a job's settings, from its settings file or from ``flags``."""
    model = stage.settings_model(**own)
    if "settings" in own:
        for name in flags:
            raise UserError(f"--settings: excludes {_flag(name)}; write it into the file")
        return read_settings(model, own["settings"])
    content: dict[str, Any] = {}
    for name, field, outer in _flags_of(stage.by_hand) if stage.by_hand else ():
        if name in flags:
            (content.setdefault(outer, {}) if outer else content)[name] = flags[name]
        elif field.is_required():
            raise UserError(f"{_flag(name)}: is missing; or give --settings")
    if stage.by_hand and issubclass(stage.by_hand, ByHand):
        return checked_flags(stage.by_hand, content).settings(own)
    return checked_flags(model, content)


def checked_flags(model: type[Model], content: Mapping[str, Any]) -> Model:
    """Return what flags give as a ``model``. Raises `UserError` that names the wrong flag."""
    try:
        return checked(TypeAdapter(model), content, "")
    except UserError as error:
        path, _, problem = str(error).removeprefix(": ").partition(": ")
        # The place in a list, such as [1], follows the name.
        names = [part for part in path.split(".") if not part.startswith("[")]
        raise UserError(f"{_flag(names[-1])}: {problem}") from None


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _flags_of(model: type[BaseModel]) -> Iterator[tuple[str, FieldInfo, str | None]]:
    """Yield name and field of each flag that stands for a key of settings.

    The third value is the key of the block that has the key. None for a key of the settings
    themselves.
    """
    for name, field in model.model_fields.items():
        kind = _without_none(field.annotation)
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            for inner_name, inner_field in kind.model_fields.items():
                yield inner_name, inner_field, name
        elif _extra(field).get("role") != "cause":
            yield name, field, None


def _add(parser: Any, name: str, field: FieldInfo, may_be_required: bool) -> None:
    """Add the flag of a field to a parser, or to a group of it."""
    extra = _extra(field)
    keywords: dict[str, Any] = {"help": _help_of(field), **_values(field, extra)}
    if "metavar" in extra:
        keywords["metavar"] = extra["metavar"]
    if extra.get("positional"):
        parser.add_argument(name, **keywords)
        return
    if may_be_required and field.is_required():
        keywords["required"] = True
    flag = extra.get("flag", _flag(name))
    parser.add_argument(*extra.get("short", ()), flag, dest=name, **keywords)


def _help_of(field: FieldInfo) -> str:
    """Return the help of a field, with its default if that says something."""
    text = (field.description or "").rstrip(".")
    default = _default_of(field)
    if default is not None and "default:" not in text:
        text += f" (default: {default})"
    return text.replace("%", "%%")


def _default_of(field: FieldInfo) -> str | None:
    """Return the default of a field as text. None if it has none, or one that says nothing."""
    default = field.default
    if isinstance(default, bool) or not isinstance(default, str | int | float) or default == "":
        return None
    return f"{default:g}" if isinstance(default, float) else str(default)


def _extra(field: FieldInfo) -> Mapping[str, Any]:
    extra = field.json_schema_extra
    return extra if isinstance(extra, dict) else {}


def _values(field: FieldInfo, extra: Mapping[str, Any]) -> dict[str, Any]:
    """Return how argparse reads the values of a field."""
    kind = _without_none(field.annotation)
    if kind is bool:
        return {"action": "store_true"}
    if allowed := extra.get("enum"):
        return {"choices": list(allowed)}
    origin, inner = get_origin(kind), get_args(kind)
    if origin is list and extra.get("commas"):
        return {"type": lambda text: text.split(",")}
    if origin is list and get_origin(inner[0]) is tuple:
        # The model converts the values, which may have different types.
        return {"action": "append", "nargs": len(get_args(inner[0]))}
    if origin is list:
        count = "*" if extra.get("may_be_empty") else "+"
        return {"action": "extend", "nargs": count, **_one(inner[0])}
    if origin is tuple:
        return {"nargs": len(inner), **_one(inner[0])}
    keywords = _one(kind)
    if extra.get("may_be_empty"):
        keywords["nargs"] = "?"
    return keywords


def _one(kind: Any) -> dict[str, Any]:
    """Return how argparse reads one value."""
    kind = _without_none(kind)
    if get_origin(kind) is Literal:
        choices = get_args(kind)
        return {"choices": list(choices), "type": type(choices[0])}
    return {"type": kind}


def _without_none(kind: Any) -> Any:
    """Return a type without its limits and without None."""
    if get_origin(kind) is Annotated:
        return _without_none(get_args(kind)[0])
    if get_origin(kind) in (Union, types.UnionType):
        kinds = [each for each in get_args(kind) if each is not type(None)]
        return _without_none(kinds[0])
    return kind
