"""Publish the checksums of a valid dataset. Fail with the first reasons if it is not valid.

The checksums of an invalid dataset are removed, so that the next run validates it again.
"""

from lightfield.core.flags import program
from lightfield.stages.publishing import PublishChecksums

if __name__ == "__main__":
    program(PublishChecksums, __doc__)
