"""Check that a GPU renders the same as the processor, and estimate the hours of full datasets.

A settings file is JSON: {"full": {"LFSphere": {"views": 642, "resolution": [2048, 2048]}}}. `full`
has the size of each dataset whose hours are estimated. Without this file, no hours are estimated.
"""

from lightfield.engine.flags import program
from lightfield.stages.measurement import GpuCheck

if __name__ == "__main__":
    program(GpuCheck, __doc__)
