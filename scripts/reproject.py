"""Reproject views from one lens to another, with the flags of SILVR's reprojection tool.

Lengths are in mm and the angles of lenses in radians; --rotation is in degrees. Without a flag
for the target lens it is that of the source (--no-reproject). Pixels without a source are black,
with alpha 0 in a PNG and depth NaN in an EXR.
"""

import argparse
import sys

from lightfield.core import cli
from lightfield.reprojection import job, pipeline
from lightfield.reprojection.lens_arguments import joined


def main() -> None:
    """Run the program on the command line's arguments."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    job.add_flags(parser)
    pipeline.run(job.Job(parser.parse_args(joined(sys.argv[1:]))))


if __name__ == "__main__":
    cli.run(main)
