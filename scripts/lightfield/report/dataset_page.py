"""Writes a dataset's page: one file with its pictures, its quality and its cost."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core import units
from lightfield.core.files import absolute_path
from lightfield.core.names import HEADS, IMU, MESH, SEQUENCE_PAGE, SPLITS, VIDEO
from lightfield.engine.read_files import check_since_plan
from lightfield.exporters import EXPORTERS, lists_beside_views
from lightfield.formats import blend
from lightfield.formats.export_lists import FOLDER, MANIFEST
from lightfield.formats.inventory import read_inventory
from lightfield.formats.layout import IMAGES, REPORT, SUMS
from lightfield.formats.lightfield import NAME, LightField
from lightfield.formats.passes import FLOW, GROUP_PREFIX, is_group
from lightfield.formats.sensors import settings_in
from lightfield.geometry import rigs
from lightfield.geometry.frames import ONE_PLACE
from lightfield.geometry.overview import middle_view
from lightfield.imaging import images
from lightfield.imaging.blender_looks import FILE_LOOK, title
from lightfield.measurement.noise import relative_error
from lightfield.reading.dataset import OpenDataset
from lightfield.report import contact_sheet, faults, page, pass_pictures, snippet, tables, views
from lightfield.report.packing import webp
from lightfield.stages.report import ReportHtml

PICTURES = ("overview", "contact_sheet")
PLOTS = ("depth", "noise")
WIDEST = 1600
# The page shows at most this many views of each reprojection.
_MOST_REPROJECTED = 24
_SHEET_QUALITY = 84
DEPTHS = {"z": "Z-depth, metres", "distance": "distance, metres"}


def write(job: ReportHtml) -> None:
    """Write the page of a dataset.

    Leaves out the sections for which files are missing: validation, measurements, depth, costs.
    """
    folder = job.dataset
    name = job.dataset_name
    dataset = OpenDataset.in_folder(folder)
    lightfield = dataset.lightfield
    rig = lightfield.placed(job.settings.rig)
    lightfield.require_rig(rig)
    validation = tables.validation(folder / "validation.json")
    look = job.settings.look.resolved(lightfield) if job.settings.look else None
    packed = views.collect(
        dataset,
        rig,
        _unreadable(validation),
        _sensor_folder(folder, lightfield),
        look,
    )
    middle = dataset.views[middle_view(rig)]
    layout = contact_sheet.layout(rig, len(lightfield.views))
    lights = pass_pictures.light_groups(middle, packed.data["exposure"])
    if lights:
        packed.data["lights"] = lights
    report = folder / REPORT
    measurements = _measurements(job, lightfield)
    page.write(
        job.output,
        "page.html.j2",
        name=name,
        home="../" * (name.count("/") + 2) + "index.html",
        facts=facts(folder, dataset, rig, packed.missed),
        middle=None if job.settings.panorama else middle.name,
        passes_of=middle.name,
        pictures={stem: page.photo(report / f"{stem}.png", WIDEST) for stem in PICTURES},
        plots={stem: page.plot(report / stem) for stem in PLOTS},
        taken=_taken(job, lightfield),
        packed=packed,
        layout=layout,
        is_one_place=is_at_one_place(lightfield.world_from_cameras[:, :3, 3]),
        lights=lights,
        frames=list(rig.sequence.folders) if rig.sequence else [],
        frame=absolute_path(folder).name,
        sequence_page=SEQUENCE_PAGE,
        passes=list(pass_pictures.collect(middle, packed.data["exposure"], look)),
        reprojected=list(_reprojected(folder, lightfield, rig)),
        render=lightfield.render,
        python=snippet.reading(name, lightfield),
        validation=validation,
        faults={
            (group, check["short"]): faults.collect(folder / (group or IMAGES), check["views"])
            for group, check in _failed(validation)
        },
        measured=measurements,
        costs=tables.costs(report / "costs.json"),
        files=files(folder, lightfield, valid=not validation or validation["valid"]),
        beside_views=[
            (name.replace("_", "-"), path.relative_to(folder).as_posix())
            for name, path in lists_beside_views(folder)
        ],
        yaml=job.settings.yaml,
        command=job.settings.command,
    )


def _sensor_folder(folder: Path, lightfield: LightField) -> Path | None:
    """Return the folder of the rendered views as a sensor sees them. None if there is none.

    If there are several brackets, the page shows the one nearest to the exposure itself.
    """
    stops_of_folder = {}
    for path in sorted(folder.glob(f"*/{NAME}")):
        sensed = LightField.read(path)
        settings = settings_in(sensed.content)
        poses = sensed.world_from_cameras
        is_resampled = sensed.lens != lightfield.lens or len(poses) != len(
            lightfield.world_from_cameras
        )
        if settings and not is_resampled and np.allclose(poses, lightfield.world_from_cameras):
            stops_of_folder[path.parent] = abs(settings.bracket or 0.0)
    return min(stops_of_folder, key=stops_of_folder.__getitem__, default=None)


def _measurements(job: ReportHtml, lightfield: LightField) -> dict[str, tables.Measurement]:
    """Return the measurements that exist, by their names in the template."""
    files = []
    for measurement in job.settings.measurements:
        if measurement.sha256:
            check_since_plan(measurement.file, measurement.sha256)
        files.append(Path(measurement.file))
    dataset = absolute_path(job.dataset)
    name = f"{dataset.parent.name}/{dataset.name}"
    candidates = {
        "error_vs_time": tables.error_vs_time(files, str(lightfield.scene["name"])),
        "synthesis": tables.synthesis(files, name),
        "reprojection": tables.reprojection(files),
        "stability": tables.stability(files),
    }
    return {title: measurement for title, measurement in candidates.items() if measurement}


def _taken(job: ReportHtml, lightfield: LightField) -> list[str]:
    """Return which settings came from the user's own .blend. Empty for scenes that are built."""
    if job.inventory is None:
        return []
    inventory = read_inventory(job.inventory, "blend", "missing")
    uses_camera = isinstance(job.settings.rig, rigs.BlendCamera)
    followed = lightfield.scene.get("followed_camera")
    return blend.usage_notes(
        inventory,
        [lightfield.frame],
        lightfield.render,
        uses_camera,
        followed,
        FILE_LOOK in lightfield.content,
    )


