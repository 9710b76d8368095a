"""The one exception that the programs show to the user without a traceback."""

# Longer lines are cut in their middle, because they may quote a damaged file.
LONGEST = 2000


class UserError(Exception):
    """An error that the user can mend. The message says what is wrong, where, and what is right.

    It has one line for each mistake, with line breaks and terminal codes in it as escapes.
    """

    def __init__(self, *lines: str) -> None:
        super().__init__("\n".join(map(_printable, lines)))


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
