"""Measure the error of renders against their time: plain, adaptive, guided and denoised.

Also try changes of the scene's settings, such as fewer bounces. The .md and the .json say which of
them reach the same error in less time.
"""

from lightfield.engine.flags import program
from lightfield.stages.measurement import ErrorVsTime

if __name__ == "__main__":
    program(ErrorVsTime, __doc__)
