"""A run of scripts/synthesize.py: its cameras, and the files of each picture."""

from contextlib import nullcontext
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from lightfield.core.errors import UserError
from lightfield.core.files import keep_apart
from lightfield.core.progress import Progress
from lightfield.core.units import count
from lightfield.export.trainer_splits import splits
from lightfield.formats.lightfield import NAME, LightField
from lightfield.geometry import lenses, rigs
from lightfield.imaging import images, pictures
from lightfield.imaging.blender_looks import FILE_LOOK
from lightfield.imaging.look import Look
from lightfield.imaging.video import video
from lightfield.reading.dataset import OpenDataset
from lightfield.settings.base import checked_yaml
from lightfield.settings.yaml_files import located, parse_yaml, read_settings_text
from lightfield.stages.synthesis import Synthesize
from lightfield.synthesis.view import Sources, reader


def run(job: Synthesize) -> None:
    """Synthesise the views, and print how much of them are holes."""
    keep_apart("--output", job.output / NAME, job.dataset / NAME, job.poses)
    source = OpenDataset.in_folder(job.dataset, job.reprojection, ".exr")
    source.lightfield.require_centre()
    views = source.lightfield.views
    targets = _poses(job.poses)
    if targets is None:
        parts = splits(source.lightfield)
        views = parts.train
        targets = source.lightfield.changed(views=parts.test)
    sources = Sources(
        source.lens,
        views,
        reader(source),
        fills_holes=not source.lightfield.transparent,
        most=4 * job.best,
    )
    lens = targets.lens
    depth = targets.lens.usual_depth
    targets.changed(depth=depth).write(job.output / NAME)
    rays = lens.pixel_rays()
    exposure = job.exposure
    look = Look.of(job.look, job.exposure or 0.0, source.lightfield.content.get(FILE_LOOK))
    holes = []
    path = job.output / "walk.mp4"
    progress = Progress(len(targets.views), "synthesize", "views")
    size = (lens.width, lens.height)
    with video(path, size, job.rate) if job.video else nullcontext() as add_to_video:
        for view in targets.views:
            synthesised = sources.synthesise(view.world_from_camera, lens, job.best)
            if exposure is None:
                exposure = pictures.exposure_for(synthesised.colour[~synthesised.holes])
            images.write_exr(
                job.output / "exr" / f"{view.name}.exr", synthesised.channels(depth, rays)
            )
            colour = np.nan_to_num(synthesised.colour)
            picture = look.to_pixels(colour, 8) if look else pictures.develop(colour, exposure)
            opaque = np.where(np.isfinite(synthesised.colour[..., 0]), 255, 0).astype(np.uint8)
            images.write_png(job.output / "png" / f"{view.name}.png", np.dstack([picture, opaque]))
            if add_to_video:
                add_to_video(picture)
            holes.append(synthesised.hole_fraction(rays))
            progress.done()
    print(
        f"{count(len(holes), 'view')} of {min(job.best, len(views))} each; "
        f"holes: {np.mean(holes):.3%} of their pixels, at most {max(holes):.3%} of one"
    )


def _poses(path: Path | None) -> LightField | None:
    """Return the cameras of a lightfield.json or of a rig's YAML; None without a file."""
    if path is None:
        return None
    if path.suffix == ".json":
        return LightField.read(path)
    file = str(path)
    text = read_settings_text(path, file)
    rig: rigs.Rig = checked_yaml(
        TypeAdapter(rigs.AnyRig),
        parse_yaml(text, file),
        lambda problem: located(problem, text, file),
    )
    if rig.camera is None:
        raise UserError(f"{path}: camera: is missing; it is the camera of the synthesised views")
    return LightField.from_rig(rig, lenses.from_camera(rig.camera))
