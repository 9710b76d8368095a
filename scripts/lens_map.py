"""Compute a lens map once, for reproject.py --lens-map to apply to every view of a rig.

Takes the same flags for the geometry as reproject.py. With --cubemap it writes a map for each
face, FILE's name with _f, _b, _l, _r, _u or _d before the suffix.
"""

import argparse
from pathlib import Path

from lightfield.core import cli
from lightfield.reprojection import lens_map
from lightfield.reprojection.lens_arguments import add_geometry_flags, geometry


def main() -> None:
    """Run the program on the command line's arguments."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path, metavar="FILE", help="lens map to write, .npy")
    add_geometry_flags(parser)
    arguments = parser.parse_args()
    work = geometry(arguments)
    path: Path = arguments.file
    maps = [work.compute(target) for target in work.targets]
    lens_map.report(maps)
    for target, made in zip(work.targets, maps, strict=True):
        lens_map.save(path.with_name(path.stem + target.suffix + path.suffix), made)


if __name__ == "__main__":
    cli.run(main)
