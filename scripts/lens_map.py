"""Compute a lens map, which reproject.py --lens-map applies to every view of a rig.

Takes the same settings, or the same flags for the geometry, as reproject.py. For a cube map it
writes a map for each face, with _f, _b, _l, _r, _u or _d before FILE's suffix. A face that the
source does not see has a line of text instead of a map.
"""

import argparse
from pathlib import Path

from lightfield.core import cli
from lightfield.reprojection import flags

UNSEEN = "The source does not see this face.\n"


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
    from lightfield.core.files import write_text
    from lightfield.geometry.lenses.cube_map import CUBE_FACES
    from lightfield.reprojection import flag_settings, lens_map
    from lightfield.reprojection.geometry import Geometry

    _, source = flag_settings.read_source(arguments)
    settings = flag_settings.lens_map_settings(arguments, source)
    geometry = Geometry.of(settings, source)
    path: Path = arguments.file
    maps = {target.suffix: geometry.compute(target) for target in geometry.targets}
    lens_map.report(list(maps.values()))
    # The workflow cannot tell which faces are seen, so it expects a file for each.
    suffixes = [f"_{face}" for face in CUBE_FACES] if settings.cube_map else [""]
    for suffix in suffixes:
        file = path.with_name(path.stem + suffix + path.suffix)
        if suffix in maps:
            lens_map.save(file, maps[suffix])
        else:
            write_text(file, UNSEEN)


if __name__ == "__main__":
    cli.run(main)
