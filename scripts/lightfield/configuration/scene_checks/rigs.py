"""Checks each rig with its camera, its file and what the other blocks make of its views."""

import math
from collections.abc import Sequence
from pathlib import Path

from lightfield.configuration.publication import PUBLISHED_FOLDER
from lightfield.configuration.reprojections import face_problem
from lightfield.configuration.scene_blocks import SceneBlocks
from lightfield.configuration.scene_checks.names import check_folder
from lightfield.core.names import FILE
from lightfield.geometry.frames import MOST_VIEWS as MOST_VIEWS_OF_RIG
from lightfield.geometry.lenses import CameraSettings, Lens
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rigs import BlendCamera, Poses, Rig
from lightfield.geometry.rigs import Path as PathRig
from lightfield.geometry.rigs.split_setting import Chosen

FLOW_PLACES = "needs views from two or more places"
# Names that a rig's folder cannot have, because other folders beside it have them.
_RIG_NEIGHBOURS = {PUBLISHED_FOLDER, "settings", "trials"}
# For keys of a camera in lightfield.json: Blender's least and largest value, the unit of messages,
# and the name in messages.
_BLENDER_LIMITS = {
    "focal_length": (1.0, 1e6, 1.0, "focal length in mm"),
    "fisheye_fov": (0.1745, 31.4159, math.pi / 180, "fov in degrees"),
    "fisheye_lens": (0.01, 100.0, 1.0, "focal length in mm"),
}
# Blender makes each side of a smaller image so long.
SMALLEST_IMAGE = 4
# Planning more frames or views than these would take hours.
MOST_FRAMES = 10_000
MOST_VIEWS = 1_000_000


def check(blocks: SceneBlocks) -> None:
    """Check all rigs."""
    for name, rig in blocks.rigs.items():
        check_folder(f"rigs.{name}", name, _RIG_NEIGHBOURS)
        _check_rig(blocks, f"rigs.{name}", name, rig)


def _check_rig(blocks: SceneBlocks, key: str, name: str, rig: Rig) -> None:
    """Check a rig with its camera, its file and the depth."""
    camera = rig.camera
    if camera is None:
        raise ValueError(f"{key}: is missing the key camera, or head")
    if isinstance(rig, Poses) and not Path(rig.file).is_file():
        raise ValueError(f"{key}.file: is {rig.file!r}; there is no such file")
    if blocks.scene.blend is None and isinstance(rig, BlendCamera):
        raise ValueError(f"{key}.type: blend_camera needs scene.blend")
    if camera.lens == FILE and not isinstance(rig, BlendCamera):
        raise ValueError(f"{key}.camera.lens: file is only for a rig of type blend_camera")
    frames = len(rig.sequence.numbers) if rig.sequence else 1
    if frames > MOST_FRAMES or frames * rig.view_count > MOST_VIEWS:
        raise ValueError(
            f"{key}: has {frames} frames of {rig.view_count} views; must be at most "
            f"{MOST_FRAMES} frames and {MOST_VIEWS} views in all"
        )
    if rig.view_count > MOST_VIEWS_OF_RIG:
        raise ValueError(
            f"{key}: has {rig.view_count:,} views; must be at most {MOST_VIEWS_OF_RIG:,}"
        )
    for view in _unknown_names(rig):
        raise ValueError(f"{key}.split: there is no view {view!r}")
    lens = camera.make()
    if blocks.render:
        _check_lens(f"{key}.camera", camera)
    if blocks.render and isinstance(lens, Rectilinear) and not lens.has_square_pixels:
        raise ValueError(
            f"{key}.camera.sensor_size: is {list(lens.sensor)}, but the pixels of Cycles' "
            f"perspective views are square; must be its width alone, {lens.sensor[0]:g}"
        )
    if blocks.render and blocks.render.depth == "z" and not lens.has_z_depth:
        raise ValueError(
            f"render.depth: is 'z', but {key}.camera sees beyond 180 degrees; "
            "must be auto, distance or none"
        )
    _check_cube_map(key, rig)
    if rig.cube_map and blocks.render and blocks.render.camera_motion:
        raise ValueError(
            f"render.camera_motion: does not go with {key}.cube_map, whose faces would each "
            "move along axes of their own; render panoramas, and reproject with cube_map"
        )
    motion = blocks.render and blocks.render.camera_motion
    lacks_exposure = isinstance(rig, PathRig) and rig.imu and rig.imu.exposure is None
    if lacks_exposure and motion and motion.rolling is not None:
        raise ValueError(
            f"{key}.imu.exposure: is missing; the times of a rolling shutter's rows need the "
            "seconds of a view's exposure"
        )
    if rig.is_omnidirectional:
        _check_without_centre(blocks, key, name)
    if blocks.flow and rig.is_at_one_place():
        raise ValueError(f"flow: {FLOW_PLACES}, but all views of {key} are from one")


