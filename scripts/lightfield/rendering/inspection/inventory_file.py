"""Writes the inventory of a .blend: what it contains, and what its rendering can leave out."""

import os.path
import sys
import tempfile
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from lightfield.configuration import scene_yaml
from lightfield.configuration.dataset import Dataset
from lightfield.core.errors import UserError
from lightfield.core.files import write_json
from lightfield.core.names import FILE
from lightfield.core.paths import case_hint
from lightfield.engine import bundles, receipts
from lightfield.engine.read_files import changed_since_plan
from lightfield.formats import blend
from lightfield.formats.light_groups import resolved
from lightfield.geometry.rigs import BlendCamera
from lightfield.planning.loading import scene_datasets
from lightfield.rendering.inspection import (
    blend_facts,
    external_files,
    light,
    scene_box,
    scene_memory,
    simulations,
    unknown_colours,
)
from lightfield.rendering.inspection.inventory import FEATURES, inventory
from lightfield.rendering.scenes import blend_file, frames
from lightfield.rendering.setup import followed_camera, motion_blur, pruning
from lightfield.stages.scene import Inventory, InventorySettings
from lightfield.workflow import job_settings


def make(job: Inventory) -> None:
    """Write the inventory of a .blend, and print warnings and a summary.

    Raises `UserError` for a scene that cannot be rendered.
    """
    datasets = scene_datasets(job.scene) if job.scene else []
    settings = job_settings.inventory(datasets[0]) if datasets else job.settings
    # By hand, there was no plan.
    if job.receipt and settings.as_json() != job.settings.as_json():
        raise changed_since_plan(scene_yaml.scene_path(str(job.scene)))
    write(job.blend, settings, datasets, job.output, measures_memory=not job.skip_memory)


def write(
    path: Path,
    settings: InventorySettings,
    datasets: Sequence[Dataset],
    output: Path,
    measures_memory: bool = True,
) -> None:
    """Write the inventory of a .blend, as `make` does.

    ``datasets`` are the datasets of a user's own .blend, of which the inventory says more. The
    measurement of memory starts a process of its own. Without it, the inventory does not say how
    much the scene takes.
    """
    is_own = bool(datasets and datasets[0].source.blend)
    scene_block = settings.as_json({"scene_name", "view_layers", "targets"})
    external_files.refuse_damaged_alembic(path)
    with tempfile.NamedTemporaryFile() as printed:
        layers = blend_file.open_scene(path, scene_block, printed=Path(printed.name))
        unknown = unknown_colours.named_in(printed.read().decode(errors="replace"))
    external_files.refuse_special(path)
    saved_frame = frames.current()
    frame_choices = settings.rendered_frames
    shown_frames = sorted({f if isinstance(f, int) else saved_frame for f in frame_choices})
    shown_frames = shown_frames or [saved_frame]
    contents: dict[str, Any] = {}
    if is_own:
        # Only a frame with a fraction is a float in an inventory.
        camera_frames = [
            frame if frame is None or frame % 1 else int(frame)
            for frame in settings.camera_frames or ()
        ]
        unknown_to_blender = unknown_colours.of_scene(unknown)
        try:
            is_blurred = bool(settings.motion_blur)
            facts = blend_facts.facts(camera_frames, is_blurred)
            contents = {"blend": facts | {"layers": layers}}
        except UserError as error:
            raise UserError(f"{path}: {error}") from None
        if unknown_to_blender:
            contents["blend"]["unknown"] = unknown_to_blender
    if settings.motion_blur is not None:
        motion_blur.turn(settings.motion_blur)
    _refuse_fluids(path)
    refuse = None if settings.allow_missing else partial(_refuse_missing, path)
    try:
        contents |= inventory(shown_frames, refuse)
    except UserError as error:
        raise UserError(f"{path}: {error}") from None
    unknown_textures = unknown_colours.textures(unknown, contents["textures"])
    wrong_colours = unknown_colours.refusal(path, unknown_textures, unknown)
    if wrong_colours and not settings.allow_missing:
        raise UserError(wrong_colours)
    contents["missing"] += unknown_textures
    if not light.may_be_lit():
        raise UserError(
            f"{path}: has no light, so all views would be black; add a lamp, a material that "
            "emits, or a world with a colour"
        )
    if settings.light_groups:
        contents["emitters"] = light.emitters()
        # A wrong name is known before anything is rendered.
        resolved(settings.light_groups, contents["emitters"])
    if bundles.are_used():
        external_files.check_reachable(path, contents["external_files"])
    if receipt := receipts.current():
        for file in contents["external_files"]:
            receipt.add_input(path.parent / file["path"])
    warnings = list(simulations.warnings(shown_frames))
    leave_out = pruning.left_out(contents)
    contents["left_out"] = leave_out
    if settings.measures_box:
        contents["box"] = scene_box.measure(shown_frames)
    if is_own:
        frames.go_to(shown_frames[0])
        try:
            followers = followed_camera.followers(settings.followed_camera or FILE)
        except UserError as error:
            raise UserError(f"{path}: {error}") from None
        contents["blend"]["followers"] = followers
    # Close the scene, because the measurement opens it again.
    blend_file.new_scene()
    if measures_memory:
        contents["memory_bytes"] = scene_memory.measure(path, contents, scene_block)
    write_json(output, contents)
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    if is_own:
        _print_notes(path, contents, datasets, output)
    print(
        f"{contents['objects']} objects, {contents['triangles']} triangles, with instances "
        f"{contents['triangles_with_instances']}; {', '.join(n for n in FEATURES if contents[n])}"
    )
    for name in leave_out:
        print(f"left out: {name}: {pruning.REASONS[name]}")


