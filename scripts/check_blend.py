"""Check that a .blend has the SHA-256 that is recorded for its scene.

A scene YAML with the address of a download may have its SHA-256. Otherwise, the first use records
it beside the YAML in a lock file, configs/scenes/<scene>.lock.json. Later files must have the same
SHA-256. To take another file, delete the lock file.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import sha256, write_json


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scene", required=True, help="name of a file in configs/scenes/")
    parser.add_argument("--blend", required=True, type=Path, help=".blend to check")
    parser.add_argument(
        "--output",
        required=True,
        type=Path,
        help="JSON to write if the .blend has the right SHA-256",
    )
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from importlib.metadata import version

    from lightfield.configuration import blend_lock, scene_yaml

    source = scene_yaml.load_scene(arguments.scene).scene
    if source.blend is None:
        raise UserError(f"--scene {arguments.scene}: does not use a .blend")
    status = arguments.blend.stat()
    digest = sha256(arguments.blend)
    if lock := blend_lock.expected_blend(arguments.scene, arguments.blend, digest):
        blend_lock.record_blend(arguments.blend, digest, lock)
    write_json(
        arguments.output,
        {
            "sha256": digest,
            "bytes": status.st_size,
            "mtime_ns": status.st_mtime_ns,
            "bpy": version("bpy"),
        },
    )


if __name__ == "__main__":
    run(main)
