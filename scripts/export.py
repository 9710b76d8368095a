"""Export a dataset's views for other programs: COLMAP, nerfstudio, NeRF-synthetic, and others.

A settings file is JSON: {"options": {"sources": ["perspective"], "points": 50000}, "suffix":
".png"}. `options` has the keys of the scene YAML's `exports`, with one source. `suffix` is the
suffix of the source's views, by default .exr. `tested_by` maps rigs to the folders of datasets
whose views test what is trained on these. An export of a sequence reads the folder of a rig, and
`frames` lists the folders of the frames in it. An earlier export in the same folder is replaced.
"""

from lightfield.engine.flags import program
from lightfield.stages.exports import ExportViews

if __name__ == "__main__":
    program(ExportViews, __doc__)
