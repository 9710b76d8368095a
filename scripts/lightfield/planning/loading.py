"""Resolves the datasets of a configuration and its scene YAMLs, within a preset's limits."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Literal

from lightfield.configuration import blend_lock, scene_yaml
from lightfield.configuration.config_file import Configuration, Preset
from lightfield.configuration.dataset import Cluster, Dataset
from lightfield.configuration.family import Family
from lightfield.configuration.render_settings import CALIBRATED_KEYS, Render
from lightfield.configuration.reprojections import Reprojection
from lightfield.configuration.scene_blocks import MeshFiles, Video
from lightfield.configuration.scene_checks.rigs import FLOW_PLACES, small_image
from lightfield.core.errors import UserError
from lightfield.core.names import FILE, VIEWS, scene_folder
from lightfield.exporters import Exports
from lightfield.formats import published
from lightfield.formats.render_block import MeasuredTargetError, RenderBlock, TargetError
from lightfield.geometry.lenses import CameraSettings
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.overview import sees_all_round
from lightfield.geometry.rigs import Poses, Rig
from lightfield.planning.shard_counts import shard_count

# A rig with one of these splits tests models that were trained on another rig's views.
_TESTED_WITH = ("validation", "test")


def load_datasets(settings: Configuration, cluster: Cluster | None = None) -> list[Dataset]:
    """Read the scene YAMLs that a configuration chooses, and resolve their datasets.

    ``cluster`` is the cluster that renders them, if any. Raises `UserError` for a scene that is
    missing, wrong, or without the chosen rigs. Also raises it for two scenes with equal folders.
    A family of scenes has no datasets here: `chosen_families` has them.
    """
    datasets: list[Dataset] = []
    limits = settings.presets[settings.preset]
    scenes = []
    for scene in settings.scenes:
        _check_scene_folder(scene, settings)
        if scene_yaml.family_of(scene) is None:
            scenes.append(scene)
            datasets += scene_datasets(scene, settings.preset, limits, settings, cluster)
    if settings.rigs == "all":
        return datasets
    _check_chosen_rigs(settings.rigs, scenes, datasets)
    return [dataset for dataset in datasets if dataset.rig_name in settings.rigs]


def chosen_families(settings: Configuration) -> dict[str, Family]:
    """Return the families of scenes that a configuration chooses, by their names.

    Raises `UserError` for a wrong scene YAML, and for a choice of rigs, which families lack.
    """
    families = {}
    for scene in settings.scenes:
        if family := scene_yaml.family_of(scene):
            if settings.rigs != "all":
                raise UserError(
                    f"config.yaml: rigs: must be all with {scene}, which is a family: all members "
                    "have the same rigs"
                )
            families[scene] = family
    return families


def _check_scene_folder(scene: str, settings: Configuration) -> None:
    """Raise `UserError` if another scene under another preset would have the same folder.

    The scene garden_tiny has the folder of the scene garden under the preset tiny.
    """
    is_full = settings.preset == "full"
    folder = scene_folder(scene, settings.preset)
    base, _, preset = folder.rpartition("_")
    other_scene = base if is_full else folder
    has_preset_suffix = preset in settings.presets.keys() - {"full"}
    if has_preset_suffix and scene_yaml.scene_path(other_scene).is_file():
        raise UserError(
            f"config.yaml: scenes: {folder} would be the folder of both {base} with "
            f"preset={preset} and {folder}; give one of these scene YAMLs another name"
        )


def _check_chosen_rigs(chosen_rigs: list[str], scenes: list[str], datasets: list[Dataset]) -> None:
    """Raise `UserError` for a chosen rig without a scene, or a scene without a chosen rig."""
    existing_rigs = {dataset.rig_name for dataset in datasets}
    for rig in chosen_rigs:
        if rig not in existing_rigs:
            raise UserError(
                f"config.yaml: rigs: {rig!r} is in none of the scenes {', '.join(scenes)}"
                f"; must be all or some of {', '.join(sorted(existing_rigs))}"
            )
    for scene in scenes:
        # A sequence has a dataset for each frame.
        rigs = dict.fromkeys(
            dataset.rig_name for dataset in datasets if dataset.scene_name == scene
        )
        if not rigs.keys() & set(chosen_rigs):
            raise UserError(
                f"config.yaml: rigs: none of {', '.join(chosen_rigs)} is in {scene}; "
                f"it has {', '.join(rigs)}; all takes them all"
            )


def scene_datasets(
    scene: str,
    preset: str = "full",
    limits: Preset | None = None,
    settings: Configuration | None = None,
    cluster: Cluster | None = None,
) -> list[Dataset]:
    """Resolve every dataset of one scene YAML under the ``limits`` of a preset.

    Uses the folders and the length of shards of ``settings``. ``cluster`` renders the datasets.
    """
    written = scene_yaml.load_scene(scene)
    common_fields = _folders_and_shards(settings) | {"cluster": cluster}
    return datasets_of(scene, written, preset, limits or Preset(), common_fields)


def datasets_of(
    scene: str,
    written: scene_yaml.Scene,
    preset: str,
    limits: Preset,
    common_fields: Mapping[str, Any],
) -> list[Dataset]:
    """Resolve every dataset of a scene as it is ``written``, under the ``limits`` of a preset.

    ``common_fields`` are fields of `Dataset` with the same value in all of them: folders, shards,
    the cluster, and the member.
    """
    source = written.scene
    if source.blend:
        checksum, _ = blend_lock.blend_sha256(scene, source)
        source = source.model_copy(update={"sha256": checksum})
    datasets = []
    for name, rig in written.rigs.items():
        reprojections = _reprojections_of(name, written, limits)
        exports = _exports_of(name, written, reprojections)
        limited_rig = _rig_of(scene, name, written, preset, limits)
        _check_limited_exports(scene, name, preset, limited_rig, exports)
        for folder, frame in _frames(name, rig, source.frame):
            dataset = Dataset(
                scene_name=scene,
                preset=preset,
                rig_name=name,
                rig_folder=folder,
                written=written,
                source=source.model_copy(update={"frame": frame}),
                render=_limited_render(written.render, rig, limits),
                rig=limited_rig,
                reprojections=reprojections,
                flow=written.flow,
                mesh=_mesh_of(name, written),
                video=_video_of(name, written),
                exports=exports,
                has_panorama=_has_panorama(rig, written),
                limits=limits,
                shard_count=shard_count,
                **_split_partners(rig, written, folder.removeprefix(name)),
                **common_fields,
            )
            datasets.append(dataset)
    return datasets


def rig_dataset(scene: str, rig: str | None) -> Dataset:
    """Return the dataset of a scene's rig, or of its first. Raises `UserError` for another rig."""
    datasets = scene_datasets(scene)
    dataset = next((d for d in datasets if rig in (None, d.rig_folder)), None)
    if dataset is None:
        rig_names = ", ".join(d.rig_folder for d in datasets)
        raise UserError(f"--rig: is {rig!r}; must be one of {rig_names}")
    return dataset


