"""Copy finished datasets from the storage of their jobs.

A dataset is the folder of a rig, or of a frame. It may also be a folder of published files, or the
.json of an archive, which stands for the archive's parts. Each file is compared with its checksum.
Files that exist already with the same bytes stay. The dataset's page is copied, too.
"""

from lightfield.engine.flags import program
from lightfield.stages.publishing import TakeDataset

if __name__ == "__main__":
    program(TakeDataset, __doc__)
