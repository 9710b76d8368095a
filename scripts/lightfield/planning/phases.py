"""The phases of a build, and the stage of each job, by which the display and the forecast count."""

from typing import NamedTuple

# The phase of the jobs that develop views as a sensor sees them.
SENSOR_PHASE = "sensor"


class Kind(NamedTuple):
    """A kind of job: its phase, and the stage of its cost. None if only its log says how long.

    ``is_local`` says that the job takes seconds, and runs beside Snakemake on a cluster, too.
    """

    phase: str
    stage: str | None
    is_local: bool = False


# The kinds of jobs, in the order of the work, by the names of jobs with wildcards.
KINDS = {
    "{name}/build_scene": Kind("scene", "build_scene"),
    "{name}/import_model": Kind("scene", "import_model"),
    "{name}/check_blend": Kind("scene", "check_blend", is_local=True),
    "{name}/inventory": Kind("scene", "inventory"),
    "{scene}/{rig}/free_places": Kind("cameras", "free_places"),
    "{scene}/{rig}/lightfield": Kind("cameras", "lightfield", is_local=True),
    "{scene}/{rig}/check_cameras": Kind("cameras", "check_cameras"),
    "{scene}/splits": Kind("cameras", "splits", is_local=True),
    "{scene}/probe_cameras": Kind("calibration", "probe_cameras", is_local=True),
    "{scene}/calibrate": Kind("calibration", "calibrate"),
    "{scene}/{rig}/render/{first}-{end}": Kind("views", "render"),
    "{scene}/{rig}/flow/{first}-{end}": Kind("flow", "flow"),
    "{scene}/{rig}/{reprojection}/lightfield": Kind(
        "reprojections", "reprojected_lightfield", is_local=True
    ),
    "{scene}/{rig}/{reprojection}/lens_map": Kind("reprojections", "lens_map", is_local=True),
    "{scene}/{rig}/{reprojection}/{first}-{end}": Kind("reprojections", "reproject"),
    "{scene}/{rig}/{source}export_instant_ngp": Kind(
        "exports", "export_to_instant_ngp", is_local=True
    ),
    "{scene}/{rig}/{source}export_{format}": Kind("exports", "export"),
    "{scene}/{rig}/{source}sequence_{format}": Kind("exports", "export_sequence"),
    "{scene}/{rig}/mesh": Kind("exports", "mesh"),
    "{scene}/{rig}/validate": Kind("validation", "validate"),
    "{scene}/{rig}/validate_sequence": Kind("validation", "validate_sequence"),
    "{scene}/{rig}/checksums": Kind("validation", "checksums", is_local=True),
    "{scene}/{rig}/panorama/lightfield": Kind("report", "panorama_lightfield", is_local=True),
    "{scene}/{rig}/panorama/render": Kind("report", "render_panorama"),
    "{scene}/{rig}/figures": Kind("report", "figures", is_local=True),
    "{scene}/{rig}/costs": Kind("report", "costs", is_local=True),
    "{scene}/{rig}/page": Kind("report", "page", is_local=True),
    "index": Kind("report", "index", is_local=True),
    "{scene}/{rig}/package": Kind("package", "pack"),
    "{scene}/{rig}/publish": Kind("package", "publish"),
    "{family}/batches/{batch}": Kind("family", "build_members"),
    "{family}/corpus": Kind("family", "corpus", is_local=True),
    "{family}/members": Kind("family", "count_members", is_local=True),
    "{scene}/{rig}/probe": Kind("plan", None),
    "{scene}/error_vs_time": Kind("measurement", None),
    "{scene}/gpu_check": Kind("benchmark", None),
    "{scene}/{rig}/synthesis": Kind("synthesis", None),
}
# The places of the kinds in the order of the work.
ORDER = {job: place for place, job in enumerate(KINDS)}
