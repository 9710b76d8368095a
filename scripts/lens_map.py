"""Compute a lens map, which reproject.py --lens-map applies to every view of a rig.

Takes the same settings, or the same flags for the geometry, as reproject.py. For a cube map it
writes a map for each face, with _f, _b, _l, _r, _u or _d before FILE's suffix. A face that the
source does not see has a line of text instead of a map.
"""

from lightfield.engine.flags import program
from lightfield.stages.lenses import ComputeLensMap

if __name__ == "__main__":
    program(ComputeLensMap, __doc__)
