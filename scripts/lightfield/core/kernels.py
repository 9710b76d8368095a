"""Loops over pixels, compiled by numba."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar, cast


@contextmanager
def _hidden(*names: str) -> Iterator[None]:
    """Let what is imported in here not find these modules, not even those that are loaded."""
    loaded = {name: sys.modules[name] for name in names if name in sys.modules}
    sys.modules.update(dict.fromkeys(names))  # type: ignore[arg-type]
    yield
    for name in names:
        del sys.modules[name]
    sys.modules.update(loaded)


# Numba looks for options in YAML, for scipy's version, and in the module that its first kernel
# imports for scipy's BLAS, which takes longer to import than numba. No kernel needs any of them.
# Options in the folder where a program runs could even change what kernels compute.
with _hidden("scipy", "scipy.linalg.cython_blas", "yaml"):
    import numba
    import numba.np.arraymath
    from numba.extending import register_jitable

_F = TypeVar("_F", bound=Callable[..., Any])

# Infinities and NaNs keep their meaning: only contraction and the sign of zero are relaxed, and
# dividing by zero gives one of them.
_OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": {"contract", "nsz"}}


def kernel(function: _F) -> _F:
    """Compile a function, and keep the machine code for the next process.

    It is compiled anew when its own file changes, and not when another one does: what a kernel
    calls belongs into its file.
    """
    return cast(_F, numba.njit(cache=True, **_OPTIONS)(function))


def inline(function: _F) -> _F:
    """Compile a function into each of the kernels that call it."""
    return cast(_F, numba.njit(inline="always", **_OPTIONS)(function))


def part(function: _F) -> _F:
    """Let kernels call a function, which itself stays one of Python's.

    So a kernel that is made in a function may be given it, and is kept for the next process all
    the same.
    """
    return cast(_F, register_jitable(**_OPTIONS)(function))