def _rig_of(scene: str, name: str, written: scene_yaml.Scene, preset: str, limits: Preset) -> Rig:
    """Return a rig under a preset's ``limits``. Raises `UserError` if too few views remain."""
    try:
        rig = _limited_rig(written.rigs[name], limits, written.render is not None)
    except UserError as error:
        problem = f"rigs.{name}: {error}; let the preset have more views"
        raise scene_yaml.mistake(scene, problem) from None
    if written.render and (too_small := small_image(rig.camera.resolution)):
        problem = f"rigs.{name}.camera.resolution: under the preset {preset}, {too_small}"
        raise scene_yaml.mistake(scene, f"{problem}; let the preset have more pixels")
    if written.flow and rig.is_at_one_place():
        raise scene_yaml.mistake(
            scene,
            f"flow: {FLOW_PLACES}, but the preset {preset} leaves one of rigs.{name}; "
            "let the preset have more views",
        )
    return rig


def _reprojections_of(
    name: str, written: scene_yaml.Scene, limits: Preset
) -> dict[str, Reprojection]:
    """Return the reprojections of a rig's views."""
    reprojections = {}
    for key, reprojection in written.developments.items():
        if name in (reprojection.rigs or written.rigs):
            camera = reprojection.camera and _limited(reprojection.camera, limits)
            reprojections[key] = reprojection.model_copy(update={"camera": camera})
    return reprojections


def _exports_of(
    name: str, written: scene_yaml.Scene, reprojections: dict[str, Reprojection]
) -> Exports:
    """Return the exports of a rig's views and ``reprojections``.

    A rig that tests another rig's training has no training exports of its own. The other rig's
    exports include its views. Rigs that are exported together have one export, of the first.
    """
    is_tested_elsewhere = written.rigs[name].split in _TESTED_WITH
    exports = {}
    for key, export in written.exports.selected.items():
        sources = [source for source in export.sources if source in (VIEWS, *reprojections)]
        is_chosen = name in (export.chosen_rigs or written.rigs)
        belongs_elsewhere = is_tested_elsewhere and export.is_for_training
        if export.joined_rigs:
            belongs_elsewhere = name != export.joined_rigs[0]
        is_made = is_chosen and not belongs_elsewhere
        exports[key] = export.model_copy(update={"sources": sources}) if is_made else None
    return written.exports.model_copy(update=exports)


