"""List which views of a scene's rigs are for training, validation and testing."""

from lightfield.engine.flags import program
from lightfield.stages.views import ListSplits

if __name__ == "__main__":
    program(ListSplits, __doc__)
