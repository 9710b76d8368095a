"""Write the walk of a dataset's page as one file, for a site.

The file contains everything, also the views, and needs no network. It has at most 8 MB.
"""

from lightfield.engine.flags import program
from lightfield.stages.report import ReportWalk

if __name__ == "__main__":
    program(ReportWalk, __doc__)
