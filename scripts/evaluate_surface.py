"""Compare a reconstructed surface with the true one, by the metrics of a benchmark.

Both are meshes or point clouds: PLY, OBJ, STL, or glTF. Units are metres. Both must be in the
dataset's coordinates, Z up. glTF is turned, because it has Y up. See
docs/how-to/evaluate-surfaces.md.
"""

from lightfield.engine.flags import program
from lightfield.stages.measurement import EvaluateSurface

if __name__ == "__main__":
    program(EvaluateSurface, __doc__)
