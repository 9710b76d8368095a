"""The datasets that a configuration and its scene YAMLs describe, within a preset's limits."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Literal

from lightfield.core.errors import UserError
from lightfield.dataset import config, published
from lightfield.dataset.config import (
    CHOSEN,
    FILE,
    Configuration,
    Preset,
    Render,
    TargetError,
)
from lightfield.dataset.dataset import Dataset
from lightfield.dataset.description import Cluster
from lightfield.dataset.exports import VIEWS, Exports
from lightfield.geometry.lenses import CameraSettings
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.overview import sees_all_round
from lightfield.geometry.rigs import Poses, Rig

# Parts of a split that a rig may be as a whole beside one that trains.
TESTED_WITH = ("validation", "test")


def load_datasets(settings: Configuration, cluster: Cluster | None = None) -> list[Dataset]:
    """Read the scene YAMLs that a configuration chooses and resolve their datasets.

    ``cluster`` is the one that renders them, if any.
    Raises `UserError` for a scene that is not there, not right, or without the rigs asked for, and
    for one whose folder another scene has under another preset.
    """
    found: list[Dataset] = []
    for scene in settings.scenes:
        full = settings.preset == "full"
        folder = scene if full else f"{scene}_{settings.preset}"
        base, _, preset = folder.rpartition("_")
        other = base if full else folder
        if preset in settings.presets.keys() - {"full"} and config.scene_path(other).is_file():
            raise UserError(
                f"config.yaml: scenes: {folder} would be the folder of both {base} with "
                f"preset={preset} and {folder}; give one of these scene YAMLs another name"
            )
        limits = settings.presets[settings.preset]
        found += scene_datasets(scene, settings.preset, limits, settings, cluster)
    if settings.rigs == "all":
        return found
    known = {dataset.rig_name for dataset in found}
    for rig in settings.rigs:
        if rig not in known:
            raise UserError(
                f"config.yaml: rigs: {rig!r} is in none of the scenes {', '.join(settings.scenes)}"
                f"; must be all or some of {', '.join(sorted(known))}"
            )
    for scene in settings.scenes:
        # A sequence has a dataset for each frame.
        own = dict.fromkeys(dataset.rig_name for dataset in found if dataset.scene_name == scene)
        if not own.keys() & set(settings.rigs):
            raise UserError(
                f"config.yaml: rigs: none of {', '.join(settings.rigs)} is in {scene}; "
                f"it has {', '.join(own)}; all takes them all"
            )
    return [dataset for dataset in found if dataset.rig_name in settings.rigs]


def scene_datasets(
    scene: str,
    preset: str = "full",
    limits: Preset | None = None,
    settings: Configuration | None = None,
    cluster: Cluster | None = None,
) -> list[Dataset]:
    """Resolve every dataset of one scene YAML under the ``limits`` of a preset.

    Of the ``settings``, folders and length of shards count. ``cluster`` is the one that renders.
    """
    limits = limits or Preset()
    written = config.load_scene(scene)
    source = written.scene
    if source.blend:
        checksum, _ = config.blend_sha256(scene, source)
        source = source.model_copy(update={"sha256": checksum})
    datasets = []
    for name, rig in written.rigs.items():
        reprojections = _reprojections_of(name, written, limits)
        for folder, frame in _frames(name, rig, source.frame):
            dataset = Dataset(
                scene_name=scene,
                preset=preset,
                rig_name=name,
                rig_folder=folder,
                source=source.model_copy(update={"frame": frame}),
                render=_limited_render(written.render, rig, limits),
                rig=_rig_of(scene, name, written, preset, limits),
                reprojections=reprojections,
                flow=written.flow,
                exports=_exports_of(rig, written, reprojections),
                has_panorama=_has_panorama(rig, written),
                limits=limits,
                **_split_partners(rig, written, folder.removeprefix(name)),
                **_where_and_how_long(settings),
                cluster=cluster,
            )
            datasets.append(dataset)
    return datasets


def _rig_of(scene: str, name: str, written: config.Scene, preset: str, limits: Preset) -> Rig:
    """Return a rig under a preset's ``limits``; raises `UserError` where they leave too little."""
    file = f"{config.OWN_SCENES}/{scene}.yaml"
    try:
        rig = _limited_rig(written.rigs[name], limits, written.render is not None)
    except UserError as error:
        raise UserError(f"{file}: rigs.{name}: {error}; let the preset have more") from None
    if written.flow and rig.is_at_one_place():
        raise UserError(
            f"{file}: flow: {config.FLOW_PLACES}, but the preset "
            f"{preset} leaves one of rigs.{name}; let the preset have more views"
        )
    return rig


def _reprojections_of(
    name: str, written: config.Scene, limits: Preset
) -> dict[str, config.Reprojection]:
    """Return the reprojections of a rig's views."""
    return {
        key: reprojection.model_copy(
            update={"camera": reprojection.camera and _limited(reprojection.camera, limits)}
        )
        for key, reprojection in written.reprojections.items()
        if name in (reprojection.rigs or written.rigs)
    }


