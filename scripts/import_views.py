"""Import views that somebody else has rendered: link or copy them, and record them."""

from lightfield.engine.flags import program
from lightfield.stages.views import ImportViews

if __name__ == "__main__":
    program(ImportViews, __doc__)
