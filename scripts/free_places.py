"""Find places for the cameras of a random rig that have free space around them."""

import argparse
import json
from pathlib import Path

import bpy

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.geometry import rigs
from lightfield.rendering import blend_file
from lightfield.rendering.clearance import free_places


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--rig", required=True, type=json.loads, help="the rig's settings, as JSON")
    parser.add_argument("--frame", type=int, default=1, help="of the animation (default: 1)")
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()

    rig = rigs.from_settings(arguments.rig)
    if not isinstance(rig, rigs.Random):
        raise UserError(f"--rig: type: is {rig.type}; must be random")
    blend_file.open_scene(arguments.blend)
    bpy.context.scene.frame_set(arguments.frame)
    places = free_places(rig)
    write_json(arguments.output, {"box": rig.box, "places": places.tolist()})
    print(f"{len(places)} cameras, each with {rig.clearance:g} m around it")


if __name__ == "__main__":
    run(main)
