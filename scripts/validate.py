"""Check a whole dataset: its files, its pixels, and that its views see the same world.

Prints a line for each failure. The exit status is then 1.

With --output, which the workflow gives, the exit status is 0 even for an invalid dataset. The
program then writes validation.json. scripts/publish_checksums.py writes the sha256sums.txt of a
valid dataset. Removes an earlier sha256sums.txt first, and the hidden *.tmp files that a killed run
has left.

A settings file is JSON: {"reprojections": ["perspective"], "exports": [], "inputs": []}, for the
flags --reprojection, --exports and --receipts.
"""

from lightfield.engine.flags import program
from lightfield.stages.checks import Validate

if __name__ == "__main__":
    program(Validate, __doc__)
