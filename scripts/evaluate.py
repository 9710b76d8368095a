"""Compare renders of a dataset's test views with the truth. Write errors as CSV, and a page.

RENDERS has <view>.png or <view>.exr for each test view of the dataset's split. Without a split, an
eighth of the views tests. RENDERS may also have normal/<view>.exr. The rig's name may precede each
view's, as in exports: <rig>_<view>.png. See docs/how-to/evaluate-renders.md.
"""

from lightfield.engine.flags import program
from lightfield.stages.measurement import Evaluate

if __name__ == "__main__":
    program(Evaluate, __doc__)
