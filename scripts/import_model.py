"""Make a scene from a model file in glTF, USD, FBX, OBJ, PLY or STL, and save it as a .blend.

A settings file is JSON: {"model": "chair.glb", "unit": "box", "light": "softboxes"}.
"""

from lightfield.engine.flags import program
from lightfield.stages.scene import ImportModel

if __name__ == "__main__":
    program(ImportModel, __doc__)
