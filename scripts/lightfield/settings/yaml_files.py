"""Reads YAML files of settings: safely, with a limit of size, and with no key given twice."""

import math
import re
from collections.abc import Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

import yaml

from lightfield.core.errors import UserError
from lightfield.core.files import open_file

# Bytes. A scene YAML has some thousand.
_LARGEST_YAML = 2**16
# A YAML's nodes, with each alias counted as the nodes that it repeats.
_MOST_NODES = 20_000
# Larger whole numbers do not fit into a float.
_MOST_BITS = 1023
# Halves of characters, which no file in UTF-8 can hold. "\ud800" in quotes is one.
_SURROGATE = re.compile("[\ud800-\udfff]")


class _UniqueKeyLoader(yaml.SafeLoader):
    """Safe YAML in which a key given twice is an error, not a silent overwrite.

    A value that does not fit its tag, as in ``!!bool x``, is an error at its line.
    """

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._merged_nodes: set[yaml.MappingNode] = set()

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        try:
            value = super().construct_object(node, deep)
        except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError):
            shown = repr(node.value)
            shown = shown if len(shown) <= 60 else f"{shown[:57]}..."
            problem = f"is {shown}, which is not a valid {node.tag.rpartition(':')[2]}"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark) from None
        if isinstance(value, int) and value.bit_length() > _MOST_BITS:
            problem = "is a number with too many digits"
        elif isinstance(value, str) and (half := _SURROGATE.search(value)):
            problem = f"has {half[0]!r}, half of a character; write the character itself"
        else:
            return value
        raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark)

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        """Replace `<<: *other` by the keys of the other mapping. Keys beside it take precedence.

        Afterwards the node has the replaced keys twice. So this checks each node only before that.
        """
        if node not in self._merged_nodes:
            self._merged_nodes.add(node)
            self._check_keys(node)
            super().flatten_mapping(node)

    def _check_keys(self, node: yaml.MappingNode) -> None:
        keys: set[Any] = set()
        for key_node, _ in node.value:
            is_merge = key_node.tag == "tag:yaml.org,2002:merge"
            key = "<<" if is_merge else self.construct_object(key_node, deep=True)
            if not isinstance(key, str):
                problem = f"the key {key!r} is not a text; put it in quotes"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key_node.start_mark)
            if key in keys:
                problem = f"the key {key!r} is given twice"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key_node.start_mark)
            keys.add(key)


# YAML 1.1 reads 12:30 as 750, 0123 as 83 and 0b11 as 3. Here they stay texts, so that messages show
# them as written. YAML 1.1 reads 1e-3, 2.5e1 and 0o17 as texts. Here they are numbers, as in YAML
# 1.2.
_UniqueKeyLoader.yaml_implicit_resolvers = {
    first: [(tag, form) for tag, form in resolvers if not tag.endswith((":int", ":float"))]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_UniqueKeyLoader.add_implicit_resolver(
    "tag:yaml.org,2002:int",
    re.compile(r"[-+]?(?:0|[1-9][0-9_]*|0x[0-9a-fA-F_]+)$|0o[0-7]+$"),
    list("-+0123456789"),
)
_UniqueKeyLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(
        r"[-+]?(?:[0-9][0-9_]*\.[0-9_]*|\.[0-9][0-9_]*)(?:[eE][-+]?[0-9]+)?$"
        r"|[-+]?[0-9]+[eE][-+]?[0-9]+$"
        r"|[-+]?\.(?:inf|Inf|INF)$|\.(?:nan|NaN|NAN)$"
    ),
    list("-+0123456789."),
)


def as_written(content: dict[str, Any], written: Mapping[str, Any]) -> None:
    """Replace Snakemake's reading of a file, ``content``, by this module's reading, ``written``."""
    for key, value in written.items():
        if isinstance(value, Mapping) and isinstance(content.get(key), dict):
            as_written(content[key], value)
        else:
            content[key] = value


def read_yaml(path: Path, file: str) -> Any:
    """Read a YAML file. Errors call it ``file``.

    Raises `UserError` if it is not YAML, or too large. Repeated aliases count, too.
    """
    return parse_yaml(read_settings_text(path, file), file)


