"""Download the .blend of a scene YAML. Continue where an earlier download was interrupted.

The file has the suffix .part until it is complete and has the SHA-256 that the scene YAML or its
lock file gives.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", required=True, help="name of a file in configs/scenes/")
    parser.add_argument("--output", required=True, type=Path, help=".blend to write")
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    from lightfield.configuration import blend_lock, scene_yaml
    from lightfield.core import download

    source = scene_yaml.load_scene(arguments.scene).scene
    if source.url is None:
        raise UserError(f"configs/scenes/{arguments.scene}.yaml: scene: is missing the key url")
    expected, origin = blend_lock.blend_sha256(arguments.scene, source)
    download.fetch(source.url, arguments.output, expected, str(origin))


if __name__ == "__main__":
    run(main)
