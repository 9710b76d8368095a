"""Check the exports of a whole sequence: that each frame has its own cameras, depth and time.

Prints a line for each failure. The exit status is then 1. For a valid sequence, --output writes
validation.json, and --sums the checksums of the exports. The frames are datasets of their own,
which validate.py checks.

A settings file is JSON: {"frames": ["f00001", "f00002"], "exports": []}. Its paths are relative to
the working folder.
"""

from lightfield.engine.flags import program
from lightfield.stages.checks import ValidateSequence

if __name__ == "__main__":
    program(ValidateSequence, __doc__)
