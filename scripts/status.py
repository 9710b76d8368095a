"""Print the progress of the chosen datasets, also while a build runs.

Only the datasets' files are read. The time left assumes that rendering continues as in the last ten
minutes: with as many processes, and as many seconds for each view. The journals of the shards
record both.
"""

from lightfield.core.flags import program
from lightfield.stages.checks import Status

if __name__ == "__main__":
    program(Status, __doc__)
