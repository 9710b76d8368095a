"""Remove the members that families no longer have: their datasets, other files and receipts.

`snakemake prune` builds the chosen families, and then runs this. Files of present members stay.
"""

from lightfield.engine.flags import program
from lightfield.stages.family import Prune

if __name__ == "__main__":
    program(Prune, __doc__)
