"""Writes lenses as Python source that needs only numpy, for the file read.py of a package.

The source comes from the lenses' own methods, without annotations. Everything else that a method
asks of its lens becomes a number, whether it is a parameter or follows from parameters.
"""

import ast
import inspect
import math
import re
import textwrap
from collections.abc import Iterable
from types import FunctionType
from typing import Any

import numpy as np

from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.base import RadialLens
from lightfield.geometry.lenses.increasing_polynomial import IncreasingPolynomial

_WIDTH = 100
# The bases of the lenses: which methods these define, and which parameters the base uses.
_BASES = {
    "RadialLens": (("_sin_cos", "_radius"), ("width", "height", "center", "_unit", "_limit")),
    "Lens": (("_rays", "_pixels"), ("width", "height")),
}


class LensSource:
    """The source of lenses: their classes, and the functions and constants that these use.

    ``bases`` are the names of classes that the source needs. ``Lens`` makes attributes of its
    keyword arguments.
    """

    def __init__(self, lenses: Iterable[Lens]) -> None:
        self.bases: set[str] = set()
        self._methods: dict[type[Lens], list[FunctionType]] = {}
        self._parameters: dict[type[Lens], list[str]] = {}
        self._functions: dict[str, FunctionType] = {}
        self._constants: dict[str, Any] = {}
        for lens in lenses:
            self._add(lens)

    def _add(self, lens: Lens) -> None:
        """Add the methods of a lens, and all that they use."""
        kind = type(lens)
        methods, parameters = map(list, _BASES[_base(kind)])
        self.bases.add(_base(kind))
        self._methods[kind] = [getattr(kind, name) for name in methods]
        self._parameters[kind] = parameters
        for method in self._methods[kind]:
            for name in _names_of_self(method):
                member = getattr(kind, name, None)
                if isinstance(member, FunctionType) and member not in self._methods[kind]:
                    self._methods[kind].append(member)
                elif not isinstance(member, FunctionType) and name not in parameters:
                    parameters.append(name)
            self._add_globals(method)
        for value in (getattr(lens, name) for name in parameters):
            if isinstance(value, IncreasingPolynomial):
                self.bases.add(type(value).__name__)
            if isinstance(value, Lens):
                self._add(value)

    def _add_globals(self, function: FunctionType) -> None:
        """Add the functions and constants of its module that a function uses."""
        nodes = [node for part in _definition(function).body for node in ast.walk(part)]
        names = {node.id for node in nodes if isinstance(node, ast.Name)}
        for name in sorted((names & function.__globals__.keys()) - {"np", "math"}):
            value = function.__globals__[name]
            if isinstance(value, FunctionType):
                self._functions[name] = value
                self._add_globals(value)
            else:
                self._constants[name] = value

    @property
    def classes(self) -> list[str]:
        """The definitions of the classes."""
        return [self._public(self._class(kind)) for kind in self._methods]

    @property
    def functions(self) -> list[str]:
        """The definitions of the functions."""
        return [_source(function) for function in self._functions.values()]

    @property
    def constants(self) -> list[str]:
        """The definitions of the constants."""
        return [self.text(value, f"{name} = ") for name, value in self._constants.items()]

    def text(self, value: Any, prefix: str = "", column: int = 0) -> str:
        """Return a prefix and the source of a value, which begin at a ``column`` of their line."""
        return self._public(self._text(value, prefix, column))

    def _class(self, kind: type[Lens]) -> str:
        # Further paragraphs describe what this file does not have.
        parts = [_docstring(inspect.cleandoc(kind.__doc__ or "").partition("\n\n")[0])]
        for method in self._methods[kind]:
            parts.append(_source(method, inspect.getdoc(getattr(kind, method.__name__))))
        body = textwrap.indent("\n\n".join(parts), "    ")
        return f"class {kind.__name__}({_base(kind)}):\n{body}"

    def _public(self, text: str) -> str:
        """Return source in which no member of a class begins with an underscore."""
        names = {name for used in self._parameters.values() for name in used}
        names |= {method.__name__ for methods in self._methods.values() for method in methods}
        private = "|".join(sorted(name[1:] for name in names if name.startswith("_")))
        return re.sub(rf"(?<!\w)_(?=(?:{private})\b)", "", text)

    def _text(self, value: Any, prefix: str, column: int, end: str = "") -> str:
        """Return a prefix, the source of a value and its ``end``, as the formatter lays them out.

        That is in one line, or else with all parts in one line, or else with a part a line.
        """
        opening, parts, closing = self._parts(value)
        inline = ", ".join(self._text(part, name, 0) for part, name in parts)
        line = prefix + opening + inline + closing + end
        if not parts or ("\n" not in line and column + len(line) <= _WIDTH):
            return line
        inner = [inline]
        if "\n" in inline or column + 4 + len(inline) > _WIDTH:
            inner = [self._text(part, name, column + 4, ",") for part, name in parts]
        indented = textwrap.indent("\n".join(inner), "    ")
        return f"{prefix}{opening}\n{indented}\n{closing}{end}"

    def _parts(self, value: Any) -> tuple[str, list[tuple[Any, str]], str]:
        """Return a value's opening, its parts with their prefixes, and its closing."""
        if isinstance(value, Lens):
            names = self._parameters[type(value)]
            return f"{type(value).__name__}(", [(getattr(value, n), f"{n}=") for n in names], ")"
        if isinstance(value, IncreasingPolynomial):
            coefficients = value.value.coef.tolist()
            return "IncreasingPolynomial(", [(coefficients, ""), (value.end, "end=")], ")"
        if isinstance(value, dict):
            return "{", [(part, f'"{name}": ') for name, part in value.items()], "}"
        if isinstance(value, np.ndarray):
            return "np.array(", [(value.tolist(), "")], ")"
        if isinstance(value, list | tuple):
            opening, closing = "[]" if isinstance(value, list) else "()"
            return opening, [(part, "") for part in value], closing
        if isinstance(value, str):
            return f'"{value}"', [], ""
        return "math.inf" if value == math.inf else repr(value), [], ""


def _base(kind: type[Lens]) -> str:
    return "RadialLens" if issubclass(kind, RadialLens) else "Lens"


def _definition(function: FunctionType) -> ast.FunctionDef:
    (definition,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
    assert isinstance(definition, ast.FunctionDef)
    return definition


def _names_of_self(method: FunctionType) -> list[str]:
    """Return the names of the members that a method uses."""
    return [
        node.attr
        for node in ast.walk(_definition(method))
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "self"
    ]


def _source(function: FunctionType, doc: str | None = None) -> str:
    """Return the source of a function without annotations. Without a docstring, it has ``doc``."""
    definition = _definition(function)
    assert definition.returns
    lines = textwrap.dedent(inspect.getsource(function)).splitlines()[
        definition.returns.end_lineno :
    ]
    for argument in definition.args.args:
        argument.annotation = None
    if doc and not ast.get_docstring(definition):
        lines[:0] = textwrap.indent(_docstring(doc), "    ").splitlines()
    return "\n".join([f"def {function.__name__}({ast.unparse(definition.args)}):", *lines])


def _docstring(text: str | None) -> str:
    doc = inspect.cleandoc(text or "")
    end = "\n" if "\n" in doc else ""
    return f'"""{doc}{end}"""'
