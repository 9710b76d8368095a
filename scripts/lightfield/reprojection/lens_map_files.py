"""Writes the lens map of a rig, or the lens maps of a cube map's faces."""

from lightfield.core.files import write_text
from lightfield.reprojection import lens_map
from lightfield.reprojection.geometry import ReprojectionGeometry
from lightfield.stages.lenses import ComputeLensMap, lens_map_files

_UNSEEN = "The source does not see this face.\n"


def write(job: ComputeLensMap) -> None:
    """Compute and write the lens maps. A face that the source does not see gets a line of text."""
    _, source = job.read()
    geometry = ReprojectionGeometry.of(job.settings, source)
    maps = {target.suffix: geometry.compute(target) for target in geometry.targets}
    lens_map.report(list(maps.values()))
    # The workflow cannot tell which faces are seen, so it expects a file for each.
    for suffix, file in lens_map_files(job.file, job.settings).items():
        if suffix in maps:
            lens_map.save(file, maps[suffix])
        else:
            write_text(file, _UNSEEN)
