"""Print the progress of the chosen datasets, also while a build runs.

The receipts of the shards say which views are finished, and how long each took. The time left
assumes that rendering continues as in the last ten minutes: with as many processes, and as many
seconds for each view.
"""

from lightfield.engine.flags import program
from lightfield.stages.checks import Status

if __name__ == "__main__":
    program(Status, __doc__)
