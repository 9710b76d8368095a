"""Draw a dataset's pictures: an overview, the contact sheet, its rig in 3D, depth and noise.

Writes overview.png, contact_sheet.png, and rig, depth and noise as .svg and .png, into --output.
A settings file is JSON: {"rig": {"type": "plane", "cameras": [2, 2], …}}, as in the scene YAML.
"""

from lightfield.engine.flags import program
from lightfield.stages.report import ReportFigures

if __name__ == "__main__":
    program(ReportFigures, __doc__)
