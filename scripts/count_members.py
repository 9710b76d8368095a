"""Count the members of a family that are built. List those that failed, and fail if there are any.

The settings file is JSON: {"family": "chairs"}.
"""

from lightfield.engine.flags import program
from lightfield.stages.family import CountMembers

if __name__ == "__main__":
    program(CountMembers, __doc__)
