"""Compute the optical flow from views of a dataset to their neighbours. Keep finished files.

scripts/make_lightfield.py has chosen the neighbour of each frame in lightfield.json. The output
FOLDER/<view>_to_<other>.exr has channels X and Y, in pixels to the right and down. Channel V is 1
where the other view sees the same point. All three are 0 where the other view has no ray to the
point.
"""

from lightfield.engine.flags import program
from lightfield.stages.views import ComputeFlow

if __name__ == "__main__":
    program(ComputeFlow, __doc__)
