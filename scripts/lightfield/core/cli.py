"""How every program in scripts/ ends: normally, or with one line that the user can act on."""

import os
import sys
from collections.abc import Callable

from lightfield.core.errors import UserError


def run(main: Callable[[], None]) -> None:
    """Run ``main``; a `UserError` becomes ``error: …`` on standard error and exit status 1."""
    try:
        main()
    except UserError as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        sys.exit("error: interrupted")
    except BrokenPipeError:
        # The reader of our output left (as `head` does): say nothing more, not even at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
