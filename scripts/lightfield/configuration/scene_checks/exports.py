"""Checks exports with the views that they read."""

from lightfield.configuration.scene_blocks import SceneBlocks, look_of
from lightfield.configuration.scene_checks.names import check_rigs, check_sources
from lightfield.core.names import VIEWS
from lightfield.exporters.base import NO_DEPTH, NOT_EXR, Export
from lightfield.formats import light_groups, published
from lightfield.geometry.lenses import CameraSettings
from lightfield.geometry.rigs import Poses, Rig


def check(blocks: SceneBlocks) -> None:
    """Check all exports."""
    for name, export in blocks.exports.selected.items():
        _check_export(blocks, f"exports.{name}", export)


def _check_export(blocks: SceneBlocks, export_key: str, export: Export) -> None:
    """Check that an export's rigs and sources exist, and that its consumer can take them."""
    rigs_key = f"{export_key}.{export.rigs_key}"
    check_rigs(blocks, rigs_key, export.chosen_rigs or ())
    key = f"{export_key}.sources"
    developments = blocks.developments
    check_sources(key, export.sources, developments)
    _check_joined_rigs(blocks, rigs_key, export)
    if look_of(export) and not any(
        source == VIEWS or "exr" in developments[source].formats for source in export.sources
    ):
        source = export.sources[0]
        of_look = f"the reprojection {source}" if source in blocks.reprojections else "sensor"
        raise ValueError(f"{export_key}.look: is for EXR sources; give look to {of_look}")
    for source in export.sources:
        reprojection = None if source == VIEWS else developments[source]
        if reprojection and reprojection.relight == light_groups.EACH:
            raise ValueError(
                f"{key}: {source} holds one image per light; an export needs one image per view"
            )
        _check_passes_of(blocks, key, source, export)
        motion = blocks.render and blocks.render.camera_motion
        is_resampled = reprojection is not None and reprojection.camera is not None
        if export.has_row_times and is_resampled and motion and motion.rolling not in (None, 1):
            raise ValueError(
                f"{key}: {source} mixes the rows of a rolling shutter, whose times the export "
                f"has; export {VIEWS}"
            )
        _check_exported_rigs(blocks, export_key, rigs_key, export, source)


def _check_joined_rigs(blocks: SceneBlocks, key: str, export: Export) -> None:
    """Check that rigs can go into one export, which has one split, and lenses that go together."""
    names = export.joined_rigs
    for name in names:
        first, rig = blocks.rigs[names[0]], blocks.rigs[name]
        if first.split in ("validation", "test"):
            raise ValueError(f"{key}: begins with {names[0]}, which tests; name a rig that trains")
        for source in export.sources:
            lenses = (_camera_of(blocks, each, source).make() for each in (first, rig))
            if not export.joins(*lenses):
                raise ValueError(f"rigs.{name}.camera: must be as in {names[0]}; see {key}")
        if rig.frames != first.frames:
            raise ValueError(f"rigs.{name}.frames: must be as in {names[0]}; see {key}")
        if (rig.split is None) != (first.split is None):
            raise ValueError(
                f"{key}: only one of {names[0]} and {name} has a split; give both a split, or none"
            )


def _check_exported_rigs(
    blocks: SceneBlocks, export_key: str, rigs_key: str, export: Export, source: str
) -> None:
    """Check that an export's consumer can take the views of each chosen rig of a source."""
    reprojection = blocks.developments.get(source)
    rigs_of_source = (reprojection and reprojection.rigs) or [*blocks.rigs]
    for name in export.chosen_rigs or ():
        if name not in rigs_of_source:
            raise ValueError(f"{rigs_key}: {name} is not a rig of the reprojection {source}")
    refusals = {
        name: _export_refusal(blocks, export, blocks.rigs[name], source)
        for name in export.chosen_rigs or rigs_of_source
    }
    accepted = ", ".join(name for name, refusal in refusals.items() if not refusal)
    for name, refusal in refusals.items():
        if refusal:
            hint = f"; or export without it: rigs: [{accepted}]" if accepted else ""
            raise ValueError(f"{export_key}.sources: {source}: the rig {name} {refusal}{hint}")


def _check_passes_of(blocks: SceneBlocks, key: str, source: str, export: Export) -> None:
    """Check that the views of a source have the passes that an export needs."""
    passes = blocks.render and blocks.render.passes
    place = "render.passes"
    if source != VIEWS:
        passes = blocks.developments[source].passes
        place = f"reprojections.{source}.passes"
    for pass_name in export.needed_passes if blocks.render else ():
        if pass_name not in (passes or ()):
            is_of_sensor = source != VIEWS and source not in blocks.reprojections
            remedy = "export the sensor's source" if is_of_sensor else f"add it to {place}"
            raise ValueError(f"{key}: {source} lacks the pass {pass_name}; {remedy}")


def _export_refusal(blocks: SceneBlocks, export: Export, rig: Rig, source: str) -> str | None:
    """Return why an export's consumer cannot take a rig's views, and what to do. Or None."""
    if rig.is_omnidirectional:
        return "has views without a centre, as omnidirectional stereo has"
    reprojection = blocks.developments.get(source)
    camera = _camera_of(blocks, rig, source)
    is_rendered = renders_depth(blocks, rig)
    has_depth = is_rendered and (reprojection is None or reprojection.has_depth)
    lacks_surfaces = export.needs_surfaces and not is_rendered
    refusal = export.rig_refusal(rig) or (NO_DEPTH if lacks_surfaces else None)
    refusal = refusal or export.refusal(camera.make(), has_depth)
    if refusal not in (NO_DEPTH, NOT_EXR):
        return refusal
    if not is_rendered:
        return f"{NO_DEPTH}; {_depth_remedy(blocks)}"
    if source not in blocks.reprojections:
        return f"{refusal}; export the sensor's source"
    return f"{refusal}; give reprojections.{source} format: exr"


def _camera_of(blocks: SceneBlocks, rig: Rig, source: str) -> CameraSettings:
    """Return the camera of the views of a rig in a source."""
    reprojection = blocks.developments.get(source)
    return (reprojection and reprojection.camera) or rig.camera


def renders_depth(blocks: SceneBlocks, rig: Rig) -> bool:
    """Return whether the views of a rig hold depth, before any reprojection."""
    if blocks.render:
        return blocks.render.depth != "none"
    return not isinstance(rig, Poses) or published.render(rig).depth != "none"


def _depth_remedy(blocks: SceneBlocks) -> str:
    """Return how the views of a scene get depth."""
    if blocks.render:
        return "leave out render.depth: none"
    return "its lightfield.json says so; leave out the export"
