"""Check that a .blend has the SHA-256 that is recorded for its scene.

A scene YAML with the address of a download may have its SHA-256. Otherwise, the first use records
it beside the YAML in a lock file, configs/scenes/<scene>.lock.json. Later files must have the same
SHA-256. To take another file, delete the lock file.
"""

from lightfield.engine.flags import program
from lightfield.stages.scene import CheckBlend

if __name__ == "__main__":
    program(CheckBlend, __doc__)
