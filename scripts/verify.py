"""Check every byte of datasets against the checksums of their files.

Prints a line for each file that is damaged or missing, or that is not of the dataset. The exit
status is then 1. For a copy of a dataset, DATASET is enough: its sha256sums.txt has the checksums.
With --work, the receipts of the jobs count, which also have the files that the dataset was made
from. The folder of a sequence stands for all its frames and their exports. The folder of a family
stands for its corpus: its page, its shards, and all datasets of its members.
"""

from lightfield.engine.flags import program
from lightfield.stages.checks import Verify

if __name__ == "__main__":
    program(Verify, __doc__)
