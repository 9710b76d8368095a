"""Compare a camera's calibration with the true lens, in pixels over the whole frame.

The calibration is a file of OpenCV, Kalibr, COLMAP or nerfstudio, made from a dataset's pictures.
The ray of each pixel goes through the calibrated lens. The error is how far from the pixel it
arrives. See docs/how-to/calibrate-a-camera.md.
"""

from lightfield.engine.flags import program
from lightfield.stages.measurement import EvaluateCalibration

if __name__ == "__main__":
    program(EvaluateCalibration, __doc__)
