"""Reads the numbers of a long text by its lines, many lines at once."""

import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.rendering.model_references import printable

# Bytes that are read at once.
_PART = 1 << 24
_NEWLINE, _BLANK, _SLASH, _HASH = b"\n /#"


class Lines:
    """Some lines of a text. A backslash at the end of a line continues it."""

    def __init__(self, path: Path, text: bytes, first: int) -> None:
        """Take whole lines of the file at ``path``. ``first`` is the number of their first line."""
        self._path = path
        self._first = first
        self._bytes = np.frombuffer(text, np.uint8)
        ends = np.flatnonzero(self._bytes == _NEWLINE)
        self._starts = np.concatenate([[0], ends[:-1] + 1]).astype(np.int64)
        self._sizes = ends + 1 - self._starts
        words = np.append(np.flatnonzero(self._bytes > _BLANK), len(text))
        # The first word of each line. That of a blank line lies in another line.
        self._words = words[np.searchsorted(words, self._starts)]

    def __len__(self) -> int:
        return len(self._starts)

    def starting_with(self, word: bytes) -> NDArray[np.bool_]:
        """Return which lines (L,) have ``word`` as their first word."""
        is_equal = self._words + len(word) < self._starts + self._sizes
        places = self._words[is_equal]
        for number, byte in enumerate(word):
            is_same = self._bytes[places + number] == byte
            is_equal[is_equal] = is_same
            places = places[is_same]
        is_equal[is_equal] = self._bytes[places + len(word)] <= _BLANK
        return is_equal

    def text(self, line: int | np.integer[Any]) -> bytes:
        """Return a line without blanks around it."""
        start = self._starts[line]
        return self._bytes[start : start + self._sizes[line]].tobytes().strip()

    def numbers(
        self, chosen: NDArray[np.bool_], word: bytes
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the numbers after the first word of lines, and how many each line has.

        ``chosen`` (L,) says which lines, and ``word`` is their first word. What follows a slash in
        a number, or # in a line, is passed over. Raises `UserError` for what is not a number.
        """
        is_kept = np.repeat(chosen, self._sizes)
        for number in range(len(word)):
            is_kept[self._words[chosen] + number] = False
        kept = self._bytes[is_kept]
        kept = _without(kept, _HASH, kept == _NEWLINE)
        kept = _without(kept, _SLASH, kept <= _BLANK)
        is_word = kept > _BLANK
        is_start = is_word & ~np.concatenate([[False], is_word[:-1]])
        ends = np.flatnonzero(kept == _NEWLINE)
        counts = np.diff(np.searchsorted(np.flatnonzero(is_start), ends), prepend=0)
        numbers = _parsed(kept.tobytes())
        if len(numbers) != counts.sum():
            self._refuse(chosen, word)
        return numbers, counts

    def refuse(self, line: int | np.integer[Any], reason: str) -> NoReturn:
        """Raise `UserError` about a line."""
        text = printable(os.fsdecode(self.text(line)[:60]))
        raise UserError(
            f"{self._path}: {reason} in line {self._first + line}: {text!r}; export it again"
        )

    def _refuse(self, chosen: NDArray[np.bool_], word: bytes) -> None:
        for line in np.flatnonzero(chosen):
            for text in self.text(line)[len(word) :].partition(b"#")[0].split():
                if len(_parsed(text.partition(b"/")[0])) != 1:
                    self.refuse(line, "has a value that is not a number")


def read_lines(path: Path) -> Iterator[Lines]:
    """Yield the lines of a text in parts. A continued line is one line."""
    first = 1
    with path.open("rb") as file:
        while text := file.read(_PART):
            text += file.readline()
            while text.endswith((b"\\\n", b"\\\r\n")) and (more := file.readline()):
                text += more
            text += b"" if text.endswith(b"\n") else b"\n"
            count = text.count(b"\n")
            if b"\\" in text:
                text = text.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
            yield Lines(path, text, first)
            first += count


def _without(text: NDArray[np.uint8], mark: int, is_end: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return a text without the bytes from a mark to the next end, which is kept."""
    is_mark = text == mark
    if not is_mark.any():
        return text
    places = np.arange(len(text))
    last_mark = np.maximum.accumulate(np.where(is_mark, places, -1))
    last_end = np.maximum.accumulate(np.where(is_end, places, 0))
    return text[last_mark < last_end]


def _parsed(text: bytes) -> NDArray[np.float64]:
    """Return the numbers of a text up to the first word that is none."""
    with warnings.catch_warnings():
        # This is how numpy reports a word that is no number.
        warnings.simplefilter("ignore", DeprecationWarning)
        try:
            return np.fromstring(text, np.float64, sep=" ")
        except ValueError:
            return np.zeros(0)
