"""The one exception that the programs show to the user without a traceback."""

# Longer messages are cut, because they may quote a damaged file.
LONGEST = 2000


class UserError(Exception):
    """An error that the user can mend. The message says what is wrong, where, and what is right.

    It is always one line, with line breaks and terminal codes as escapes.
    """

    def __init__(self, message: str) -> None:
        line = "".join(
            letter if letter.isprintable() else letter.encode("unicode_escape").decode()
            for letter in message[:LONGEST]
        )
        super().__init__(line + ("…" if len(message) > LONGEST else ""))


# What the user can do if memory ran out.
LESS_MEMORY = "lower --cores, for fewer shards at once, or resolution"
LESS_GPU_MEMORY = (
    "lower resolution, shrink the scene's textures, end what else uses the GPU, or take device=cpu"
)
