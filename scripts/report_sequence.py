"""Make the page of a sequence, whose frames are datasets in the rig's folder.

The page is one file that shows all frames, plays them, and links to the page of each.
"""

from lightfield.engine.flags import program
from lightfield.stages.report import ReportSequence

if __name__ == "__main__":
    program(ReportSequence, __doc__)
