"""List what a scene contains, and what its rendering can leave out.

Missing or unreadable files are an error here, before they turn views pink. For a user's .blend it
prints which settings the dataset takes and which it ignores.
"""

import argparse
import os.path
import sys
from pathlib import Path
from typing import Any

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.dataset import blend, config
from lightfield.dataset.config import FILE
from lightfield.dataset.loading import rendered_frames, scene_datasets
from lightfield.dataset.view_store import ViewStore
from lightfield.geometry.rigs import BlendCamera
from lightfield.rendering import (
    blend_facts,
    blend_file,
    external_files,
    light,
    pruning,
    scene_memory,
    simulations,
)
from lightfield.rendering.inventory import FEATURES, inventory

# isort: split
import bpy


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", help="name of a file in configs/scenes/ that uses this .blend")
    parser.add_argument("--blend", required=True, type=Path, help="the scene")
    parser.add_argument("--output", required=True, type=Path, help="JSON to write")
    arguments = parser.parse_args()

    written = config.load_scene(arguments.scene) if arguments.scene else None
    chosen = written.scene.model_dump() if written else {}
    layers = blend_file.open_scene(arguments.blend, chosen)
    datasets = scene_datasets(arguments.scene) if arguments.scene else []
    saved_frame = bpy.context.scene.frame_current
    chosen_frames = rendered_frames(datasets) or [FILE]
    frames = sorted({saved_frame if frame == FILE else frame for frame in chosen_frames})
    contents: dict[str, Any] = {}
    if chosen.get("blend"):
        camera_frames = [frame for dataset in datasets for frame in dataset.camera_frames]
        contents = {"blend": blend_facts.facts(camera_frames) | {"layers": layers}}
    if written and written.render and written.render.motion_blur is not None:
        bpy.context.scene.render.use_motion_blur = written.render.motion_blur
    refuse_fluids(arguments.blend)
    contents |= inventory(frames)
    if contents["missing"] and not chosen.get("allow_missing"):
        raise UserError(refusal(arguments.blend, contents["missing"]))
    if not light.may_be_lit():
        raise UserError(
            f"{arguments.blend}: has no light, so all views would be black: no lamp shines, no "
            "material emits, and the world is black; give it one of these, as a world with a colour"
        )
    if store := ViewStore.configured():
        external_files.put(arguments.blend, contents["external_files"], store)
    warnings = list(simulations.warnings(frames))
    leave_out = pruning.left_out(contents)
    contents["left_out"] = leave_out
    # Close the scene, because the measurement opens it again.
    blend_file.new_scene()
    contents["memory_bytes"] = scene_memory.measure(arguments.blend, contents, chosen)
    write_json(arguments.output, contents)
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    if chosen.get("blend"):
        resolved = [dataset.resolved(arguments.output) for dataset in datasets]
        shown = sorted({dataset.source.frame for dataset in resolved})
        own_camera = any(isinstance(dataset.rig, BlendCamera) for dataset in datasets)
        notes = blend.usage_notes(contents, shown, datasets[0].render, own_camera)
        print(f"note: {arguments.blend}: {' · '.join(notes)}")
    print(
        f"{contents['objects']} objects, {contents['triangles']} triangles, with instances "
        f"{contents['triangles_with_instances']}; {', '.join(n for n in FEATURES if contents[n])}"
    )
    for name in leave_out:
        print(f"left out: {name}: {pruning.REASONS[name]}")


def refuse_fluids(path: Path) -> None:
    """Raise `UserError` where the open .blend shows fluids that are not baked."""
    if fluids := simulations.unbaked_fluids():
        # Blender aborts at its exit if such a file is still open.
        blend_file.new_scene()
        raise UserError(
            f"{path}: {', '.join(fluids[:8])}{' …' if len(fluids) > 8 else ''}: fluids that are "
            "not baked cannot be simulated here; bake them in Blender and save the .blend"
        )


def refusal(path: Path, problems: list[dict[str, str]]) -> str:
    """Return which files of a .blend are missing or cannot be read, and what to do about them."""
    descriptions = []
    for entry in problems[:8]:
        file = os.path.normpath(path.parent / entry["path"])
        descriptions.append(f"the {entry['kind']} {entry['name']} at {file} ({entry['problem']})")
    more = " …" if len(problems) > 8 else ""
    return (
        f"{path}: {len(problems)} of the files that it shows are missing or cannot be read: "
        f"{'; '.join(descriptions)}{more}; mend them, pack them into the "
        ".blend (in Blender: File, External Data), or render without them: scene: "
        "{allow_missing: true}"
    )


if __name__ == "__main__":
    run(main)
