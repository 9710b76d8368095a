"""Say why two datasets differ: in settings, inputs, files and pixels.

A and B are folders of datasets. Either may be a copy, or an unpacked package. The first line names
the cause. Then come all differences, with the largest first. The report and the files that packages
add are not compared. The exit status is 0 for equal datasets, 1 for different ones, and 2 for
trouble.
"""

from lightfield.engine.flags import program
from lightfield.stages.checks import Diff

if __name__ == "__main__":
    program(Diff, __doc__)
