"""A user's own scene builder: a Python file, the files that it reads, and its parameters.

A plan parses the file. It runs only the class `Parameters`, with the imports and constants that the
class needs. So it needs no Blender.
"""

import ast
import dataclasses
import json
import os
import sys
import traceback
import types
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pydantic import BaseModel, TypeAdapter, ValidationError

from lightfield.core.errors import UserError
from lightfield.core.files import check_readable, open_file, read_error
from lightfield.core.paths import inside
from lightfield.settings.base import problems, suggestion

SUFFIX = ".py"
# The function that fills the scene, and the class of its parameters.
_BUILD = "build"
_PARAMETERS = "Parameters"
# The list of the files that the code reads, such as textures.
_FILES = "FILES"
# The package of the repository's builders and their library.
_BUILDERS = "scenes"
# A larger file is no text of a program.
_LARGEST = 1_000_000  # bytes
# What the class `Parameters` may import, because a plan runs it.
_PLAIN_MODULES = (
    *("__future__", "annotated_types", "collections", "dataclasses", "enum", "math", "pydantic"),
    *("typing", "typing_extensions"),
)


def is_own(builder: str) -> bool:
    """Return whether a builder is a user's own file, and not the name of a built-in one."""
    return builder.endswith(SUFFIX)


def check(builder: Path) -> None:
    """Raise `UserError` for a builder that is missing, no Python, or without a function build."""
    if _BUILD not in _definitions(_parsed(builder)):
        raise UserError(f"{builder}: has no function {_BUILD}(parameters)")
    files(builder)


def files(builder: Path) -> list[Path]:
    """Return the builder's file, the files that it imports from its folder, and those in `FILES`.

    Finds imports without running them. Raises `UserError` for a file that cannot be read.
    """
    code = [builder]
    data: list[Path] = []
    for file in code:
        tree = _parsed(file)
        code += [each for each in _imported_files(tree, file, builder.parent) if each not in code]
        data += _data_files(tree, file)
    return sorted({*code, *data})


def imported_builders(own_files: Iterable[Path]) -> list[str]:
    """Return the folders of scripts/scenes/ that a builder's own files import, such as library."""
    modules = (
        module.split(".")
        for file in own_files
        if file.suffix == SUFFIX
        for module in _imported_modules(_parsed(file))
    )
    return sorted({names[1] for names in modules if names[0] == _BUILDERS and names[1:]})


def check_parameters(builder: Path, parameters: Any) -> dict[str, Any]:
    """Return the parameters of a scene YAML as they are, if the class `Parameters` takes them.

    Raises a ValueError that begins with the wrong key. Raises `UserError` for a class that a plan
    cannot run. Without the class, everything is allowed that JSON holds.
    """
    if not isinstance(parameters, Mapping):
        raise ValueError("must be a mapping of keys to values")
    try:
        json.dumps(parameters, allow_nan=False)
    except (TypeError, ValueError):
        raise ValueError(
            "must have only texts, finite numbers, switches, lists and mappings"
        ) from None
    tree = _parsed(builder)
    if _PARAMETERS in _definitions(tree):
        with _parameters_of(tree, builder) as model:
            try:
                typed(model, parameters, builder)
            except (UserError, ValueError):
                raise
            except (Exception, SystemExit) as error:
                raise UserError(problem([builder], builder, error)) from None
    return dict(parameters)


def typed(model: type | None, parameters: Mapping[str, Any], builder: Path) -> Any:
    """Return parameters as an object of the class `Parameters`, or as a dict without the class.

    Raises a ValueError that begins with the wrong key.
    """
    if model is None:
        return dict(parameters)
    if dataclasses.is_dataclass(model):
        allowed_keys = [field.name for field in dataclasses.fields(model)]
    elif isinstance(model, type) and issubclass(model, BaseModel):
        allowed_keys = [each.alias or name for name, each in model.model_fields.items()]
    else:
        raise UserError(f"{builder}: {_PARAMETERS} must be a dataclass or a pydantic model")
    for key in parameters:
        if key not in allowed_keys:
            hint = suggestion(key, allowed_keys) or f"; {builder} has {', '.join(allowed_keys)}"
            raise ValueError(f"{key}: unknown key{hint}")
        if parameters[key] is None:
            raise ValueError(f"{key}: is null; must have a value, or be left out")
    try:
        # As JSON, a list may be a tuple, and a text a member of an enumeration.
        text = json.dumps(parameters)
        return TypeAdapter(model).validate_json(text, strict=True, extra="forbid")
    except ValidationError as error:
        (first, *_) = problems(error, parameters)
        raise ValueError(first) from None


def problem(own_files: Sequence[Path], builder: Path, error: BaseException) -> str:
    """Return an error of the user's code in one line, with the file and the line where it arose."""
    names = {os.path.abspath(file): file for file in own_files}  # noqa: PTH100, it removes ..
    place = str(builder)
    for frame in traceback.extract_tb(error.__traceback__):
        if file := names.get(os.path.abspath(frame.filename)):  # noqa: PTH100, it removes ..
            place = f"{file}:{frame.lineno}"
    text = " ".join(str(error).split())
    return f"{place}: {type(error).__name__}{f': {text}' if text else ''}"


