"""Functions that programs in scripts/ share: how they exit, and the flag --views."""

import atexit
import gc
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path

from lightfield.core.disk_space import REMEDIES, write_problem
from lightfield.core.errors import LESS_MEMORY, UserError
from lightfield.core.files import read_problem
from lightfield.core.terminal import print_everywhere

# Imports make many objects that are never garbage. Searching them takes a tenth of the time of
# --help. So Python rarely collects garbage from here on, and never at its exit.
gc.set_threshold(100_000)
atexit.register(gc.freeze)


def run(main: Callable[[], None], error_status: int = 1) -> None:
    """Run ``main``. Print a `UserError` as ``error: …`` on standard error, and exit with a status.

    Do the same if memory runs out, or if the system refuses access to a file or folder.
    """
    sys.argv[1:] = map(_as_value, sys.argv[1:])
    print_everywhere()
    try:
        guarded(main)
    except SystemExit as end:
        # Python prints a message, and then exits with status 1.
        if not isinstance(end.code, str) or error_status == 1:
            raise
        print(end.code, file=sys.stderr)
        sys.exit(error_status)


def guarded(main: Callable[[], None]) -> None:
    """Run ``main``, and end as `run` does if it raises an exception."""
    try:
        main()
    except UserError as error:
        sys.exit(f"error: {error}")
    except MemoryError:
        sys.exit(f"error: out of memory: {LESS_MEMORY}")
    except KeyboardInterrupt:
        sys.exit("error: interrupted")
    except BrokenPipeError:
        # The program that read our output has ended, as `head` does: print nothing more.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except OSError as error:
        sys.exit(f"error: {_refusal(error)}")


def _refusal(error: OSError) -> str:
    """Return what the system refused, and what the user can do."""
    path = error.filename if isinstance(error.filename, str) else ""
    if path and Path(path).is_file() and isinstance(error, PermissionError):
        return f"{path}: cannot be read: {read_problem(error)}"
    if error.errno in REMEDIES:
        return f"{f'{path}: ' if path else ''}{write_problem(Path(path), error)}"
    return f"{f'{path}: ' if path else ''}{error.strerror or error}"


def _as_value(word: str) -> str:
    """Return an argument with a blank before it if it is a value like -1e-05, -1,2, -1:2, -90deg.

    Without the blank, argparse takes these for flags. It recognises -1 and -0.5 as values itself.
    """
    return f" {word}" if re.fullmatch(r"-[\d.]+[,:de][\d.,:deg+-]*", word) else word


def view_slice(text: str, count: int) -> slice:
    """Return the slice of ``count`` views that ``--views FIRST:END`` means.

    Both numbers may be left out. Raises `UserError` if it holds no view, or a view that does not
    exist.
    """
    first, colon, end = text.partition(":")
    if colon and (first + end or "0").isdecimal():
        chosen = slice(int(first or 0), int(end or count))
        if chosen.start < chosen.stop <= count:
            return chosen
    raise UserError(f"--views {text}: must be FIRST:END with 0 ≤ FIRST < END ≤ {count}")
