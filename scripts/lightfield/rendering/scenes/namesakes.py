"""Finds objects of equal names, and tells them apart in mattes.

Each library has names of its own, and Cycles makes the hashes of a matte from names alone. So a
matte has one entry for two objects of one name. Other names would change the picture: Object Info's
Random depends on the name. So such objects get their full names only while a matte is rendered.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from lightfield.rendering.scenes.ids import has_no_surface
from lightfield.rendering.scenes.render_graph import in_render


def shown() -> list[Any]:
    """Return the objects of the open scene that another object shares its name with."""
    objects = in_render(_objects)
    count = Counter(str(obj.name) for obj in objects)
    return [obj for obj in objects if count[str(obj.name)] > 1]


def _objects(depsgraph: Any) -> set[Any]:
    originals = {entry.object.original for entry in depsgraph.object_instances}
    return {obj for obj in originals if not has_no_surface(obj)}


@contextmanager
def under_full_names(objects: Iterable[Any]) -> Iterator[None]:
    """Give ``objects`` their full names for a while, as in ``Cube [library.blend]``."""
    names = {obj: str(obj.name) for obj in objects}
    try:
        for obj in names:
            obj.rename(str(obj.name_full))
        yield
    finally:
        for obj, name in names.items():
            obj.rename(name)
