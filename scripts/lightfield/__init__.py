"""The Plenoforge library: lenses, rigs, depth, resampling, images and records of light fields.

`open_dataset` and `open_corpus` read finished datasets.
"""

from typing import TYPE_CHECKING, Any

from lightfield.core.isolation import isolate

# Before a program imports what a variable could change.
isolate()

if TYPE_CHECKING:
    from lightfield.reading.opening import open_corpus, open_dataset

__all__ = ["open_corpus", "open_dataset"]


def __getattr__(name: str) -> Any:
    """Import the reader when it is first used. Programs import this module before all others."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from lightfield.reading import opening

    return getattr(opening, name)
