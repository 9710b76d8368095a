"""Make the page with links to the pages of all datasets in a results folder.

The page is one file with thumbnails. It lists every dataset that has a page. The program warns
about datasets whose files cannot be read.
"""

from lightfield.engine.flags import program
from lightfield.stages.report import ReportIndex

if __name__ == "__main__":
    program(ReportIndex, __doc__)
