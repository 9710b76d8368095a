"""The jobs of a build, one record each, in the order of the work.

A rule names its job's record. From the record follow the job's inputs and settings, its receipt,
bundle, log and times, its phase in the display and the forecast, and its cost. A new job is a
record here, and a rule that shows its files and its command.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from lightfield.configuration.dataset import Dataset
from lightfield.configuration.dataset_paths import Paths
from lightfield.engine.stage import Stage
from lightfield.exporters import BESIDE_VIEWS
from lightfield.planning import cost
from lightfield.planning.cost import BLENDER, JOB, Cost
from lightfield.planning.phases import Phase
from lightfield.stages import (
    checks,
    exports,
    family,
    lenses,
    measurement,
    publishing,
    report,
    rig,
    scene,
    views,
)
from lightfield.workflow import job_settings as settings
from lightfield.workflow.build import Build, Wildcards
from lightfield.workflow.job_settings import (
    SettingsOf,
    of_dataset,
    of_dataset_in,
    of_others,
    of_reprojection,
    of_scene,
)

CostOf = Callable[[Build, Wildcards], Cost]
"""Returns the cost of a job."""


class Job(NamedTuple):
    """A kind of job.

    ``name`` has the job's wildcards: the receipt, the log and the times of a job are named after
    it. ``stage`` does the work. ``phase`` is where the display and the forecast count the job.
    """

    name: str
    stage: type[Stage[Any]]
    phase: Phase
    # None if only its log says how long it takes.
    cost: CostOf | None
    # None for a stage without settings.
    settings: SettingsOf | None = None
    # The name of its times, where they have another one.
    times: str = ""
    # The file of a dataset by which readers know the job, if they declare no receipt.
    file: Callable[[Paths], str] | None = None
    # Whether it makes files that its rule does not declare, which travel in a bundle.
    has_bundle: bool = False
    # Whether it works on all frames of a sequence.
    is_of_sequence: bool = False
    # Whether it takes seconds, and runs beside Snakemake on a cluster, too.
    is_local: bool = False
    # Whether it renders on the device.
    renders: bool = False
    # Wildcards that the paths of its files do not have, because its rule is for one value of them.
    given: tuple[tuple[str, str], ...] = ()

    def names(self, wildcards: Wildcards) -> dict[str, str]:
        """Return all names of a job, by the wildcards of its files."""
        return {**dict(self.given), **wildcards}

    def pattern(self, wildcard: str) -> str:
        """Return a wildcard as the rule's paths have it, or the one value for which the rule is."""
        return dict(self.given).get(wildcard, f"{{{wildcard}}}")


def _costs(known: Cost) -> CostOf:
    return lambda build, wildcards: known


def _of_views(cost_of: Callable[[Dataset, int | None], Cost]) -> CostOf:
    """Return the cost of a job that makes views of a dataset, or a shard of them."""

    def of_shard(build: Build, wildcards: Wildcards) -> Cost:
        count = int(wildcards["end"]) - int(wildcards["first"])
        return cost_of(build.dataset(wildcards), count)

    return of_shard


def _of_dataset(cost_of: Callable[[Dataset], Cost]) -> CostOf:
    return lambda build, wildcards: cost_of(build.dataset(wildcards))


def _rendered_or_imported(dataset: Dataset, views: int | None) -> Cost:
    return (cost.importing if dataset.imported else cost.rendering)(dataset, views)


def _reprojected(build: Build, wildcards: Wildcards) -> Cost:
    count = int(wildcards["end"]) - int(wildcards["first"])
    return cost.reprojecting(build.dataset(wildcards), wildcards["reprojection"], count)


