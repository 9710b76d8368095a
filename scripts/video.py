"""Make a video of a dataset: a turntable or a walk, synthesised from its views and their depth.

The settings are `path`, `format`, `seconds` and `height` as in the scene YAML's `video`, and the
dataset's `rig`. The output folder gets turntable.mp4, walk.webp or the like, and export.json, which
lists it. An earlier video in the folder is replaced.
"""

from lightfield.engine.flags import program
from lightfield.stages.report import MakeVideo

if __name__ == "__main__":
    program(MakeVideo, __doc__)