def _check_limited_exports(scene: str, name: str, preset: str, rig: Rig, exports: Exports) -> None:
    """Check that the exports' consumers can take a rig from which a preset left out cameras."""
    for key, export in exports.selected.items():
        if export.sources and (refusal := export.rig_refusal(rig)):
            raise scene_yaml.mistake(
                scene, f"exports.{key}: under the preset {preset}, the rig {name} {refusal}"
            )


def _mesh_of(name: str, written: scene_yaml.Scene) -> MeshFiles | None:
    """Return which meshes a rig's dataset holds, if any."""
    mesh = written.mesh
    return mesh if mesh and name in (mesh.rigs or written.rigs) else None


def _video_of(name: str, written: scene_yaml.Scene) -> Video | None:
    """Return which video a rig's dataset holds, if any."""
    video = written.video
    return video if video and name in (video.rigs or written.rigs) else None


def _has_panorama(rig: Rig, written: scene_yaml.Scene) -> bool:
    panorama = written.report.panorama
    return sees_all_round(rig) if panorama == "auto" else panorama


def _split_partners(rig: Rig, written: scene_yaml.Scene, frame_folder: str) -> dict[str, Any]:
    """Return `Dataset.tested_by` of a rig that trains, or `trained_by` of one that tests."""
    split_of_rig = {name: other_rig.split for name, other_rig in written.rigs.items()}
    if rig.split == "train":
        testing = [name for name, split in split_of_rig.items() if split in _TESTED_WITH]
        return {"tested_by": tuple(f"{name}{frame_folder}" for name in testing)}
    if rig.split in _TESTED_WITH:
        training = next((name for name, split in split_of_rig.items() if split == "train"), None)
        return {"trained_by": f"{training}{frame_folder}"}
    return {}


def _folders_and_shards(settings: Configuration | None) -> dict[str, Any]:
    """Return the folders and the length of shards that a configuration chooses."""
    if settings is None:
        return {}
    return {
        "results_root": settings.results,
        "work_root": settings.work,
        "views_per_shard": settings.views_per_shard,
    }


def rendered_frames(datasets: Iterable[Dataset]) -> list[int | Literal["file"]]:
    """Return the frames of a scene that its ``datasets`` render. FILE is the .blend's own."""
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
    """Return a rig within ``limits``. Views that exist already keep their resolution."""
    if limits.views:
        rig = rig.thinned(limits.views)
    if is_rendered:
        rig = rig.model_copy(update={"camera": _limited(rig.camera, limits)})
    return rig


def _limited_render(render: Render | None, rig: Rig, limits: Preset) -> RenderBlock:
    """Return the ``render`` block under a preset's ``limits``.

    With a ``target_error``, the calibration will choose samples, threshold and denoising. The
    preset limits its choice by ``most_samples`` and ``denoise``. For views that exist already, only
    the meaning of their depth and alpha is known.
    """
    if render is None:
        assert isinstance(rig, Poses)
        return published.render(rig)
    content = render.model_dump(exclude_none=True)
    if render.samples is None:
        # The calibration chooses these.
        for key in CALIBRATED_KEYS:
            content.pop(key, None)
    most_samples = limits.samples and max(limits.samples, render.fewest_samples)
    if isinstance(render.samples, int):
        content["samples"] = min(render.samples, most_samples or render.samples)
    elif most_samples:
        content["most_samples"] = most_samples
    # The light groups would no longer add up to the colour, and its variance would not be known.
    if limits.denoise is not None and render.light_groups is None and not render.has_variance:
        content["denoise"] = limits.denoise
    if limits.denoise_prefilter and content.get("denoise"):
        content.setdefault("denoise_prefilter", limits.denoise_prefilter)
    target = render.target_error
    if isinstance(target, TargetError):
        content["target_error"] = target.value
        if target.of_samples is not None:
            samples = min(target.of_samples, limits.samples or target.of_samples)
            content["target_error"] = MeasuredTargetError(
                of_samples=samples, denoise=target.denoise
            )
        if target.denoise == "never":
            content["denoise"] = False
    return RenderBlock(**content)


def _limited(camera: CameraSettings, limits: Preset) -> CameraSettings:
    """Return the camera with an image whose longer side has at most ``limits.resolution`` pixels.

    An even side stays even, because video and some trainers need this.
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
        # Pixels stay square if a side was rounded.
        update["sensor_size"] = size[0]
    return camera.model_copy(update=update)
