"""Make a dataset's page: one file that shows its views, their quality, and their cost.

The file contains everything, also the pictures. So you can read it offline, keep it, and send it.
Missing parts (measurements, depth, costs) are left out without an error. A settings file is JSON
with these keys: `rig`, as in the scene YAML; `yaml`, that file's text; `command`, which builds the
dataset again; `panorama`, whether the overview is a panorama; `measurements`, a list of {"file":
…}, the .csv, .json, .svg and .png that measurements wrote.
"""

from lightfield.engine.flags import program
from lightfield.stages.report import ReportHtml

if __name__ == "__main__":
    program(ReportHtml, __doc__)
