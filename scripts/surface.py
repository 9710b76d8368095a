"""Write the surface that cameras can see as meshes, and the boxes and poses of its objects.

A settings file is JSON: {"formats": ["glb", "ply"], "frame": 1}. `frame`, `scene_name` and
`view_layers` are as in the scene YAML's `scene`. The output folder gets scene.glb, scene.ply and
objects.json, and export.json, which lists them. Earlier meshes in the folder are replaced.
"""

from lightfield.engine.flags import program
from lightfield.stages.exports import WriteSurface

if __name__ == "__main__":
    program(WriteSurface, __doc__)