def _exports_of(
    rig: Rig, written: config.Scene, reprojections: dict[str, config.Reprojection]
) -> Exports:
    """Return the exports of a rig's views, and of those of its ``reprojections`` that they name.

    What a rig tests is exported with what is trained on.
    """
    is_tested_elsewhere = rig.split in TESTED_WITH
    exports = {}
    for key, export in written.exports.wanted.items():
        sources = [source for source in export.sources if source in (VIEWS, *reprojections)]
        is_left_out = is_tested_elsewhere and export.is_for_training
        exports[key] = None if is_left_out else export.model_copy(update={"sources": sources})
    return written.exports.model_copy(update=exports)


def _has_panorama(rig: Rig, written: config.Scene) -> bool:
    panorama = written.report.panorama
    return sees_all_round(rig) if panorama == "auto" else panorama


def _split_partners(rig: Rig, written: config.Scene, frame_folder: str) -> dict[str, Any]:
    """Return which rigs test what is trained on this one, and on which this one's are trained."""
    if rig.split == "train":
        testing = [name for name, other in written.rigs.items() if other.split in TESTED_WITH]
        return {"tested_by": tuple(f"{name}{frame_folder}" for name in testing)}
    if rig.split in TESTED_WITH:
        training = next((n for n, other in written.rigs.items() if other.split == "train"), None)
        return {"trained_by": f"{training}{frame_folder}"}
    return {}


def _where_and_how_long(settings: Configuration | None) -> dict[str, Any]:
    """Return the folders and the length of shards that a configuration chooses."""
    if settings is None:
        return {}
    return {
        "results_root": settings.results,
        "work_root": settings.work,
        "views_per_shard": settings.views_per_shard,
    }


def rendered_frames(datasets: Iterable[Dataset]) -> list[int | Literal["file"]]:
    """Return the frames of a scene that its ``datasets`` render; FILE is the .blend's own."""
    frames = {dataset.source.frame for dataset in datasets}
    return sorted(frames, key=lambda frame: (frame == FILE, frame))


def _frames(name: str, rig: Rig, frame: int | str) -> Iterator[tuple[str, int | str]]:
    """Yield the folder and the frame number of each dataset of a rig."""
    if rig.sequence is None:
        yield name, frame
        return
    for folder, number in rig.sequence.folders.items():
        yield f"{name}/{folder}", number


def _limited_rig(rig: Rig, limits: Preset, is_rendered: bool) -> Rig:
    """Return a rig of as many views at most, with a file of poses found from any folder.

    Views that are there already keep their resolution.
    """
    if isinstance(rig, Poses):
        rig = rig.model_copy(update={"file": str(Path(rig.file).resolve())})
    if limits.views:
        rig = rig.thinned(limits.views)
    if is_rendered:
        rig = rig.model_copy(update={"camera": _limited(rig.camera, limits)})
    return rig


def _limited_render(render: Render | None, rig: Rig, limits: Preset) -> dict[str, Any]:
    """Return the ``render`` block under a preset's ``limits``.

    Of views that are there already no more is known than what their depth means.

    With a ``target_error``, samples, threshold and denoising are not known before the calibration;
    what the preset says of them limits its choice: at most ``most_samples``, and ``denoise``.
    """
    if render is None:
        assert isinstance(rig, Poses)
        return {"depth": published.depth(rig)}
    content = render.model_dump(exclude_none=True)
    denoise = {} if limits.denoise is None else {"denoise": limits.denoise}
    if isinstance(render.samples, int):
        samples = min(render.samples, limits.samples or render.samples)
        return {**content, "samples": samples, **denoise}
    most = {"most_samples": limits.samples} if limits.samples else {}
    if render.samples == FILE:
        return {**content, **most, **denoise}
    if isinstance(render.target_error, TargetError):
        content["target_error"] = render.target_error.value
        if render.target_error.denoise == "never":
            denoise = {"denoise": False}
    kept = {key: value for key, value in content.items() if key not in CHOSEN}
    return {**kept, **most, **denoise}


def _limited(camera: CameraSettings, limits: Preset) -> CameraSettings:
    """Return the camera with its image's longer side at most ``limits.resolution`` pixels.

    An even side stays even, which video and some trainers need.
    """
    longer = max(camera.resolution)
    most = limits.resolution or longer
    if most >= longer:
        return camera
    scale = (most if longer % 2 else max(1, most // 2 * 2)) / longer
    steps = [2 - side % 2 for side in camera.resolution]
    sizes = [
        max(1, step * round(side * scale / step))
        for side, step in zip(camera.resolution, steps, strict=True)
    ]
    update: dict[str, Any] = {"resolution": tuple(sizes)}
    if camera.principal_point:
        update["principal_point"] = tuple(
            (at - side / 2) * scale + size / 2
            for at, side, size in zip(camera.principal_point, camera.resolution, sizes, strict=True)
        )
    lens = camera.make()
    size = camera.sensor_size
    square = isinstance(lens, Rectilinear) and lens.has_square_pixels
    if square and isinstance(size, tuple):
        # Pixels stay square where a side is rounded.
        update["sensor_size"] = size[0]
    return camera.model_copy(update=update)
