"""Find places for the cameras of a random rig that have free space around them.

A settings file is JSON: {"rig": {"type": "random", "count": 9, "clearance": 0.5, "size": 4}}. `rig`
has the keys of the scene YAML. `frame`, `scene_name` and `view_layers` are as in the scene YAML's
`scene`.
"""

from lightfield.engine.flags import program
from lightfield.stages.rig import FreePlaces

if __name__ == "__main__":
    program(FreePlaces, __doc__)
