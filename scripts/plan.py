"""Tabulate the views, hours and gigabytes of the chosen datasets on this machine.

Reads what scripts/probe.py measured. Hours count for one processor core, or for the GPU if it
renders. Gigabytes are the size of the rendered views.
"""

from lightfield.engine.flags import program
from lightfield.stages.measurement import Plan

if __name__ == "__main__":
    program(Plan, __doc__)
