"""Download the .blend of a scene YAML. Continue where an earlier download was interrupted.

The file has the suffix .part until it is complete and has the SHA-256 that the scene YAML or its
lock file gives.
"""

from lightfield.engine.flags import program
from lightfield.stages.scene import FetchBlend

if __name__ == "__main__":
    program(FetchBlend, __doc__)
