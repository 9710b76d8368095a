"""Checks the sensor with the views that it develops."""

from lightfield.configuration.scene_blocks import SceneBlocks
from lightfield.configuration.scene_checks.names import check_rigs, check_sources


def check(blocks: SceneBlocks) -> None:
    """Check that the sensor's sources and rigs exist, and that it can develop them."""
    sensor = blocks.sensor
    if sensor is None:
        return
    check_sources("sensor.sources", sensor.sources, blocks.reprojections)
    check_rigs(blocks, "sensor.rigs", sensor.rigs or ())
    for source in sensor.sources:
        if sensor.sources.count(source) > 1:
            raise ValueError(f"sensor.sources: must name {source} once")
        original = blocks.reprojections.get(source)
        if original and original.relight is not None:
            raise ValueError(f"sensor.sources: {source} has relight; name one without")
        if original and original.cube_map and sensor.vignetting:
            raise ValueError(f"sensor.vignetting: does not go with the faces of {source}")
        for rig_name in sensor.rigs or ():
            if original and rig_name not in (original.rigs or blocks.rigs):
                raise ValueError(
                    f"sensor.rigs: {rig_name} is not a rig of the reprojection {source}"
                )
        for name in sensor.folders(source):
            if name in blocks.reprojections:
                raise ValueError(f"reprojections.{name}: the name is taken by sensor")
    if blocks.render and blocks.render.transparent:
        raise ValueError("sensor: does not go with render.transparent")
