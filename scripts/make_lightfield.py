"""Write a dataset's lightfield.json: its lens, the poses of its views, and how it is rendered.

The workflow gives a settings file, in which the limits of the preset are already applied. By hand,
give --scene and --rig instead, for a dataset at full size.
"""

from lightfield.engine.flags import program
from lightfield.stages.rig import MakeLightfield

if __name__ == "__main__":
    program(MakeLightfield, __doc__)
