"""Find places for the cameras of a random rig that have free space around them.

A settings file is JSON: {"rig": {"type": "random", "count": 9, "clearance": 0.5, "size": 4}}. `rig`
has the keys of the scene YAML. `frame`, `scene_name` and `view_layers` are those of the scene
YAML's `scene`.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run
from lightfield.core.files import write_json


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument(
        "--settings", required=True, type=Path, metavar="JSON", help="settings file"
    )
    parser.add_argument("--inventory", type=Path, help="JSON of what the scene's .blend reads")
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    import bpy

    from lightfield.core.settings import read_settings
    from lightfield.dataset.config import FILE
    from lightfield.dataset.inventory import read_inventory
    from lightfield.dataset.job_settings import FreePlacesSettings
    from lightfield.rendering import blend_file, clearance

    settings = read_settings(FreePlacesSettings, arguments.settings)
    rig = settings.rig
    path = arguments.inventory
    inventory = path and read_inventory(path, "external_files")
    blend_file.open_scene(arguments.blend, settings.model_dump(), inventory)
    if settings.frame != FILE:
        bpy.context.scene.frame_set(settings.frame)
    clearance.show_what_is_rendered()
    places = clearance.free_places(rig)
    write_json(arguments.output, {"box": rig.box, "places": places.tolist()})
    print(f"{len(places)} cameras, each with {rig.clearance:g} m around it")


if __name__ == "__main__":
    run(main)
