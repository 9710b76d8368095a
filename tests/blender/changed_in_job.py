"""Runs a program, and flips a byte of a file between the start of its job and the job's work.

The first argument is the file, the second when it is as before: "never", or "after" the work. The
time of modification stays. The third is the program.
"""

import os
import runpy
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))

import lightfield  # noqa: F401
from lightfield.engine.stage import Stage

FILE, UNDONE, PROGRAM = sys.argv[1:4]
sys.argv = sys.argv[3:]
do_work = Stage._do_work


def flip():
    path = Path(FILE)
    status = path.stat()
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def changed(job):
    flip()
    try:
        return do_work(job)
    finally:
        if UNDONE == "after":
            flip()


Stage._do_work = changed
runpy.run_path(PROGRAM, run_name="__main__")
