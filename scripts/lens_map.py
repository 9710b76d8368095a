"""Compute a lens map, which reproject.py --lens-map applies to every view of a rig.

Takes the same settings, or the same flags for the geometry, as reproject.py. For a cube map it
writes a map for each face, with _f, _b, _l, _r, _u or _d before FILE's suffix.
"""

import argparse
from pathlib import Path

from lightfield.core import cli
from lightfield.reprojection import flags


def main() -> None:
    """Run the program on the command line's arguments."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path, metavar="FILE", help="lens map to write, .npy")
    flags.add_configuration_flags(parser)
    flags.add_lens_map_flags(parser)
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.reprojection import flag_settings, lens_map
    from lightfield.reprojection.geometry import Geometry

    _, source = flag_settings.read_source(arguments)
    geometry = Geometry.of(flag_settings.lens_map_settings(arguments, source), source)
    path: Path = arguments.file
    maps = [geometry.compute(target) for target in geometry.targets]
    lens_map.report(maps)
    for target, computed in zip(geometry.targets, maps, strict=True):
        lens_map.save(path.with_name(path.stem + target.suffix + path.suffix), computed)


if __name__ == "__main__":
    cli.run(main)
