"""List the cameras of a scene's heads, and the views that they take at each place."""

from lightfield.engine.flags import program
from lightfield.stages.views import ListHeads

if __name__ == "__main__":
    program(ListHeads, __doc__)
