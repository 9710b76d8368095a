"""Choose the cheapest method that reaches a scene's target error.

Each method (plain, adaptive, denoised, both) renders windows of some views with ever more effort,
until it reaches the target. Its effort is then interpolated to meet the target exactly. The
cheapest method is chosen. Held-out views, the nearest others with another seed, confirm it.
"""

from lightfield.engine.flags import program
from lightfield.stages.measurement import Calibrate

if __name__ == "__main__":
    program(Calibrate, __doc__)
