"""The list of all stages."""

from typing import Any

from lightfield.core.stage import Stage
from lightfield.stages import (
    exports,
    lenses,
    measurement,
    publishing,
    report,
    rig,
    scene,
    synthesis,
    views,
)

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
    lenses.LensMap,
    lenses.Reproject,
    views.Flow,
    views.Splits,
    exports.ExportViews,
    exports.ExportInstantNgp,
    exports.WriteSurface,
    synthesis.Synthesize,
    publishing.PublishChecksums,
    publishing.Package,
    publishing.Publish,
    publishing.TakeDataset,
    publishing.TakeViews,
    report.ReportFigures,
    report.ReportHtml,
    report.ReportIndex,
    measurement.CheckDevice,
    measurement.Probe,
    measurement.Calibrate,
    measurement.Costs,
    measurement.Plan,
    measurement.ErrorVsTime,
    measurement.GpuCheck,
    measurement.Evaluate,
    measurement.EvaluateSurface,
    measurement.SynthesisQuality,
]
BY_NAME = {stage.name: stage for stage in STAGES}
