"""The list of all stages."""

from typing import Any

from lightfield.core.stage import Stage
from lightfield.stages import rig, scene, views

STAGES: list[type[Stage[Any]]] = [
    scene.BuildScene,
    scene.ImportModel,
    scene.FetchBlend,
    scene.CheckBlend,
    scene.Inventory,
    rig.MakeLightfield,
    rig.FreePlaces,
    rig.CheckCameras,
    views.RenderShard,
    views.ImportViews,
    views.Flow,
    views.Splits,
]
BY_NAME = {stage.name: stage for stage in STAGES}
