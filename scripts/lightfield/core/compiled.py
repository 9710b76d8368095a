"""Decorators with which numba compiles loops over pixels."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar, cast

from lightfield.core.locks import locked_folder


@contextmanager
def _hidden(*names: str) -> Iterator[None]:
    """Hide modules from the imports in this context, even modules that are loaded."""
    loaded = {name: sys.modules[name] for name in names if name in sys.modules}
    sys.modules.update(dict.fromkeys(names))  # type: ignore[arg-type]
    try:
        yield
    finally:
        for name in names:
            del sys.modules[name]
        sys.modules.update(loaded)


# Numba imports scipy for its version, and YAML for its options. No kernel needs them, and a file of
# options in the folder where a program runs could even change what kernels compute.
with _hidden("scipy", "yaml"):
    import numba
    from numba.core import entrypoints
    from numba.core.caching import FunctionCache
    from numba.core.runtime import rtsys
    from numba.extending import register_jitable

# Numba would look through all installed packages for extensions of its own.
entrypoints._already_initialized = True

_F = TypeVar("_F", bound=Callable[..., Any])

# Infinities and NaNs keep their meaning, and dividing by zero gives one of them. Only contraction
# and the sign of zero are relaxed.
_OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": {"contract", "nsz"}}


class _Cache(FunctionCache):  # type: ignore[misc]
    """Loads a kernel's machine code at once.

    Numba's own cache first loads all types and functions that numba can compile. That takes longer
    than anything else, and only compiling needs them. It also mixes up the kernels of two processes
    that save them at the same time. Its index then names the machine code of other arguments.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the kept machine code for the signature ``sig``. None if there is none."""
        # Numba would import scipy's BLAS, which no kernel needs.
        with _hidden("scipy.linalg.cython_blas"):
            rtsys.initialize(target_context)
            with self._guard_against_spurious_io_errors():
                if loaded := self._load_overload(sig, target_context):
                    return loaded
            target_context.refresh()
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save the machine code for the signature ``sig``."""
        self._impl.locator.ensure_cache_path()
        with locked_folder(self.cache_path):
            super().save_overload(sig, data)


def kernel(function: _F) -> _F:
    """Compile a function, and keep the machine code for the next process.

    Numba compiles it again only when the function's own file changes. So define the functions that
    a kernel calls in the kernel's file.
    """
    dispatcher = numba.njit(**_OPTIONS)(function)
    # Numba's option `cache` does the same with numba's own cache.
    dispatcher._cache = _Cache(function)
    return cast(_F, dispatcher)


def inline(function: _F) -> _F:
    """Compile a function into each of the kernels that call it."""
    return cast(_F, numba.njit(inline="always", **_OPTIONS)(function))


def part(function: _F) -> _F:
    """Let kernels call a function, which stays a Python function.

    A kernel that is defined inside a function can then use it, and numba still keeps the kernel's
    machine code for the next process.
    """
    return cast(_F, register_jitable(**_OPTIONS)(function))
