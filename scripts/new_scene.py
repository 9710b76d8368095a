"""Write the scene YAML of your own .blend, model file, or folder of rendered views.

It looks at the file, and describes a rig that fits it. Then it prints the commands that build the
scene. It never overwrites a YAML.
"""

from lightfield.engine.flags import program
from lightfield.stages.scene import NewScene

if __name__ == "__main__":
    program(NewScene, __doc__)
