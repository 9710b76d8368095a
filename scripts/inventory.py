"""List what a scene contains, and what its rendering can leave out.

Missing or unreadable files are reported as an error, before they turn views pink. For a user's
.blend, it prints which settings the dataset uses and which it ignores.
"""

from lightfield.engine.flags import program
from lightfield.stages.scene import Inventory

if __name__ == "__main__":
    program(Inventory, __doc__)
