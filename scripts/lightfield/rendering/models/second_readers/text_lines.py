"""Reads the numbers of a long text by its lines, many lines at once."""

import os
import re
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.rendering.models.model_references import printable

# Bytes that are read at once.
_PART = 1 << 24
_NEWLINE, _BLANK, _SLASH, _HASH, _MINUS, _ZERO = b"\n /#-0"
# More digits are no index of a vertex.
_MOST_DIGITS = 18
_INDEX = re.compile(rb"-?\d{1,18}(/.*)?")


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
        # The first word of each line, or the end of a blank line.
        self._words = self._starts.copy()
        indented = np.arange(len(self._words))
        while len(indented := indented[self._is_indented(self._words[indented])]):
            self._words[indented] += 1
        self._initials = self._bytes[self._words]

    def _is_indented(self, places: NDArray[np.int64]) -> NDArray[np.bool_]:
        found = self._bytes[places]
        is_indented: NDArray[np.bool_] = (found <= _BLANK) & (found != _NEWLINE)
        return is_indented

    def __len__(self) -> int:
        return len(self._starts)

    def starting_with(self, word: bytes) -> NDArray[np.bool_]:
        """Return which lines (L,) have ``word`` as their first word."""
        is_equal: NDArray[np.bool_] = self._initials == word[0]
        lines = np.flatnonzero(is_equal)
        for number, byte in enumerate(word[1:], 1):
            lines = lines[self._bytes[self._words[lines] + number] == byte]
        lines = lines[self._bytes[self._words[lines] + len(word)] <= _BLANK]
        is_equal[:] = False
        is_equal[lines] = True
        return is_equal

    def text(self, line: int | np.integer[Any]) -> bytes:
        """Return a line without blanks around it."""
        start = self._starts[line]
        return self._bytes[start : start + self._sizes[line]].tobytes().strip()

    def numbers(
        self, chosen: NDArray[np.bool_], word: bytes
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the numbers after the first word of lines, and how many each line has.

        ``chosen`` (L,) says which lines, and ``word`` is their first word. What follows # is passed
        over. Raises `UserError` for what is not a number.
        """
        text, _, counts = self._values(chosen, word)
        numbers = _parsed(text.tobytes())
        if len(numbers) != counts.sum():
            self._refuse(chosen, word, lambda value: len(_parsed(value)) == 1)
        return numbers, counts

    def all_numbers(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the numbers of all lines, as `numbers` does."""
        return self.numbers(np.ones(len(self), bool), b"")

    def whole_numbers(
        self, chosen: NDArray[np.bool_], word: bytes
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the whole numbers after the first word of lines, as `numbers` does.

        What follows a slash in a value is passed over, too.
        """
        text, starts, counts = self._values(chosen, word)
        is_negative = text[starts] == _MINUS
        places = starts + is_negative
        numbers = np.zeros(len(starts), np.int64)
        left = np.arange(len(starts))
        for _ in range(_MOST_DIGITS):
            digits = text[places[left]] - _ZERO
            is_digit = digits < 10
            left = left[is_digit]
            if not len(left):
                break
            numbers[left] = numbers[left] * 10 + digits[is_digit]
            places[left] += 1
        ends = text[places]
        if not ((places > starts + is_negative) & ((ends <= _BLANK) | (ends == _SLASH))).all():
            self._refuse(chosen, word, _INDEX.fullmatch)
        return np.where(is_negative, -numbers, numbers), counts

    def _values(
        self, chosen: NDArray[np.bool_], word: bytes
    ) -> tuple[NDArray[np.uint8], NDArray[np.int64], NDArray[np.int64]]:
        """Return the text after the first word of lines, where its values start, and their counts.

        Each line keeps its end.
        """
        is_kept = np.repeat(chosen, self._sizes)
        for number in range(len(word)):
            is_kept[self._words[chosen] + number] = False
        text = self._bytes[is_kept]
        if _HASH in text:
            text = np.frombuffer(re.sub(rb"#[^\n]*", b"", text.tobytes()), np.uint8)
        is_word = text > _BLANK
        is_word[1:] &= text[:-1] <= _BLANK
        starts = np.flatnonzero(is_word)
        ends = np.flatnonzero(text == _NEWLINE)
        return text, starts, np.diff(np.searchsorted(starts, ends), prepend=0)

    def refuse(self, line: int | np.integer[Any], reason: str) -> NoReturn:
        """Raise `UserError` about a line."""
        text = printable(os.fsdecode(self.text(line)[:60]))
        raise UserError(
            f"{self._path}: {reason} in line {self._first + line}: {text!r}; export it again"
        )

    def _refuse(
        self, chosen: NDArray[np.bool_], word: bytes, is_right: Callable[[bytes], object]
    ) -> NoReturn:
        """Raise `UserError` about the first line with a value that is wrong."""
        line = next(
            line
            for line in np.flatnonzero(chosen)
            if not all(map(is_right, self.text(line)[len(word) :].partition(b"#")[0].split()))
        )
        self.refuse(line, "has a value that is not a number")


def read_lines(path: Path, place: int = 0, first: int = 1) -> Iterator[Lines]:
    """Yield the lines of a text in parts. A continued line is one line.

    They begin at a ``place`` in bytes, where the line has the number ``first``.
    """
    for text, number in _parts(path, place, first):
        yield Lines(path, text, number)


def lines_with(path: Path, word: bytes) -> Iterator[bytes]:
    """Yield the lines of a text that contain a word."""
    for text, _ in _parts(path, 0, 1):
        place = text.find(word)
        while place >= 0:
            end = text.index(b"\n", place)
            yield text[text.rfind(b"\n", 0, place) + 1 : end]
            place = text.find(word, end)


def _parts(path: Path, place: int, first: int) -> Iterator[tuple[bytes, int]]:
    """Yield whole lines, and the number of their first line."""
    with path.open("rb") as file:
        file.seek(place)
        while text := file.read(_PART):
            text += file.readline()
            while text.endswith((b"\\\n", b"\\\r\n")) and (more := file.readline()):
                text += more
            text += b"" if text.endswith(b"\n") else b"\n"
            count = text.count(b"\n")
            if b"\\" in text:
                text = text.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
            yield text, first
            first += count


def _parsed(text: bytes) -> NDArray[np.float64]:
    """Return the numbers of a text up to the first word that is none."""
    with warnings.catch_warnings():
        # This is how numpy reports a word that is no number.
        warnings.simplefilter("ignore", DeprecationWarning)
        try:
            return np.fromstring(text, np.float64, sep=" ")
        except ValueError:
            return np.zeros(0)