def _check_without_centre(blocks: SceneBlocks, key: str, name: str) -> None:
    """Check that nothing needs a centre of a rig's views, which have none."""
    if blocks.rigs[name].camera.lens != "equirectangular":
        raise ValueError(f"{key}.stereo.omnidirectional: needs the lens equirectangular")
    refusal = f"does not go with {key}.stereo.omnidirectional, whose views have no centre"
    if blocks.render and blocks.render.camera_motion:
        raise ValueError(f"render.camera_motion: {refusal}")
    if blocks.flow:
        raise ValueError(f"flow: {refusal}")
    if blocks.render and "motion" in (blocks.render.passes or ()):
        raise ValueError(f"render.passes: motion {refusal}")
    for reprojection_name, reprojection in blocks.reprojections.items():
        if reprojection.camera and name in (reprojection.rigs or blocks.rigs):
            raise ValueError(f"reprojections.{reprojection_name}: {refusal}")


def small_image(resolution: Sequence[int]) -> str | None:
    """Return what is wrong with an image that is smaller than Blender's smallest. Or None."""
    if min(resolution) >= SMALLEST_IMAGE:
        return None
    least = f"{SMALLEST_IMAGE} × {SMALLEST_IMAGE}"
    return f"is {[*resolution]}; must be at least {least} pixels, the smallest image of Blender"


def _check_lens(key: str, settings: CameraSettings) -> None:
    """Check that Blender can have the image of a camera, and Cycles its lens, if it is Cycles'."""
    if problem := small_image(settings.resolution):
        raise ValueError(f"{key}.resolution: {problem}")
    lens = settings.make()
    if lens.in_cycles:
        _check_blender_limits(key, settings, lens)


def _check_blender_limits(key: str, settings: CameraSettings, lens: Lens) -> None:
    """Refuse a value outside Blender's limits, which Blender would clamp."""
    camera = lens.to_lightfield()["camera"]
    fov = getattr(settings, "fov", None)
    if isinstance(lens, Rectilinear) and lens.focal_length < 1 and fov:
        widest = math.degrees(2 * math.atan(lens.sensor[0] / 2))
        raise ValueError(f"{key}.fov: is {fov:g}; must be at most {widest:.4g} in Blender")
    for name, (least, most, unit, title) in _BLENDER_LIMITS.items():
        value = camera.get(name, least)
        if not least <= value <= most:
            bound = f"at least {least / unit:.4g}" if value < least else f"at most {most / unit:g}"
            raise ValueError(
                f"{key}: its {title} is {value / unit:.4g}; must be {bound} in Blender"
            )
    if max(lens.sensor) < 1:
        raise ValueError(
            f"{key}.sensor_size: is {lens.sensor[0]:g}; must be at least 1 mm in Blender"
        )


def _check_cube_map(key: str, rig: Rig) -> None:
    """Check that the camera of a rig with cube maps can be a face's camera."""
    if rig.cube_map and (problem := face_problem(rig.camera)):
        raise ValueError(f"{key}.camera{problem}")


def _unknown_names(rig: Rig) -> list[str]:
    """Return the names in a rig's split that no view has."""
    if not isinstance(rig.split, Chosen) or not rig.split.names:
        return []
    # The .blend names the views of its camera. It has not been read yet.
    if isinstance(rig, BlendCamera):
        return []
    return sorted({*rig.split.names} - {pose.name for pose in rig.poses()})