BUILD_SCENE = Job(
    "{name}/build_scene",
    scene.BuildScene,
    "scene",
    _costs(BLENDER),
    of_scene("build_scene", settings.build_scene),
)
IMPORT_MODEL = Job(
    "{name}/import_model",
    scene.ImportModel,
    "scene",
    _costs(BLENDER),
    of_scene("import_model", settings.import_model),
)
CHECK_BLEND = Job(
    "{name}/check_blend",
    scene.CheckBlend,
    "scene",
    _costs(BLENDER),
    of_scene("check_blend", settings.check_blend),
    is_local=True,
)
INVENTORY = Job(
    "{name}/inventory",
    scene.Inventory,
    "scene",
    _costs(BLENDER),
    of_scene("inventory", settings.inventory),
    file=lambda paths: paths.inventory,
    has_bundle=True,
)
FREE_PLACES = Job(
    "{scene}/{rig}/free_places",
    rig.FreePlaces,
    "cameras",
    _costs(BLENDER),
    of_dataset("free_places", settings.free_places),
    times="{scene}/{rig}/cameras/free_places",
)
LIGHTFIELD = Job(
    "{scene}/{rig}/lightfield",
    rig.MakeLightfield,
    "cameras",
    _costs(JOB),
    of_dataset("lightfield", settings.lightfield),
    times="{scene}/{rig}/cameras/lightfield",
    file=lambda paths: paths.lightfield,
    is_local=True,
)
CHECK_CAMERAS = Job(
    "{scene}/{rig}/check_cameras",
    rig.CheckCameras,
    "cameras",
    _costs(BLENDER),
    times="{scene}/{rig}/cameras/check_cameras",
)
SPLITS = Job("{scene}/splits", views.ListSplits, "cameras", _costs(JOB), is_local=True)
PROBE_CAMERAS = Job(
    "{scene}/probe_cameras",
    rig.MakeLightfield,
    "calibration",
    _costs(BLENDER),
    of_others(settings.probes),
    is_local=True,
)
CALIBRATE = Job(
    "{scene}/calibrate",
    measurement.Calibrate,
    "calibration",
    lambda build, names: cost.calibrating(build.first_of_scene(names["scene"])),
    renders=True,
)
# Two rules make views: one renders them, and one imports what somebody else has rendered.
RENDER = Job(
    "{scene}/{rig}/render/{first}-{end}",
    views.RenderShard,
    "views",
    _of_views(_rendered_or_imported),
    has_bundle=True,
    renders=True,
)
FLOW = Job(
    "{scene}/{rig}/flow/{first}-{end}",
    views.ComputeFlow,
    "flow",
    _of_views(cost.computing_flow),
    of_dataset("flow", settings.reader),
    has_bundle=True,
)
REPROJECTED_LIGHTFIELD = Job(
    "{scene}/{rig}/{reprojection}/lightfield",
    lenses.Reproject,
    "reprojections",
    _costs(JOB),
    of_reprojection("reproject", settings.reproject),
    file=lambda paths: paths.source_lightfield("{reprojection}/"),
    is_local=True,
)
LENS_MAP = Job(
    "{scene}/{rig}/{reprojection}/lens_map",
    lenses.ComputeLensMap,
    "reprojections",
    _costs(JOB),
    of_reprojection("lens_map", settings.lens_map),
    is_local=True,
)
REPROJECT = Job(
    "{scene}/{rig}/{reprojection}/{first}-{end}",
    lenses.Reproject,
    "reprojections",
    _reprojected,
    of_reprojection("reproject", settings.reproject),
    has_bundle=True,
)
EXPORT = Job(
    "{scene}/{rig}/{source}export_{format}",
    exports.ExportViews,
    "exports",
    _of_dataset(cost.checking),
    of_others(settings.export_of),
    times="{scene}/{rig}/export/{source}{format}",
    file=lambda paths: paths.export_list(),
    has_bundle=True,
)


def _export_to(name: str) -> Job:
    """Return the record of exports to one format, for lists whose paths do not name it."""
    return EXPORT._replace(
        name=EXPORT.name.replace("{format}", name),
        times=EXPORT.times.replace("{format}", name),
        file=lambda paths: paths.export_list(name),
        given=(("format", name),),
    )


