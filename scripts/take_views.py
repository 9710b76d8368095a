"""Copy files from the view store: the views of shards, and the files of exports.

The arguments are lists that name the files: the records of shards, and the lists of exports. Each
file goes into the dataset of its list. Files that exist already with the same bytes stay. Arguments
that are not lists are ignored.
"""

from lightfield.core.flags import program
from lightfield.stages.publishing import TakeViews

if __name__ == "__main__":
    program(TakeViews, __doc__)
