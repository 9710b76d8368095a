"""Gives pictures to ffmpeg, one after the other."""

import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from lightfield.core.errors import UserError
from lightfield.core.files import atomic_path


@contextmanager
def encoding(
    path: Path, options: Sequence[str], kind: str = "it"
) -> Iterator[Callable[[bytes], None]]:
    """Yield a function that gives bytes to ffmpeg, which writes a file from them.

    ``options`` are those of ffmpeg, which read from "-". ``kind`` says what it writes, for errors.
    The file appears when the block ends without an error. Raises `UserError` if ffmpeg is missing,
    or cannot write the file.
    """
    with atomic_path(path) as temporary:
        command = ["ffmpeg", "-v", "error", "-y", *options, str(temporary)]
        try:
            ffmpeg = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
        except FileNotFoundError:
            raise UserError(f"{path}: a video needs ffmpeg, which is not installed") from None

        def finish() -> None:
            _, messages = ffmpeg.communicate()
            if ffmpeg.returncode:
                problem = " ".join(messages.decode(errors="replace").split())
                raise UserError(f"{path}: ffmpeg cannot write {kind}: {problem}")

        def add(content: bytes) -> None:
            assert ffmpeg.stdin
            try:
                ffmpeg.stdin.write(content)
            except BrokenPipeError:
                finish()

        try:
            yield add
            finish()
        finally:
            ffmpeg.kill()
            ffmpeg.wait()
