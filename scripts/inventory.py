"""List what a scene contains, and from that what its rendering can leave out.

Missing textures and linked libraries are errors here, before anything is rendered pink.
"""

import argparse
import sys
from pathlib import Path

import bpy

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.rendering import blend_file, pruning, scene_memory
from lightfield.rendering.inventory import FEATURES, inventory


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()

    blend_file.open_scene(arguments.blend)
    if bpy.app.autoexec_fail:
        print(
            f"warning: {arguments.blend}: holds scripts or scripted drivers, which are not run: "
            f"{bpy.app.autoexec_fail_message}",
            file=sys.stderr,
        )
    found = inventory()
    missing = found.pop("missing")
    if missing:
        raise UserError(
            f"{arguments.blend}: {len(missing)} files that it shows are not there: "
            f"{'; '.join(missing[:8])}{' …' if len(missing) > 8 else ''}; put them there, or pack "
            "them into the .blend (in Blender: File, External Data)"
        )
    if found["external_files"]:
        print(
            f"warning: {arguments.blend}: reads {len(found['external_files'])} other files, which "
            "no checksum covers; pack them into the .blend",
            file=sys.stderr,
        )
    leave_out = pruning.left_out(found)
    found["left_out"] = leave_out
    # Of what is open here nothing is left, for it to be rendered in the same memory.
    blend_file.new_scene()
    found["memory_bytes"] = scene_memory.measure(arguments.blend, found)
    write_json(arguments.output, found)
    print(
        f"{found['objects']} objects, {found['triangles']} triangles, with instances "
        f"{found['triangles_with_instances']}; {', '.join(n for n in FEATURES if found[n])}"
    )
    for name in leave_out:
        print(f"left out: {name}: {pruning.REASONS[name]}")


if __name__ == "__main__":
    run(main)
