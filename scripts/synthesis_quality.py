"""Measure how well held-out views are synthesised from a dataset: a CSV and a plot.

The truth is other datasets of the scene, with cameras between the dataset's cameras. Without such
datasets it is the test views of the dataset's own split. OUTPUT.csv has a row for each variant,
view and region. If the truth has all parts of its light as passes, each kind of light is a region.
OUTPUT.svg and OUTPUT.png show the quality over the number and the bytes of the views used.
"""

from lightfield.engine.flags import program
from lightfield.stages.measurement import SynthesisQuality

if __name__ == "__main__":
    program(SynthesisQuality, __doc__)