def _print_notes(
    path: Path, contents: Mapping[str, Any], datasets: Sequence[Dataset], inventory_file: Path
) -> None:
    """Print what a user's .blend says, and what the ``datasets`` take from it."""
    resolved = [dataset.resolved(inventory_file) for dataset in datasets]
    shown = sorted({dataset.frame for dataset in resolved})
    own_camera = any(isinstance(dataset.rig, BlendCamera) for dataset in datasets)
    followed = resolved[0].source.followed_camera if resolved else None
    uses_look = any(dataset.uses_file_look for dataset in datasets)
    notes = blend.usage_notes(contents, shown, datasets[0].render, own_camera, followed, uses_look)
    print(f"note: {path}: {' · '.join(notes)}")


def _refuse_fluids(path: Path) -> None:
    """Raise `UserError` where the open .blend shows fluids that are not baked."""
    if fluids := simulations.unbaked_fluids():
        # Blender aborts at its exit if such a file is still open.
        blend_file.new_scene()
        raise UserError(
            f"{path}: {', '.join(fluids[:8])}{' …' if len(fluids) > 8 else ''}: fluids that are "
            "not baked cannot be simulated here; bake them in Blender and save the .blend"
        )


def _refuse_missing(path: Path, problems: Sequence[external_files.Missing]) -> None:
    raise UserError(missing_text(path, problems))


def missing_text(path: Path, problems: Sequence[external_files.Missing]) -> str:
    """Return which files of a .blend are missing or cannot be read, and what to do."""
    descriptions = []
    for entry in problems[:8]:
        file = Path(os.path.normpath(path.parent / entry["path"]))
        place = f"{file} ({entry['problem']}){case_hint(file)}"
        descriptions.append(f"the {entry['kind']} {entry['name']} at {place}")
    more = " …" if len(problems) > 8 else ""
    return (
        f"{len(problems)} of the files that it shows are missing or cannot be read: "
        f"{'; '.join(descriptions)}{more}; mend them, pack them into the "
        ".blend (in Blender: File, External Data), or render without them: scene: "
        "{allow_missing: true}"
    )
