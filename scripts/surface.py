"""Write the surface that cameras can see as meshes, and the boxes and poses of its objects.

A settings file is JSON: {"formats": ["glb", "ply"], "frame": 1}. `frame`, `scene_name` and
`view_layers` are those of the scene YAML's `scene`. The output folder gets scene.glb, scene.ply and
objects.json, and export.json, which lists them. Earlier meshes in the folder are replaced.
"""

import argparse
from pathlib import Path

from lightfield.core.cli import run


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--blend", required=True, type=Path, help="the scene's .blend")
    parser.add_argument(
        "--settings", required=True, type=Path, metavar="JSON", help="settings file"
    )
    parser.add_argument(
        "--inventory", type=Path, help="JSON that scripts/inventory.py wrote for the scene"
    )
    parser.add_argument(
        "--output", required=True, type=Path, metavar="FOLDER", help="folder to write"
    )
    arguments = parser.parse_args()

    # Only now, so that --help need not wait for these.
    import bpy

    from lightfield import export
    from lightfield.configuration.job_settings import MeshSettings
    from lightfield.configuration.scene_source import FILE
    from lightfield.core.settings import read_settings
    from lightfield.export import mesh
    from lightfield.formats.inventory import read_inventory
    from lightfield.rendering import blend_file, ids, pruning
    from lightfield.rendering.surface import visible_surface

    settings = read_settings(MeshSettings, arguments.settings)
    path = arguments.inventory
    inventory = read_inventory(path, "left_out", "hidden") if path else None
    blend_file.open_scene(arguments.blend, settings.model_dump(), inventory)
    if settings.numbered:
        # The numbers follow from the objects that a render keeps.
        hidden = inventory["hidden"] if inventory else pruning.removable_objects()
        pruning.remove_objects(hidden)
    if settings.frame != FILE:
        bpy.context.scene.frame_set(settings.frame)
    if settings.numbered:
        ids.assign(["object"])
    frame = bpy.context.scene.frame_current
    surface = visible_surface(settings.numbered)
    files = export.replace_folder(
        "mesh",
        {"formats": settings.formats},
        arguments.output,
        lambda folder: mesh.export(surface, settings.formats, frame, folder),
        is_own=export.is_mesh_of_dataset(arguments.output),
    )
    for name, reason in surface.left_out.items():
        print(f"left out: {name}: {reason}")
    triangles = sum(len(surface.meshes[placed.mesh].triangles) for placed in surface.placed)
    print(
        f"{arguments.output}: {len(surface.placed)} objects and instances of "
        f"{len(surface.meshes)} meshes, {triangles} triangles, in {len(files)} files"
    )


if __name__ == "__main__":
    run(main)
