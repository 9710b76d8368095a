"""Publish the checksums of a valid dataset. Fail with the first reasons if it is not valid.

The checksums are those in the receipts of the jobs that made the files.
"""

from lightfield.engine.flags import program
from lightfield.stages.publishing import PublishChecksums

if __name__ == "__main__":
    program(PublishChecksums, __doc__)