def _parsed(file: Path) -> ast.Module:
    """Return the code of a file. Raises `UserError` with the line of a mistake."""
    try:
        with open_file(file) as opened:
            text = opened.read(_LARGEST + 1)
    except OSError as error:
        raise read_error(file, error) from None
    if len(text) > _LARGEST:
        raise UserError(f"{file}: is larger than {_LARGEST // 1000} kB; is it a Python file?")
    try:
        with warnings.catch_warnings(action="ignore"):
            return ast.parse(text, str(file))
    except SyntaxError as error:
        line = f":{error.lineno}" if error.lineno else ""
        raise UserError(f"{file}{line}: {error.msg}") from None
    except (ValueError, RecursionError, MemoryError) as error:
        raise UserError(f"{file}: is no Python file: {error}") from None


def _definitions(tree: ast.Module) -> dict[str, list[ast.stmt]]:
    """Return the statements that give a file's names their values, by name, in their order."""
    definitions: dict[str, list[ast.stmt]] = {}
    for statement in tree.body:
        for name in dict.fromkeys(_defined(statement)):
            definitions.setdefault(name, []).append(statement)
    return definitions


def _defined(statement: ast.stmt) -> Iterator[str]:
    for node in _outside_functions(statement):
        match node:
            case ast.Import(names=names) | ast.ImportFrom(names=names):
                yield from (each.asname or each.name.partition(".")[0] for each in names)
            case ast.ClassDef(name=name) | ast.FunctionDef(name=name):
                yield name
            case ast.Name(id=name, ctx=ast.Store()):
                yield name


def _outside_functions(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a statement and its parts, but not what is in functions and classes."""
    yield node
    if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        for child in ast.iter_child_nodes(node):
            yield from _outside_functions(child)


def _imported_modules(tree: ast.Module, package: str = "") -> Iterator[str]:
    """Yield the modules that a file of a ``package`` may import, with dots. Some may be names."""
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=names):
                yield from (each.name for each in names)
            case ast.ImportFrom(module=module, names=names, level=level):
                parents = package.split(".") if package else []
                kept = len(parents) + 1 - level
                if level and kept < 0:
                    continue
                base = [*parents[:kept], *filter(None, [module])] if level else [str(module)]
                yield ".".join(base)
                yield from (".".join([*base, each.name]) for each in names)


def _imported_files(tree: ast.Module, file: Path, folder: Path) -> Iterator[Path]:
    """Yield the files in the builder's ``folder`` that a file in it imports."""
    package = ".".join(file.parent.relative_to(folder).parts)
    for module in _imported_modules(tree, package):
        names = module.split(".")
        if names[0] == _BUILDERS:
            continue
        for count in range(1, len(names) + 1):
            path = folder.joinpath(*names[:count])
            for each in (path / "__init__.py", path.with_name(f"{path.name}{SUFFIX}")):
                if each.exists():
                    yield each


def _data_files(tree: ast.Module, file: Path) -> Iterator[Path]:
    """Yield the files in a file's list `FILES`, which are named from its folder."""
    statements = _definitions(tree).get(_FILES)
    if not statements:
        return
    where = f"{file}:{statements[-1].lineno}: {_FILES}"
    try:
        (statement,) = statements
        names = ast.literal_eval(statement.value)  # type: ignore[attr-defined]
    except (ValueError, TypeError, AttributeError):
        names = None
    if not isinstance(names, list | tuple | set):
        raise UserError(f"{where}: must be one list of texts, without computing")
    for name in names:
        path = inside(file.parent, name, where)
        check_readable(path)
        yield path


@contextmanager
def _parameters_of(tree: ast.Module, builder: Path) -> Iterator[type]:
    """Run the class `Parameters` and what it needs from its file, and yield it."""
    statements = _needed(tree, builder)
    code = compile(ast.Module(statements, []), str(builder), "exec")
    module = types.ModuleType("parameters_of_own_builder")
    # Annotations may be texts, which are looked up in the module.
    sys.modules[module.__name__] = module
    try:
        try:
            exec(code, module.__dict__)
        except (Exception, SystemExit) as error:
            raise UserError(problem([builder], builder, error)) from None
        yield module.__dict__[_PARAMETERS]
    finally:
        del sys.modules[module.__name__]


def _needed(tree: ast.Module, builder: Path) -> list[ast.stmt]:
    """Return the statements that the class `Parameters` needs, in their order."""
    definitions = _definitions(tree)
    names = [_PARAMETERS]
    needed: set[ast.stmt] = set()
    for name in names:
        for statement in definitions[name]:
            _check_plain(statement, builder)
            needed.add(statement)
            names += definitions.keys() & _read_names(statement) - {*names}
    return [each for each in tree.body if each in needed or _is_of_future(each)]


def _read_names(statement: ast.stmt) -> set[str]:
    return {
        node.id
        for node in ast.walk(statement)
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)
    }


def _is_of_future(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.ImportFrom) and statement.module == "__future__"


def _check_plain(statement: ast.stmt, builder: Path) -> None:
    """Raise `UserError` if the class `Parameters` needs a module that a plan does not import."""
    for node in _outside_functions(statement):
        modules = []
        match node:
            case ast.Import(names=names):
                modules = [each.name for each in names]
            case ast.ImportFrom(module=module, level=level):
                modules = [f"{'.' * level}{module or ''}"]
        for module in modules:
            if module.partition(".")[0] not in _PLAIN_MODULES:
                raise UserError(
                    f"{builder}:{statement.lineno}: {_PARAMETERS} needs {module}, but a plan runs "
                    "this class without your files; it may use "
                    f"{', '.join(_PLAIN_MODULES[1:])}"
                )
