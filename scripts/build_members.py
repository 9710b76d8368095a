"""Build a batch of a family's members: all their datasets, one member after the other.

Each member starts from a clean Blender file. A member that fails is recorded with its cause, and
the others are built. A finished member whose files are intact is kept.

A settings file is JSON: {"family": "chairs", "scene": {…}, "members": [{"name": "0007", "seed":
7}]}. `scene` and `values` come from the family's scene YAML.
"""

from lightfield.engine.flags import program
from lightfield.stages.family import BuildMembers

if __name__ == "__main__":
    program(BuildMembers, __doc__)
