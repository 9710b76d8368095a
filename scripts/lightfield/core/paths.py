"""Finds the files below a folder, and checks the paths that files name.

A link to a folder counts as the folder: many people keep images on another disk.
"""

import os
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from lightfield.core.errors import UserError
from lightfield.core.files import absolute_path, read_error


def files_below(folder: Path, *, strict: bool = True) -> Iterator[Path]:
    """Yield the files in a folder and in its subfolders, in the order of their paths.

    Follows links. Leaves out what Python compiles beside the read.py of a package. Raises
    `UserError` for a folder that cannot be read, and for a link to a folder that it lies in. If not
    ``strict``, leaves both out.
    """
    return _files_below(folder, [folder.resolve()], strict)


def _files_below(folder: Path, real_folders: list[Path], strict: bool) -> Iterator[Path]:
    """Yield the files below a folder. ``real_folders`` are it and its parents, without links."""
    try:
        with os.scandir(folder) as listing:
            entries = sorted(listing, key=lambda entry: entry.name)
    except FileNotFoundError:
        return
    except OSError as error:
        if strict:
            raise read_error(folder, error) from None
        return
    for entry in entries:
        path = folder / entry.name
        # A link to itself is neither a folder nor a file, but raises an error.
        is_folder = is_file = False
        with suppress(OSError):
            is_folder = entry.is_dir()
            is_file = entry.is_file()
        if is_file:
            yield path
        elif is_folder and entry.name != "__pycache__":
            real_path = real_folders[-1] / entry.name
            if entry.is_symlink():
                real_path = path.resolve()
                if any(parent.is_relative_to(real_path) for parent in real_folders):
                    if strict:
                        raise UserError(f"{path}: is a link to a folder that it lies in; remove it")
                    continue
            yield from _files_below(path, [*real_folders, real_path], strict)


def case_hint(path: Path) -> str:
    """Return which existing path differs from a missing one only in the case of letters.

    It is a remark in brackets. "" if there is no such path.
    """
    other = _in_other_case(path)
    return f" ({other} differs only in case)" if other not in (None, path) else ""


def _in_other_case(path: Path) -> Path | None:
    """Return the path itself if it exists, or else one that differs from it only in case."""
    # Path.exists() raises for a path that is too long.
    if os.path.exists(path):  # noqa: PTH110
        return path
    folder = _in_other_case(path.parent) if path.parent != path else None
    with suppress(OSError):
        for name in sorted(os.listdir(folder) if folder else []):  # noqa: PTH208, only names
            if folder and name.casefold() == path.name.casefold():
                return folder / name
    return None


def link_above(folder: Path, name: str) -> str | None:
    """Return the first link that leads from a folder to the file ``name`` in it. None without one.

    The file itself may be a link, which does not count.
    """
    for parent in reversed(Path(name).parents[:-1]):
        if (folder / parent).is_symlink():
            return parent.as_posix()
    return None


def stray_places(
    folder: Path, strays: Iterable[str], own_files: Iterable[str], own_folders: Iterable[str] = ()
) -> list[str]:
    """Return the ``strays`` in a folder. A foreign link stands for all strays behind it.

    A link is foreign if none of ``own_files`` lies behind it, and if it is none of ``own_folders``.
    """
    parents = {Path(name).parent for name in own_files}
    own_links = {*own_folders, *(link_above(folder, f"{parent}/file") for parent in parents)}
    places = []
    for name in strays:
        link = link_above(folder, name)
        places.append(name if link is None or link in own_links else link)
    return list(dict.fromkeys(places))


def kept_behind_link(folder: Path, name: str) -> str:
    """Return the end of a message about a stray file in ``folder``, if a link leads to it.

    Nobody moves such a file, because others may use the folder that the link leads to.
    """
    link = link_above(folder, name)
    return (
        f"; remove it, because nothing is moved out of the folder that {link} links to"
        if link
        else ""
    )


def place_in(folder: Path, path: Path) -> Path | None:
    """Return a path relative to a folder. None if it does not lie in it.

    Both may be given through different links. Links below the folder count as folders.
    """
    for form in (absolute_path(path), path.resolve()):
        for parent in (form, *form.parents):
            with suppress(OSError):
                if parent.samefile(folder):
                    return form.relative_to(parent)
    return None


def leads_inside(name: Any) -> bool:
    """Return whether a path that a file names leads from a folder to something below it."""
    if not isinstance(name, str) or "\0" in name or name.startswith("/"):
        return False
    parts = Path(name).parts
    return bool(parts) and ".." not in parts


def lies_below(name: Any, folders: Iterable[str | Path]) -> bool:
    """Return whether a path that a file names is in normal form, and leads below a folder.

    It may be one of several ``folders``. All paths are from the present folder, or from the root.
    """
    return is_normal(name) and name.startswith(tuple(f"{folder}/" for folder in folders))


def is_normal(name: Any) -> bool:
    """Return whether a path that a file names is a path in normal form.

    Any other form could lead out of a folder with which it begins.
    """
    return isinstance(name, str) and "\0" not in name and os.path.normpath(name) == name


def check_inside(name: Any, where: str) -> None:
    """Raise `UserError`, which says ``where`` a path stands, unless it leads inside a folder."""
    if not leads_inside(name):
        raise UserError(
            f"{where}: is {name!r}; must be the path of a file in its folder, without .."
        )


def inside(folder: Path, name: Any, where: str) -> Path:
    """Return the path of a file below ``folder`` that another file names.

    Every path from a file that is then written, moved, published or opened goes through here. Links
    below the folder are followed: they are the user's, because no program takes or unpacks one.
    Raises `UserError`, which says ``where`` the name stands, for a name that leads elsewhere.
    """
    check_inside(name, where)
    return folder / str(name)
