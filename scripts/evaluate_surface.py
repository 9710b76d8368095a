"""Compare a reconstructed surface with the true one, by the metrics of a benchmark.

Both are meshes or point clouds: PLY, OBJ, STL, or glTF. Units are metres. Both must be in the
dataset's coordinates, Z up. glTF is turned, because it has Y up. See
docs/how-to/evaluate-surfaces.md.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import above_zero, positive, run
from lightfield.core.errors import UserError

PROTOCOLS = {
    "dtu": ("spacing", "most_distance"),
    "nerf_synthetic": ("points",),
    "tanks_and_temples": ("tau",),
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("candidate", type=Path, metavar="SURFACE", help="the reconstructed surface")
    add("--reference", type=Path, required=True, help="the true surface")
    add(
        "--protocol",
        choices=list(PROTOCOLS),
        required=True,
        help="benchmark whose definition of the metrics is used",
    )
    add(
        "--spacing",
        type=above_zero,
        help="for dtu: distance between sampled points, in metres (default: 0.0002)",
    )
    add(
        "--most-distance",
        type=above_zero,
        help="for dtu: distance in metres beyond which a point is ignored (default: 0.02)",
    )
    add(
        "--points",
        type=positive,
        help="for nerf_synthetic: number of points sampled on each surface (default: 2500000)",
    )
    add(
        "--tau",
        type=above_zero,
        help="for tanks_and_temples: distance in metres below which a point counts as correct",
    )
    add("--output", type=Path, help="JSON to write")
    arguments = parser.parse_args()
    options = check_options(arguments)

    # Only now, so that --help need not wait for these.
    from lightfield.core.files import keep_apart, write_json
    from lightfield.measurement import surfaces

    if arguments.output:
        keep_apart("--output", arguments.output, arguments.candidate, arguments.reference)
    candidate = surfaces.read_surface(arguments.candidate)
    reference = surfaces.read_surface(arguments.reference)
    match arguments.protocol:
        case "dtu":
            figures = surfaces.dtu(candidate, reference, **options)
        case "nerf_synthetic":
            count = options.get("points", surfaces.NERF_SYNTHETIC_POINTS)
            figures = surfaces.nerf_synthetic(candidate, reference, count)
        case _:
            figures = surfaces.tanks_and_temples(candidate, reference, **options)
    if arguments.output:
        content = {"protocol": arguments.protocol, **options, **figures}
        write_json(arguments.output, content)
    print(", ".join(f"{name} {value:.6g}" for name, value in figures.items()))


def check_options(arguments: argparse.Namespace) -> dict[str, float]:
    """Return the given options of the protocol. Raises `UserError` for those of another one."""
    options = {}
    for protocol, names in PROTOCOLS.items():
        for name in names:
            value = getattr(arguments, name)
            if value is None:
                continue
            if protocol != arguments.protocol:
                flag = name.replace("_", "-")
                raise UserError(f"--{flag}: is only for --protocol {protocol}")
            options[name] = value
    if arguments.protocol == "tanks_and_temples" and "tau" not in options:
        raise UserError("--tau: is missing; the benchmark has 0.003 to 0.025 m, by the scene")
    return options


if __name__ == "__main__":
    run(main)
