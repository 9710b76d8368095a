"""Estimate the time and size of a dataset's views from a few small views with all samples."""

from lightfield.engine.flags import program
from lightfield.stages.measurement import Probe

if __name__ == "__main__":
    program(Probe, __doc__)