def _failed(validation: Mapping[str, Any] | None) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the image set of each failed check ("" for the views), and the check."""
    if validation is None:
        return
    for group, checks in validation["groups"].items():
        for check in checks:
            if check["passed"] is False:
                yield group, check


def _unreadable(validation: Mapping[str, Any] | None) -> set[str]:
    """Return the rendered views that are missing or damaged, according to the validation."""
    views = set()
    for group, check in _failed(validation):
        if not group and check["short"] in ("views", "images"):
            views.update(check["views"])
    return views


def facts(
    folder: Path, dataset: OpenDataset, rig: rigs.Rig, missed: float | None
) -> list[tuple[str, str]]:
    """Return the most important facts about a dataset, as pairs of title and text.

    ``missed`` is the part of the depths that are inf.
    """
    lightfield = dataset.lightfield
    lens = lightfield.lens
    render = lightfield.render
    noise = relative_error(dataset.views) if render.has_variance else None
    parts = [view.split for view in lightfield.views]
    counts = [f"{parts.count(part)} {part}" for part in dict.fromkeys(parts) if part]
    # Imported views have no known samples.
    samples = f"{render.samples} per pixel" if render.samples else None
    if render.adaptive_threshold:
        samples = f"up to {samples}, adaptive"
    if render.denoise:
        samples = f"{samples}, denoised"
    exrs = list((folder / IMAGES).glob("*.exr"))
    first = folder / IMAGES / f"{lightfield.views[0].name}.exr"
    bpy = images.attribute(first, images.BPY_ATTRIBUTE)
    texts = {
        "Views": f"{len(parts)}" + (f" ({', '.join(counts)})" if counts else ""),
        "Rig": rig_text(rig, lightfield.world_from_cameras[:, :3, 3]),
        "Lens": lens.description,
        "Field of view": " × ".join(f"{math.degrees(a):.4g}°" for a in lens.field_of_view),
        "Resolution": f"{lens.width} × {lens.height}",
        "Frame": str(lightfield.frame),
        "Samples": samples,
        "Noise": noise and f"relative mean squared error {noise:.2g}, by the views' variance",
        "Depth": DEPTHS.get(lightfield.depth or "", "none"),
        "Pixels without a hit": None if missed is None else f"{100 * missed:.3g} %",
        "Size of the views": units.size(sum(path.stat().st_size for path in exrs)),
        "Rendered by": bpy and f"Cycles in bpy {bpy}",
    }
    return [(title, text) for title, text in texts.items() if text]


def is_at_one_place(places: views.Array) -> bool:
    """Return whether the places (n, 3) of a rig's cameras are one place."""
    return bool(np.ptp(places, axis=0).max() < ONE_PLACE)


