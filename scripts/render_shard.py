"""Render some views of a dataset in one process. Keep every view that is finished."""

from lightfield.engine.flags import program
from lightfield.stages.views import RenderShard

if __name__ == "__main__":
    program(RenderShard, __doc__)
