"""The base class of settings that users write in YAML, and mistakes in them as one line."""

import difflib
import json
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    TypeAdapter,
    ValidationError,
    WrapValidator,
    model_validator,
)
from pydantic_core import ErrorDetails, InitErrorDetails
from typing_extensions import TypeAliasType

from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import read_json

Model = TypeVar("Model")


class Settings(BaseModel):
    """A mapping of allowed keys. No value is converted (4.0 is not a whole number) or ignored.

    YAML makes null of a key without a value. Null is refused, because a default in its place would
    look like the user's choice.

    A model's validator raises ``ValueError("key: what is wrong")``. The key may be dotted.
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, defer_build=True
    )

    @model_validator(mode="wrap")
    @classmethod
    def _check_keys(cls, content: Any, check_values: ModelWrapValidatorHandler[Self]) -> Self:
        """Check the keys, and then the values. Reports the wrong keys with the wrong values."""
        if not isinstance(content, Mapping):
            return check_values(content)
        problems = {
            key: problem for key, value in content.items() if (problem := cls._problem(key, value))
        }
        if not problems:
            return check_values(content)
        errors = [
            InitErrorDetails(
                type="value_error",
                loc=(),
                input=content,
                ctx={"error": ValueError(f"{key}: {problem}")},
            )
            for key, problem in problems.items()
        ]
        try:
            check_values({key: value for key, value in content.items() if key not in problems})
        except ValidationError as error:
            errors += _errors_of_values(error)
        raise ValidationError.from_exception_data(cls.__name__, errors)

    @classmethod
    def _problem(cls, key: Any, value: Any) -> str | None:
        """Return what is wrong with a key, whatever its value. Or None."""
        allowed_keys = cls.model_fields
        if key not in allowed_keys:
            hint = suggestion(key, allowed_keys) or f"; allowed here: {', '.join(allowed_keys)}"
            return f"unknown key{hint}"
        if value is None:
            return "is null; must have a value, or be left out"
        return None

    @classmethod
    def of(cls, **values: Any) -> Self:
        """Return settings with these values. A value that is None is left out."""
        return cls(**{key: value for key, value in values.items() if value is not None})

    def as_json(self, keys: set[str] | None = None) -> dict[str, Any]:
        """Return the content of a settings file: all keys with a value, or the keys in ``keys``."""
        return self.model_dump(mode="json", include=keys, exclude_none=True)


def _errors_of_values(error: ValidationError) -> list[InitErrorDetails]:
    """Return a model's errors of its values, without those that follow from wrong keys.

    A wrong key may be a missing one that is misspelt.
    """
    return [
        InitErrorDetails(
            type=details["type"],
            loc=details["loc"],
            input=details["input"],
            ctx=details.get("ctx", {}),
        )
        for details in error.errors()
        if details["loc"] and not (details["type"] == "missing" and len(details["loc"]) == 1)
    ]


class ReaderSettings(Settings):
    """The settings of a stage that reads files which no flag of its program names."""

    inputs: list[str] = Field(
        [],
        description="Paths of the files that the job reads, for its receipt. The receipts of "
        "shards stand for their views.",
    )


def as_list(count: int, most: int | None = None) -> BeforeValidator:
    """Return a validator that makes a tuple of a YAML list of ``count`` to ``most`` values."""
    counts = range(count, (most or count) + 1)

    def check(value: Any) -> Any:
        if not isinstance(value, list | tuple) or len(value) not in counts:
            text = f"{count} to {most}" if most else f"{count}"
            raise ValueError(f"must be a list of {text} values")
        return tuple(value)

    return BeforeValidator(check)


def _unchanged(value: Any, check: Callable[[Any], Any]) -> Any:
    check(value)
    return value


# Keeps a number as the user wrote it: 10 does not become 10.0, which would change a dataset's key.
AS_WRITTEN = WrapValidator(_unchanged)

# Metres, or degrees. Blender computes in 32 bits, which are coarser than a metre beyond this.
FARTHEST = 1e7
_Coordinate = Annotated[float, Field(strict=True, ge=-FARTHEST, le=FARTHEST)]
# Named, so that the JSON schema has it once.
Vector = TypeAliasType(
    "Vector", Annotated[tuple[_Coordinate, _Coordinate, _Coordinate], as_list(3)]
)
# A file that has more mistakes is probably another kind of file.
_MOST_PROBLEMS = 10
# Names that other programs have for values, in lower case, and the names here.
OTHER_NAMES: dict[str, str] = {}
# What messages and the reference say instead of a regular expression.
MEANINGS: dict[str, str] = {}


def pattern(expression: str, meaning: str) -> str:
    """Return a field's pattern. Messages show its ``meaning`` instead of the expression."""
    MEANINGS[expression] = meaning
    return expression


