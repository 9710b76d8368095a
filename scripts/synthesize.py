"""Synthesise views from anywhere in a dataset, from its nearest views and their depth.

OUTPUT gets lightfield.json, exr/<view>.exr (R, G, B, A, and Z as in a dataset) and png/<view>.png.
A surface that no view of the dataset sees is a hole. It gets the colour of its surroundings and of
the surface behind it. In the EXR its alpha is 0, and its Z is NaN.

Examples:

  # the views of the evaluation sphere, from the dataset's views
  synthesize.py results/garden/LFSphere_e100cm_d170cm --output work/walk \\
    --poses results/garden/LFSphere_e100cm_d50cm/lightfield.json
  # a walk: rig.yaml has type: path, count, keys, and a camera, as in a scene YAML
  synthesize.py results/garden/LFSphere_e100cm_d170cm --poses rig.yaml --video --output work/walk
"""

from lightfield.engine.flags import program
from lightfield.stages.synthesis import Synthesize

if __name__ == "__main__":
    program(Synthesize, __doc__)
