"""Find the corners of calibration boards in the views of a dataset. Write them as JSON.

The boards are the block `targets` of the scene, as lightfield.json has it. A corner is visible if
it is in the frame, if the board's front faces the camera, and if no surface is in between. See
docs/how-to/calibrate-a-camera.md.
"""

from lightfield.engine.flags import program
from lightfield.stages.rig import FindCorners

if __name__ == "__main__":
    program(FindCorners, __doc__)
