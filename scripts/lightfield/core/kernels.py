"""Loops over pixels, compiled by numba."""

import sys
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba.extending import register_jitable

# When this module of numba's is imported, by the first kernel that runs, it looks for scipy's BLAS,
# which no kernel calls and which takes longer to import than numba. So it does not find it.
_BLAS = "scipy.linalg.cython_blas"
if _BLAS not in sys.modules:
    sys.modules[_BLAS] = None  # type: ignore[assignment]
    import numba.np.arraymath

    del sys.modules[_BLAS]

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