Address = Annotated[
    str,
    Field(
        pattern=pattern(
            r"""^https?://[^\s"'<>]+$""",
            "an address that begins with http:// or https://, without blanks, quotes, < and >",
        )
    ),
]
# The name of a folder.
Name = Annotated[
    str,
    Field(
        pattern=pattern(
            r"^[A-Za-z0-9][A-Za-z0-9_.-]*$",
            "a name of letters, digits and . _ - with a letter or digit first",
        ),
        max_length=100,
    ),
]


def suggestion(name: str, allowed: Iterable[str]) -> str:
    """Return ``; did you mean …?``, or nothing if no allowed name is similar."""
    allowed_names = list(allowed)
    other = OTHER_NAMES.get(name.lower())
    if other in allowed_names:
        return f"; did you mean {other}?"
    close = difflib.get_close_matches(name, allowed_names, n=1)
    return f"; did you mean {close[0]}?" if close else ""


def checked(model: TypeAdapter[Model], content: Any, file: str) -> Model:
    """Return a file's content as ``model``. Raises `UserError` with file, key, value, and why."""
    try:
        return model.validate_python(content)
    except ValidationError as error:
        first, *_ = problems(error, content)
        raise UserError(f"{file}: {first}") from None


def checked_yaml(model: TypeAdapter[Model], content: Any, located: Callable[[str], str]) -> Model:
    """Return the content of a file that a user wrote as ``model``.

    Raises `UserError` with a line for each mistake, so that the user can mend them at once.
    ``located`` adds the file and the line to a problem.
    """
    try:
        return model.validate_python(content)
    except ValidationError as error:
        lines = problems(error, content)
    more = len(lines) - _MOST_PROBLEMS
    if more > 0:
        lines[_MOST_PROBLEMS:] = [f"{more} more mistakes"]
    raise UserError(*map(located, lines))


def read_settings(model: type[Model], path: Path) -> Model:
    """Read a settings file. Raises `UserError` with file, key, value, and why."""
    return checked(TypeAdapter(model), read_json(path), str(path))


def problems(error: ValidationError, content: Any) -> list[str]:
    """Return in one line each what is wrong with the wrong keys of ``content``."""
    errors_by_place: dict[tuple[int | str, ...], list[ErrorDetails]] = {}
    for details in error.errors():
        place = _place(details, content)
        # A value that may have several types has an error for each type.
        near = next((p for p in errors_by_place if _is_within(p, place)), place)
        errors_by_place.setdefault(near, []).append(details)
    return [_problem(of_place, content) for of_place in errors_by_place.values()]


def _is_within(place: tuple[int | str, ...], other: tuple[int | str, ...]) -> bool:
    """Return whether one place is within the other."""
    length = min(len(place), len(other))
    return place[:length] == other[:length]


# The key with which a problem begins, such as trees.[1].height.
_KEY = r"[\w.\[\]-]+(?=: )"


def _place(error: ErrorDetails, content: Any) -> tuple[int | str, ...]:
    """Return the keys that lead to a mistake, with the key that is missing or wrong."""
    path, value = _locate(error, content)
    context = error.get("ctx", {})
    if error["type"] == "missing":
        return (*path, error["loc"][-1])
    if "discriminator" in context:
        return (*path, context["discriminator"].strip("'"))
    if error["type"] == "value_error" and isinstance(value, Mapping):
        key = re.match(_KEY, str(context["error"]))
        return (*path, *key[0].split(".")) if key else path
    return path


