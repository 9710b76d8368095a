"""Find places for the cameras of a random rig that have free space around them."""

import argparse
import json
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.core.settings import checked
from lightfield.dataset import config
from lightfield.dataset.inventory import read_inventory
from lightfield.geometry import rigs
from lightfield.geometry.rigs.rig import Frame
from lightfield.rendering import blend_file, clearance

# isort: split
import bpy
from pydantic import TypeAdapter


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--rig", required=True, type=json.loads, help="the rig's settings, as JSON")
    parser.add_argument("--scene", help="name of a file in configs/scenes/, for what it chooses")
    parser.add_argument("--frame", default="1", help="a number, or file: the .blend's own")
    parser.add_argument("--inventory", type=Path, help="JSON of what the scene's .blend reads")
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()

    rig = rigs.from_settings(arguments.rig)
    if not isinstance(rig, rigs.Random):
        raise UserError(f"--rig: type: is {rig.type}; must be random")
    chosen = config.load_scene(arguments.scene).scene.model_dump() if arguments.scene else {}
    path = arguments.inventory
    inventory = path and read_inventory(path, "external_files")
    blend_file.open_scene(arguments.blend, chosen, inventory)
    if arguments.frame != config.FILE:
        bpy.context.scene.frame_set(checked(TypeAdapter(Frame), arguments.frame, "--frame"))
    clearance.show_what_is_rendered()
    places = clearance.free_places(rig)
    write_json(arguments.output, {"box": rig.box, "places": places.tolist()})
    print(f"{len(places)} cameras, each with {rig.clearance:g} m around it")


if __name__ == "__main__":
    run(main)