def rig_text(rig: rigs.Rig, places: views.Array) -> str:
    """Describe a rig: its type, its cameras along each axis, and its size.

    The size of loose poses and paths is the size of the box around their ``places`` (n, 3).
    """
    kind = rig.type
    if isinstance(rig, rigs.Grid):
        kind += " " + " × ".join(map(str, rig.cameras))
    if len(places) == 1:
        return kind
    if is_at_one_place(places):
        return f"{kind}, all at one place"
    size = tuple(np.ptp(places, axis=0).tolist()) if rig.is_loose else rig.extent
    if isinstance(size, tuple):
        return f"{kind}, {' × '.join(f'{side:.4g}' for side in size)} m"
    return f"{kind}, {'⌀ ' if rig.is_round else ''}{size:g} m"


def _reprojected(
    folder: Path, rendered: LightField, rig: rigs.Rig
) -> Iterator[tuple[str, str, int, int, str]]:
    """Yield the name of each reprojection of the ``rendered`` views, and what it changes.

    Then yield the numbers of its views and of the shown views, and a sheet of the latter.
    """
    for path in sorted(folder.glob(f"*/{NAME}")):
        lightfield = LightField.read(path)
        lens = lightfield.lens
        count = len(lightfield.views)
        layout = contact_sheet.layout(rig, count, _MOST_REPROJECTED)
        shown = [lightfield.views[number] for number in layout.views]
        suffix = next((file.suffix for file in path.parent.glob(f"{shown[0].name}.*")), ".exr")
        paths = [path.with_name(f"{view.name}{suffix}") for view in shown]
        sheet = webp(
            contact_sheet.sheet(paths, lens.width, lens.height, columns=layout.columns),
            _SHEET_QUALITY,
        )
        yield path.parent.name, _change(rendered, lightfield), count, len(shown), sheet


def _change(rendered: LightField, reprojected: LightField) -> str:
    """Return what a reprojection changes in the ``rendered`` views, in a few words."""
    changes = []
    if reprojected.lens != rendered.lens:
        changes.append(f"through another lens, {reprojected.lens.description}")
    if reprojected.is_relit:
        changes.append("under other lights")
    if look := reprojected.look:
        changes.append(f"with the look {title(look)}")
    if settings_in(reprojected.content):
        changes.append("as a sensor sees them")
    return "; ".join(changes) or "as other files"


def _exported_files(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield the folder of each export, of the surface and of the video, with what it holds."""
    for pattern in (f"{FOLDER}/*/{MANIFEST}", f"*/{FOLDER}/*/{MANIFEST}"):
        for path in sorted(folder.glob(pattern)):
            place = path.parent
            meaning = EXPORTERS[place.name].summary.removesuffix(".")
            yield f"{place.relative_to(folder)}/", f"export: {meaning}"
    if (folder / MESH / MANIFEST).is_file():
        yield f"{MESH}/", "the surface that the cameras can see, as meshes"
    if (folder / VIDEO / MANIFEST).is_file():
        yield f"{VIDEO}/", "a video that is synthesised from the views"


def files(folder: Path, lightfield: LightField, valid: bool) -> list[tuple[str, str]]:
    """Return the dataset's files, and what each holds. Only a valid dataset has checksums."""
    depth = {
        "z": ", and Z: metres along the optical axis",
        "distance": ", and Z: metres from the camera",
    }.get(lightfield.depth or "", "")
    if depth:
        depth += "; inf where a ray hit nothing"
    first = lightfield.views[0].name
    meanings = [
        (f"{IMAGES}/{first}.exr …", f"the views: scene-linear Rec. 709 R, G, B as half{depth}"),
        ("lightfield.json", "the lens once; position, rotation, and world_matrix of each view"),
    ]
    if IMU in lightfield.content:
        meanings.append((f"{IMU}/", "an inertial sensor: measurements, true motion, views' times"))
    passes = [each for each in lightfield.passes if not is_group(each)]
    if lightfield.views[0].flow:
        passes.append(FLOW)
    meanings += [(f"{view_pass.name}/", view_pass.meaning) for view_pass in passes]
    if lightfield.light_groups:
        meanings.append((f"{GROUP_PREFIX}*/", "the light of each light group; the sum is the view"))
    if (folder.parent / SPLITS).is_file():
        meanings.append((f"../{SPLITS}", "which of the scene's views train, and which test"))
    if lightfield.head:
        meanings.append((f"../{HEADS}", "the cameras that share a body, and their views"))
    for reprojection in sorted(folder.glob(f"*/{NAME}")):
        reprojected = LightField.read(reprojection)
        meanings.append(
            (f"{reprojection.parent.name}/", f"the same views {_change(lightfield, reprojected)}")
        )
    meanings += _exported_files(folder)
    meanings.append(("validation.json", "the checks and their results"))
    if valid:
        meanings.append((SUMS, f"checksums of all files: sha256sum -c {SUMS}"))
    return meanings
