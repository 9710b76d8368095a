"""What a terminal shows after Ctrl-C, and of letters that its encoding lacks."""

import io
import signal
import sys
import time
from types import FrameType, TracebackType

# Seconds. A further Ctrl-C within this time means the same as the one before.
_PATIENCE = 10.0
# When Ctrl-C last interrupted this process. None without one.
_interrupted: float | None = None


def print_everywhere() -> None:
    """Print a letter that the terminal's encoding lacks as its code, in place of an error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.encoding.lower() != "utf-8":
            stream.reconfigure(errors="backslashreplace")


def report_interrupts() -> None:
    """Let an interrupted process end with one line in place of a traceback."""
    sys.excepthook = _report


def _report(
    kind: type[BaseException], error: BaseException, traceback: TracebackType | None
) -> None:
    if issubclass(kind, KeyboardInterrupt):
        print("error: interrupted", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, traceback)


def interrupt_once() -> None:
    """Ignore a second Ctrl-C soon after the first: it would interrupt how the process ends."""
    report_interrupts()
    signal.signal(signal.SIGINT, _interrupt)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    global _interrupted
    now = time.monotonic()
    is_repeated = _interrupted is not None and now < _interrupted + _PATIENCE
    if not is_repeated:
        _interrupted = now
        raise KeyboardInterrupt


def was_interrupted() -> bool:
    """Return whether Ctrl-C has interrupted this process, which called `interrupt_once`."""
    return _interrupted is not None
