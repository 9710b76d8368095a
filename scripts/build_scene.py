"""Build a scene with one of the builders in scripts/scenes/ and save it as a .blend.

A settings file is JSON: {"builder": "garden", "parameters": {"seed": 0, "detail": 0.5}}.
"""

from lightfield.engine.flags import program
from lightfield.stages.scene import BuildScene

if __name__ == "__main__":
    program(BuildScene, __doc__)
