"""The jobs of a build, one record each, in the order of the work.

A rule names its job's record. From the record follow the job's inputs and settings, its receipt,
bundle, log and times, its phase in the display and the forecast, and its cost. A new job is a
record here, and a rule that shows its files and its command. A member of a family has no rules: it
runs the stages of all records that have fields.
"""

import itertools
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from lightfield.configuration.dataset import Dataset
from lightfield.configuration.dataset_paths import Paths, prefix_of
from lightfield.core.names import RENDERED, VIEWS
from lightfield.engine.stage import Stage
from lightfield.exporters import BESIDE_VIEWS
from lightfield.formats import passes
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
from lightfield.workflow import job_fields as fields
from lightfield.workflow import job_settings as settings
from lightfield.workflow.build import Build, Wildcards
from lightfield.workflow.job_fields import Fields, FieldsOf
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
    # None if no member of a family has such a job.
    fields: FieldsOf | None = None
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

    def name_of(self, dataset: Dataset) -> str:
        """Return the name of a dataset's job."""
        return self.name.format(scene=dataset.scene_folder, rig=dataset.rig_folder)

    def stage_of(self, build: Build, wildcards: Wildcards, fields: Fields) -> Stage[Any]:
        """Return the stage of a job, with its settings."""
        if self.settings is None:
            return self.stage(**fields)
        model = self.stage.settings_model(**fields)
        content = self.settings(build, wildcards).content
        return self.stage(settings=model.model_validate(content), **fields)


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
    fields.build_scene,
)
IMPORT_MODEL = Job(
    "{name}/import_model",
    scene.ImportModel,
    "scene",
    _costs(BLENDER),
    of_scene("import_model", settings.import_model),
    fields.import_model,
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
    fields.inventory,
    file=lambda paths: paths.inventory,
    has_bundle=True,
)
FREE_PLACES = Job(
    "{scene}/{rig}/free_places",
    rig.FreePlaces,
    "cameras",
    _costs(BLENDER),
    of_dataset("free_places", settings.free_places),
    fields.free_places,
    times="{scene}/{rig}/cameras/free_places",
)
LIGHTFIELD = Job(
    "{scene}/{rig}/lightfield",
    rig.MakeLightfield,
    "cameras",
    _costs(JOB),
    of_dataset("lightfield", settings.lightfield),
    fields.lightfield,
    times="{scene}/{rig}/cameras/lightfield",
    file=lambda paths: paths.lightfield,
    has_bundle=True,
    is_local=True,
)
CHECK_CAMERAS = Job(
    "{scene}/{rig}/check_cameras",
    rig.CheckCameras,
    "cameras",
    _costs(BLENDER),
    fields=fields.check_cameras,
    times="{scene}/{rig}/cameras/check_cameras",
)
CORNERS = Job(
    "{scene}/{rig}/corners",
    rig.FindCorners,
    "cameras",
    _costs(BLENDER),
    fields=fields.corners,
    times="{scene}/{rig}/cameras/corners",
    file=lambda paths: paths.corners,
)
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
    f"{{scene}}/{{rig}}/{RENDERED}/{{first}}-{{end}}",
    views.RenderShard,
    "views",
    _of_views(_rendered_or_imported),
    fields=fields.render,
    has_bundle=True,
    renders=True,
)
FLOW = Job(
    f"{{scene}}/{{rig}}/{passes.FLOW.name}/{{first}}-{{end}}",
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
    fields.reprojected_lightfield,
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
    fields.reproject,
    has_bundle=True,
)
# After the views, so that a member without views has no list of them.
SPLITS = Job(
    "{scene}/splits",
    views.ListSplits,
    "cameras",
    _costs(JOB),
    fields=fields.splits,
    is_local=True,
)
HEADS = Job(
    "{scene}/heads",
    views.ListHeads,
    "cameras",
    _costs(JOB),
    fields=fields.heads,
    is_local=True,
)
EXPORT = Job(
    "{scene}/{rig}/{source}export_{format}",
    exports.ExportViews,
    "exports",
    _of_dataset(cost.checking),
    of_others(settings.export_of),
    fields.export,
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
        # `EXPORT` stands for all exports of a build.
        fields=None,
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
VIDEO = Job(
    "{scene}/{rig}/video",
    report.MakeVideo,
    "exports",
    _of_dataset(cost.filming),
    of_dataset("video", settings.video),
    file=lambda paths: paths.video_list,
    has_bundle=True,
)
VALIDATE = Job(
    "{scene}/{rig}/validate",
    checks.Validate,
    "validation",
    _of_dataset(cost.checking),
    of_dataset("validate", settings.validate),
    fields.validate,
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
    fields.checksums,
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
SEQUENCE_PAGE = Job(
    "{scene}/{rig}/frames_page",
    report.ReportSequence,
    "report",
    lambda build, names: cost.drawing_frames(build.frames(names)),
    of_others(settings.sequence_page),
    times="{scene}/{rig}/report/frames_page",
    is_of_sequence=True,
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

JOBS = [
    job
    for record in globals().values()
    if isinstance(record, Job)
    for job in (EXPORT_RULES.values() if record is EXPORT else [record])
]
"""All jobs, in the order of the work."""
ORDER = {job: place for place, job in enumerate(JOBS)}


def jobs_of(build: Build) -> Iterator[tuple[Job, Wildcards, Fields]]:
    """Yield the jobs of a build whose records have fields, with their wildcards and fields."""
    # Datasets that test take the scale of those that train.
    datasets = sorted(build.chosen, key=lambda dataset: dataset.trained_by is not None)
    for job in JOBS:
        if job.fields:
            found = [each for dataset in datasets for each in _wildcards_of(job, dataset)]
            for wildcards in {job.name.format(**each): each for each in found}.values():
                job_fields = job.fields(build, wildcards)
                if job_fields is not None:
                    yield job, wildcards, job_fields


def _wildcards_of(job: Job, dataset: Dataset) -> Iterator[Wildcards]:
    """Yield the wildcards of all jobs of a kind that a dataset may have."""
    choices: dict[tuple[str, ...], list[tuple[str, ...]]] = {
        ("name",): [(dataset.scene_name,)],
        ("scene",): [(dataset.scene_folder,)],
        ("rig",): [(dataset.rig_folder,)],
        ("first", "end"): [(str(first), str(end)) for first, end in dataset.shards],
        ("reprojection",): [(name,) for name in dataset.reprojections],
        ("source",): [(prefix_of(source),) for source in (VIEWS, *dataset.reprojections)],
        ("format",): [(name,) for name in dataset.exports.selected],
    }
    used = {keys: values for keys, values in choices.items() if f"{{{keys[0]}}}" in job.name}
    for values in itertools.product(*used.values()):
        yield dict(zip(itertools.chain(*used), itertools.chain(*values), strict=True))
