"""Decorators with which numba compiles loops over pixels."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar, cast


@contextmanager
def _hidden(*names: str) -> Iterator[None]:
    """Hide modules from the imports in this context, even modules that are loaded."""
    loaded = {name: sys.modules[name] for name in names if name in sys.modules}
    sys.modules.update(dict.fromkeys(names))  # type: ignore[arg-type]
    yield
    for name in names:
        del sys.modules[name]
    sys.modules.update(loaded)


# Numba imports YAML for its options, scipy for its version, and scipy's BLAS with its first kernel.
# That takes longer than numba's own import, and no kernel needs any of them. An options file in the
# folder where a program runs could even change what kernels compute.
with _hidden("scipy", "scipy.linalg.cython_blas", "yaml"):
    import numba
    import numba.np.arraymath
    from numba.extending import register_jitable

_F = TypeVar("_F", bound=Callable[..., Any])

# Infinities and NaNs keep their meaning, and dividing by zero gives one of them. Only contraction
# and the sign of zero are relaxed.
_OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": {"contract", "nsz"}}


def kernel(function: _F) -> _F:
    """Compile a function, and keep the machine code for the next process.

    Numba compiles it again only when the function's own file changes. So define the functions that
    a kernel calls in the kernel's file.
    """
    return cast(_F, numba.njit(cache=True, **_OPTIONS)(function))


def inline(function: _F) -> _F:
    """Compile a function into each of the kernels that call it."""
    return cast(_F, numba.njit(inline="always", **_OPTIONS)(function))


def part(function: _F) -> _F:
    """Let kernels call a function, which stays a Python function.

    A kernel that is defined inside a function can then use it, and numba still keeps the kernel's
    machine code for the next process.
    """
    return cast(_F, register_jitable(**_OPTIONS)(function))
