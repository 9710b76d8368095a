"""Makes a dataset's light field from its settings."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from lightfield.configuration.capture import LightfieldSettings, panorama_rig
from lightfield.core import machine
from lightfield.core.errors import UserError
from lightfield.core.names import FILE, IMU
from lightfield.engine.read_files import changed_since_plan, check_since_plan
from lightfield.formats import blend, imu, light_groups, published
from lightfield.formats.inventory import read_inventory
from lightfield.formats.lightfield import MACHINE, RIG_FIT, LightField
from lightfield.formats.render_block import RenderBlock
from lightfield.geometry import rigs
from lightfield.imaging.blender_looks import FILE_LOOK
from lightfield.imaging.look import Look
from lightfield.planning.sampling import calibrated
from lightfield.stages.rig import MakeLightfield


def write(job: MakeLightfield) -> None:
    """Write the light field of a job's settings. Raises `UserError` if it lacks a file."""
    settings = job.settings
    if isinstance(settings.rig, rigs.Poses):
        if settings.poses_sha256:
            check_since_plan(settings.rig.file, settings.poses_sha256)
        for warning in settings.rig.warnings():
            print(f"warning: {warning}", file=sys.stderr)
    if job.calibration:
        render = calibrated(settings.render, job.calibration)
        settings = settings.model_copy(update={"render": render})
    lightfield = from_settings(settings, job.inventory, job.model, job.places)
    if settings.fingerprint not in (None, lightfield.scene["fingerprint"]):
        source = settings.source
        raise changed_since_plan(source.dataset or f"the builder {source.builder}")
    if IMU in lightfield.content:
        assert isinstance(settings.rig, rigs.Path)
        imu.write(job.output.parent, settings.rig, lightfield)
        motion = lightfield.render.camera_motion
        # The camera_motion of a camera on a head is in the camera's axes, not in the body's.
        if motion and settings.rig.imu and settings.rig.imu.exposure and not settings.rig.mount:
            print(f"note: {imu.exposure_note(settings.rig, motion)}")
    lightfield.write(job.output)


def from_settings(
    settings: LightfieldSettings,
    inventory: Path | None = None,
    model: Path | None = None,
    places: Path | None = None,
) -> LightField:
    """Return the light field that the settings describe.

    The job names the files that scripts/inventory.py, import_model.py and free_places.py wrote, as
    far as the scene has them. Raises `UserError` if one is missing.
    """
    capture = settings.capture
    if inventory:
        capture = capture.resolved(inventory)
    elif capture.source.blend or capture.rig.is_fitted:
        raise UserError("--inventory: is missing; scripts/inventory.py writes it for a .blend")
    if model:
        capture = capture.of_model(model)
    elif capture.source.model:
        raise UserError("--model: is missing; scripts/import_model.py writes it")
    if settings.panorama_width:
        capture = replace(
            capture,
            rig=panorama_rig(capture.rig, settings.panorama_width),
            render=capture.render.without_passes,
        )
    elif capture.render.light_groups is not None:
        capture = replace(capture, render=_with_groups(capture.render, inventory))
    if isinstance(capture.rig, rigs.Random):
        if places is None:
            raise UserError("--places: is missing; scripts/free_places.py writes it")
        capture = replace(capture, rig=capture.rig.placed(places))
    keys = capture.origin
    if settings.rig.is_fitted and not settings.panorama_width:
        fitting = capture.rig.model_dump(mode="json", include={"size", "center"})
        keys[RIG_FIT] = fitting
        text = ", ".join(f"{key}: {_shown(value)}" for key, value in fitting.items())
        print(f"note: the {capture.rig.type} fits the box of {settings.scene}: {text}")
    # Imported views were rendered on another machine.
    if capture.imported:
        assert isinstance(capture.rig, rigs.Poses)
        if unused_keys := published.unused_keys(capture.rig):
            print(f"note: {capture.rig.file}: is imported without {', '.join(unused_keys)}")
    else:
        keys[MACHINE] = machine.describe(capture.render.denoise)
    if isinstance(capture.rig, rigs.Path) and capture.rig.imu:
        keys[IMU] = imu.settings_content(capture.rig.imu)
    if settings.file_look:
        keys[FILE_LOOK] = _file_look(capture.source.blend, inventory)
    lightfield = LightField.from_rig(capture.rig, capture.rig.camera.make(), **keys)
    if settings.flow:
        lightfield = lightfield.with_flow()
    if capture.render.camera_motion:
        lightfield = lightfield.with_exposure()
    return lightfield


def _shown(value: float | list[float]) -> str:
    """Return a number, or a list of numbers, as a scene YAML has it."""
    if isinstance(value, list):
        return f"[{', '.join(map(_shown, value))}]"
    return f"{value:.6g}"


def _file_look(path: str | None, inventory: Path | None) -> dict[str, Any]:
    """Return the look of the .blend at ``path``. Raises `UserError` if it is not possible."""
    if inventory is None:
        raise UserError("--inventory: is missing; scripts/inventory.py reads the .blend's look")
    facts = read_inventory(inventory, "blend")["blend"]
    try:
        content = blend.look_of(facts)
        Look.of(FILE, 0.0, content)
    except UserError as error:
        raise UserError(f"{path}: {error}") from None
    return content


def _with_groups(render: RenderBlock, inventory: Path | None) -> RenderBlock:
    """Return a ``render`` block with the emitters of each light group, by the scene's inventory."""
    assert render.light_groups is not None
    if inventory is None:
        raise UserError("--inventory: is missing; scripts/inventory.py names the light groups")
    emitters = read_inventory(inventory, "emitters")["emitters"]
    return render.changed(light_groups=light_groups.resolved(render.light_groups, emitters))
