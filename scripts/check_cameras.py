"""Find cameras of a dataset that are inside geometry, or that would show it wrongly.

The workflow runs this before it renders.
"""

from lightfield.engine.flags import program
from lightfield.stages.rig import CheckCameras

if __name__ == "__main__":
    program(CheckCameras, __doc__)