def _problem(errors: list[ErrorDetails], content: Any) -> str:
    """Return in one line what is wrong with a key, or with one of the keys below it."""
    located_errors = [(*_locate(error, content), error) for error in errors]
    # A value that may have several types has an error for each type. The deepest says most.
    start = located_errors[0][0]
    path = max((p for p, _, _ in located_errors if p[: len(start)] == start), key=len)
    errors_of_key = [(value, error) for p, value, error in located_errors if p == path]
    value, error = errors_of_key[0]
    key = ".".join(f"[{part}]" if isinstance(part, int) else part for part in path)
    prefix = f"{key}: " if key else ""
    context = error.get("ctx", {})
    match error["type"]:
        case "value_error" if isinstance(value, Mapping):
            problem = str(context["error"])
            below = key and re.match(_KEY, problem)
            return f"{key}.{problem}" if below else f"{prefix}{problem}"
        case "value_error" | "assertion_error":
            # A user's own check may say it in other words.
            if not str(context["error"]).startswith("must "):
                return f"{prefix}is {_shown(value)}: {context['error']}"
        case "missing" | "union_tag_not_found":
            name = context["discriminator"] if "discriminator" in context else error["loc"][-1]
            return f"{prefix}is missing the key {str(name).strip(chr(39))}"
        case "union_tag_invalid":
            name = context["discriminator"].strip("'")
            kind = ".".join(filter(None, [key, name]))
            allowed_tags = context["expected_tags"].replace("'", "")
            hint = suggestion(context["tag"], allowed_tags.split(", "))
            return f"{kind}: is {_shown(value[name])}; must be one of {allowed_tags}{hint}"
    if error["loc"][-1:] == ("[key]",):
        # `path` has no rigs that are somebody else's folders, so use the error's own location.
        *parents, name, _ = error["loc"]
        return f"{'.'.join(map(str, parents))}: {name!r} is not a name; must {_allowed(error)}"
    allowed = dict.fromkeys(_allowed(error) for _, error in errors_of_key)
    return f"{prefix}is {_shown(value)}; must {' or '.join(allowed).replace(' or be ', ' or ')}"


def _shown(value: Any) -> str:
    """Return a value as JSON. A long one is shortened."""
    text = json.dumps(value, default=str)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _locate(error: ErrorDetails, content: Any) -> tuple[tuple[int | str, ...], Any]:
    """Return the keys that lead to a wrong value, and the value.

    Leaves out pydantic's names of types, which are not keys of ``content``. A key that ``content``
    lacks counts if its default is wrong.
    """
    path: list[int | str] = []
    for part in error["loc"]:
        is_key = isinstance(content, Mapping) and part in content
        is_index = isinstance(content, list) and isinstance(part, int) and part < len(content)
        if is_key or is_index:
            content = content[part]
            path.append(part)
    if error["type"] == "value_error" and path != [*error["loc"]] and error["input"] != content:
        path.append(error["loc"][-1])
        content = error["input"]
    return tuple(path), content


_BOUNDS = {"ge": "at least", "gt": "above", "le": "at most", "lt": "below"}


def _allowed(error: ErrorDetails) -> str:
    """Return what pydantic allows, as text that follows ``must``."""
    match error["type"]:
        case "value_error" | "assertion_error":
            return str(error["ctx"]["error"]).removeprefix("must ")
        case "missing":
            return f"have the key {error['loc'][-1]}"
        case "model_type" | "model_attributes_type" | "dict_type":
            return "be a mapping of keys to values"
        case "int_type" | "int_from_float" | "int_parsing":
            return "be a whole number"
        case "float_type" | "float_parsing":
            return "be a number"
        case "string_type":
            is_number = isinstance(error["input"], int | float)
            return "be a text: put it in quotes" if is_number else "be a text"
        case "bool_type":
            return "be true or false"
        case "string_pattern_mismatch":
            expression = error["ctx"]["pattern"]
            return f"be {MEANINGS.get(expression, f'a text that matches {expression}')}"
        case "list_type" | "tuple_type":
            return "be a list"
        case "extra_forbidden" | "unexpected_keyword_argument":
            return "be left out"
        case "literal_error" | "enum":
            return f"be {error['ctx']['expected']}".replace("'", "")
    for name, comparison in _BOUNDS.items():
        if name in error.get("ctx", {}):
            bound = error["ctx"][name]
            if isinstance(bound, int):
                return f"be a whole number {comparison} {units.limit(bound)}"
            return f"be a number {comparison} {units.limit(bound)}"
    text = re.sub(r"^\w+ should ", "", error["msg"])
    return re.sub(r" after validation, not .*", "", text)
