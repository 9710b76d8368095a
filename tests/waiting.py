"""Waits for what other processes do."""

import time


def wait_until(condition, process, seconds=600, log=None, pause=0.02):
    """Wait until a condition holds. Fails, with the ``log``, if the process ends before that.

    ``pause`` is the time between two looks, in seconds.
    """
    end = time.monotonic() + seconds
    while not condition():
        assert process.poll() is None, log.read_text() if log else f"{process.args} has ended"
        if time.monotonic() > end:
            raise TimeoutError(f"{process.args}: what was waited for is not there yet")
        time.sleep(pause)
