"""Reproject views from one lens to another, with the flags of SILVR's reprojection tool.

Lengths are in mm and the angles of lenses in radians, or in degrees as in 120deg; --rotation is in
degrees. Without a flag for the target lens it is that of the source (--no-reproject). Pixels
without a source are black, with alpha 0 in a PNG and depth NaN in an EXR. Of a cube map's faces
those are written of which the source sees anything.

Examples, of the views in garden/exr with garden/lightfield.json beside:

  # a perspective of 90 degrees, in 8 bits
  reproject.py -i garden/exr --input-cfg garden/lightfield.json -o flat --rectilinear 18,36 \\
    --output-resolution 512,512 --png --reinhard 5 --output-cfg flat/lightfield.json
  # the middle 120 degrees of the fisheye, turned 30 degrees to the left, with depth
  reproject.py -i garden/exr --input-cfg garden/lightfield.json -o left --equidistant 120deg \\
    --rotation 30,0,0 --exr --output-cfg left/lightfield.json
  # one photograph of a fisheye of 180 degrees, as the faces of a cube
  reproject.py --single photo.jpg --no-configs 2000,2000 --i-equidistant 180deg -o faces \\
    --cubemap 512 --png
"""

import argparse

from lightfield.core import cli
from lightfield.reprojection import job, pipeline


def main() -> None:
    """Run the program on the command line's arguments."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    job.add_flags(parser)
    pipeline.run(job.Job(parser.parse_args()))


if __name__ == "__main__":
    cli.run(main)
