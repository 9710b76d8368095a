"""Remove the members that families no longer have, and datasets of rigs that they no longer have.

`snakemake prune` builds the chosen families, and then runs this. All that they have stays.
"""

from lightfield.engine.flags import program
from lightfield.stages.family import Prune

if __name__ == "__main__":
    program(Prune, __doc__)
