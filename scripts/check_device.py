"""Check that Cycles can render on a device of this machine."""

from lightfield.engine.flags import program
from lightfield.stages.measurement import CheckDevice

if __name__ == "__main__":
    program(CheckDevice, __doc__)
