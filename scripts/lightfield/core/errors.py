"""The exceptions that the programs show to the user without a traceback."""

import errno

# Longer lines are cut in their middle, because they may quote a damaged file.
LONGEST = 2000


class UserError(Exception):
    """An error that the user can mend. The message says what is wrong, where, and what is right.

    It has one line for each mistake, with line breaks and terminal codes in it as escapes.
    """

    def __init__(self, *lines: str) -> None:
        super().__init__("\n".join(map(_printable, lines)))


class OutsideError(UserError):
    """A `UserError` with a cause outside what a job makes: a full disk, a limit, a damaged file.

    The same job may succeed later. So nobody may note it as a fault of a scene or of a model.
    """


# Errors with these numbers do not depend on the content of a file.
_OUTSIDE = {
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EFBIG,
    errno.EROFS,
    errno.EACCES,
    errno.EPERM,
    errno.EMFILE,
    errno.ENFILE,
    errno.ENOMEM,
    errno.EAGAIN,
    errno.EIO,
    errno.ESTALE,
    errno.ETIMEDOUT,
}


def is_outside(error: BaseException) -> bool:
    """Return whether the cause of an error lies outside what a job makes, as in `OutsideError`."""
    if isinstance(error, OSError):
        return error.errno in _OUTSIDE
    return isinstance(error, OutsideError | MemoryError)


def _printable(line: str) -> str:
    if len(line) > LONGEST:
        # The end says what would be right.
        line = f"{line[: LONGEST // 2]}…{line[-LONGEST // 2 :]}"
    return "".join(
        letter if letter.isprintable() else letter.encode("unicode_escape").decode()
        for letter in line
    )


# What the user can do if memory ran out.
LESS_MEMORY = "lower --cores, for fewer shards at once, or resolution"
LESS_GPU_MEMORY = (
    "lower resolution, shrink the scene's textures, end what else uses the GPU, or take device=cpu"
)