def read_settings_text(path: Path, file: str) -> str:
    """Return a YAML file's text. Raises `UserError` if it is not text, or too large."""
    try:
        with open_file(path) as stream:
            content = stream.read(_LARGEST_YAML + 1)
        if len(content) <= _LARGEST_YAML:
            return content.decode()
    except (OSError, ValueError) as error:
        raise UserError(f"{file}: cannot be read as YAML: {error}") from None
    raise UserError(
        f"{file}: is larger than {_LARGEST_YAML // 1000} kB, so it is not a settings file"
    )


def parse_yaml(text: str, file: str) -> Any:
    """Return what a YAML file's text says. Raises `UserError` as `read_yaml` does."""
    node = None
    try:
        loader = _UniqueKeyLoader(text)
        node = loader.get_single_node()
        if _size(node, {}) > _MOST_NODES:
            raise UserError(
                f"{file}: its aliases (*name) repeat too much, so it is not a settings file"
            )
        return loader.construct_document(node) if node else None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
        keys = ".".join(_keys_to(mark.index, node)) if mark and node else ""
        problem = error.problem
        if problem and problem.startswith("but "):
            # The context is the other half of the sentence.
            problem = f"{error.context}, {problem}"
        problem = f"{keys}: {problem}" if keys else problem
        if mark and _is_indented_by_tabs(text, mark.line):
            problem = "is indented with a tab; use spaces"
        raise UserError(f"{file}{where}: {problem}") from None
    except (ValueError, RecursionError, yaml.YAMLError) as error:
        raise UserError(f"{file}: cannot be read as YAML: {error}") from None


def located(problem: str, text: str, file: str) -> str:
    """Return ``file:line: problem``. The line has the key with which the problem begins.

    ``text`` is the file's text, which `parse_yaml` has read.
    """
    _, line = find_key(problem, text)
    return f"{file}:{line}: {problem}" if line else f"{file}: {problem}"


def find_key(problem: str, text: str) -> tuple[int, int]:
    """Return how many of the keys with which a problem begins a YAML file has, and the last's line.

    So a missing key has the line of its parent. Without any key, both numbers are 0. A key that
    was inserted with `<<` or `*name` has the line where it stands.
    """
    loader = _UniqueKeyLoader(text)
    node = loader.get_single_node()
    if node:
        # This replaces each `<<` by the keys that it inserts.
        loader.construct_document(node)
    depth = line = 0
    while node:
        children = [
            (key, place, child)
            for key, place, child in _children(node)
            if problem.startswith((f"{key}.", f"{key}: "))
        ]
        if not children:
            break
        # Names may have dots. Of keys that are equal, the last counts.
        key, place, node = max(reversed(children), key=lambda child: len(child[0]))
        depth += 1
        line = place.start_mark.line + 1
        if problem.startswith(f"{key}: "):
            break
        problem = problem.removeprefix(f"{key}.")
    return depth, line


def _keys_to(index: int, node: yaml.Node) -> Iterator[str]:
    """Yield the keys below a node that lead to the value at ``index`` of the text."""
    for key, _, child in _children(node):
        if child.start_mark.index <= index < child.end_mark.index:
            yield key
            yield from _keys_to(index, child)
            return


def _children(node: yaml.Node) -> list[tuple[str, yaml.Node, yaml.Node]]:
    """Return the keys below a node as messages write them, each with its place and its value."""
    if isinstance(node, yaml.MappingNode):
        return [(str(key.value), key, value) for key, value in node.value]
    if isinstance(node, yaml.SequenceNode):
        return [(f"[{number}]", value, value) for number, value in enumerate(node.value)]
    return []


def _is_indented_by_tabs(text: str, line: int) -> bool:
    """Return whether a line's indentation has a tab. Lines count from 0."""
    line_text = dict(enumerate(text.splitlines())).get(line, "")
    return "\t" in line_text[: len(line_text) - len(line_text.lstrip())]


def _size(node: yaml.Node | None, sizes: dict[int, float]) -> float:
    """Return the number of nodes below a node. Each alias counts as the nodes that it repeats.

    The size of a node that contains itself is infinite.
    """
    if node is None or isinstance(node.value, str):
        return 1
    if id(node) not in sizes:
        sizes[id(node)] = math.inf
        is_mapping = isinstance(node, yaml.MappingNode)
        children = chain.from_iterable(node.value) if is_mapping else node.value
        sizes[id(node)] = 1 + sum(_size(child, sizes) for child in children)
    return sizes[id(node)]