EXPORT_RULES = {"export": EXPORT} | {f"export_to_{name}": _export_to(name) for name in BESIDE_VIEWS}
"""The records of exports by their rules."""
EXPORT_SEQUENCE = Job(
    "{scene}/{rig}/{source}sequence_{format}",
    exports.ExportViews,
    "exports",
    _costs(JOB),
    of_others(settings.export_sequence),
    times="{scene}/{rig}/export/{source}{format}",
    file=lambda paths: paths.export_list(),
    has_bundle=True,
    is_of_sequence=True,
)
MESH = Job(
    "{scene}/{rig}/mesh",
    exports.WriteSurface,
    "exports",
    _costs(BLENDER),
    of_dataset("mesh", settings.mesh),
    file=lambda paths: paths.mesh_list,
    has_bundle=True,
)
VALIDATE = Job(
    "{scene}/{rig}/validate",
    checks.Validate,
    "validation",
    _of_dataset(cost.checking),
    of_dataset("validate", settings.validate),
    file=lambda paths: paths.validation,
)
VALIDATE_SEQUENCE = Job(
    "{scene}/{rig}/validate_sequence",
    checks.ValidateSequence,
    "validation",
    _costs(JOB),
    of_others(settings.validate_sequence),
    times="{scene}/{rig}/validate",
    file=lambda paths: paths.validation,
    is_of_sequence=True,
)
CHECKSUMS = Job(
    "{scene}/{rig}/checksums",
    publishing.PublishChecksums,
    "validation",
    _costs(JOB),
    of_dataset("checksums", settings.reader),
    is_local=True,
)
PANORAMA_LIGHTFIELD = Job(
    "{scene}/{rig}/panorama/lightfield",
    rig.MakeLightfield,
    "report",
    _costs(JOB),
    of_dataset("panorama", settings.panorama),
    is_local=True,
)
RENDER_PANORAMA = Job(
    "{scene}/{rig}/panorama/render",
    views.RenderShard,
    "report",
    _of_dataset(cost.rendering_panorama),
    renders=True,
)
FIGURES = Job(
    "{scene}/{rig}/figures",
    report.ReportFigures,
    "report",
    _of_dataset(cost.drawing),
    of_dataset("figures", settings.figures),
    times="{scene}/{rig}/report/figures",
    is_local=True,
)
COSTS = Job(
    "{scene}/{rig}/costs",
    measurement.Costs,
    "report",
    _costs(JOB),
    of_dataset_in("costs", settings.costs),
    is_local=True,
)
PAGE = Job(
    "{scene}/{rig}/page",
    report.ReportHtml,
    "report",
    _of_dataset(cost.drawing),
    of_dataset_in("page", settings.page),
    times="{scene}/{rig}/report/page",
    is_local=True,
)
INDEX = Job("index", report.ReportIndex, "report", _costs(JOB), is_local=True)
PACK = Job(
    "{scene}/{rig}/package",
    publishing.Package,
    "package",
    _costs(JOB),
    of_others(settings.pack),
    has_bundle=True,
)
PUBLISH = Job(
    "{scene}/{rig}/publish",
    publishing.Publish,
    "package",
    _costs(JOB),
    of_others(settings.pack),
    has_bundle=True,
)
BUILD_MEMBERS = Job(
    "{family}/batches/{batch}",
    family.BuildMembers,
    "family",
    Build.batch_cost,
    of_others(settings.batch),
    has_bundle=True,
    renders=True,
)
CORPUS = Job(
    "{family}/corpus",
    family.Corpus,
    "family",
    _costs(JOB),
    of_others(settings.corpus),
    has_bundle=True,
    is_local=True,
)
COUNT_MEMBERS = Job(
    "{family}/members",
    family.CountMembers,
    "family",
    _costs(JOB),
    of_others(settings.members),
    is_local=True,
)
# These are not part of a dataset.
PROBE = Job("{scene}/{rig}/probe", measurement.Probe, "plan", None, renders=True)
ERROR_VS_TIME = Job(
    "{scene}/error_vs_time", measurement.ErrorVsTime, "measurement", None, renders=True
)
GPU_CHECK = Job(
    "{scene}/gpu_check",
    measurement.GpuCheck,
    "benchmark",
    None,
    of_others(settings.gpu_check),
    renders=True,
)
SYNTHESIS = Job(
    "{scene}/{rig}/synthesis",
    measurement.SynthesisQuality,
    "synthesis",
    None,
    of_dataset_in("synthesis", settings.synthesis),
)

JOBS = [record for record in globals().values() if isinstance(record, Job)]
JOBS += [record for record in EXPORT_RULES.values() if record is not EXPORT]
"""All jobs, in the order of the work."""
ORDER = {job: place for place, job in enumerate(JOBS)}
