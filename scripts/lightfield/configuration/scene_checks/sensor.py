"""Checks the sensor with the views that it develops."""

from lightfield.configuration.scene_blocks import SceneBlocks
from lightfield.core.names import VIEWS
from lightfield.settings.base import suggestion


def check(blocks: SceneBlocks) -> None:
    """Check that the sensor's sources and rigs exist, and that it can develop them."""
    sensor = blocks.sensor
    if sensor is None:
        return
    allowed_sources = [VIEWS, *blocks.reprojections]
    for source in sensor.sources:
        if source not in allowed_sources:
            raise ValueError(
                f"sensor.sources: is {source!r}; must be of {', '.join(allowed_sources)}"
            )
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
    for rig_name in sensor.rigs or ():
        if rig_name not in blocks.rigs:
            raise ValueError(
                f"sensor.rigs: there is no rig {rig_name!r}{suggestion(rig_name, blocks.rigs)}"
            )
    if blocks.render and blocks.render.transparent:
        raise ValueError("sensor: does not go with render.transparent")
