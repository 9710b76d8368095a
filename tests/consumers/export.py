"""Exports views of a scene known in closed form, for the consumers' own code to read.

`make consumers` runs this in the project's environment, before check.py.
"""

import shutil
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts"), str(ROOT / "tests")]

import views_of_all  # noqa: E402
from sphere import LENSES, enlarged, look, look_at_ball, write_views  # noqa: E402

from lightfield.configuration.publication import Credits  # noqa: E402
from lightfield.core.files import sha256  # noqa: E402
from lightfield.export.sequence import SourceSequence  # noqa: E402
from lightfield.export.source import SourceDataset  # noqa: E402
from lightfield.exporters import EXPORTERS  # noqa: E402
from lightfield.formats.lightfield import LightField  # noqa: E402
from lightfield.products import exports  # noqa: E402
from lightfield.publishing.publish import publish  # noqa: E402

RIG = {"type": "plane", "cameras": [3, 2], "size": 1.2, "center": [0.3, -0.2, 0.1]}
# Enough views for a radiance field to learn from.
LEARNED_RIG = {"type": "random", "count": 40, "size": [2, 2, 1]}
PUBLISHED = {
    "description": "The inside of a sphere",
    "licence": "CC-BY-4.0",
    "publish": {
        "creators": [
            {"name": "Ada Lovelace", "orcid": "0000-0002-1825-0097"},
            {"name": "A Laboratory", "type": "organization"},
        ],
        "url": "https://example.org/sphere",
        "publisher": "Zenodo",
        "doi": "10.5281/zenodo.1234567",
        "date": "2026-11-30",
        "limitations": "Few pixels.",
        "biases": "One sphere.",
        "personal_information": "None.",
        "use_cases": "Tests of programs.",
        "social_impact": "None is known.",
        "derived_from": ["https://example.org/textures"],
    },
}
OF = {
    "colmap": ("opencv",),
    "nerfstudio": ("perspective", "shifted", "fisheye", "wide", "panorama"),
    "lichtfeld": ("perspective", "shifted", "fisheye", "panorama"),
    "ncore": ("perspective", "shifted", "fisheye", "wide"),
}

# The frames of a sequence, and what they show.
FRAMES = {1: look, 2: look_at_ball, 5: look_at_ball}
SEQUENCE = {
    "dnerf": {"points": 20000},
    "neural_3d_video": {"points": 20000},
    "ncore_frames": {"points": 20000, "rate": 24},
}


def write_sequence(folder: Path) -> None:
    """Write views of a rig with a split at each frame, and the exports of all frames."""
    camera = enlarged(LENSES["perspective"], 2)
    for number, see in FRAMES.items():
        write_views(folder / "dataset", camera, RIG | {"split": {"every": 3}}, see=see)
        path = folder / "dataset/lightfield.json"
        LightField.read(path).changed(frame=number).write(path)
        (folder / "dataset").rename(folder / f"f{number:05}")
    frames = [f"f{number:05}" for number in FRAMES]
    source = SourceSequence.of_folders(folder, frames, "", ".exr", {})
    for kind, options in SEQUENCE.items():
        if kind == "neural_3d_video" and shutil.which("ffmpeg") is None:
            print("neural_3d_video: is not written, because ffmpeg is not installed")
            continue
        settings = EXPORTERS[kind].model_validate({"sources": ["views"], **options})
        exports.run(source, settings, folder / "exports" / kind)


# Cameras that move while their shutters are open.
TRAVEL = {"travel": [0.2, 0, 0.1], "turn": [0, 20, 5]}
MOVING = {"blurred": TRAVEL, "rolling": TRAVEL | {"rolling": 0.2}}


def export_moving(folder: Path, motion: dict[str, object]) -> None:
    """Export views of a moving camera for NCore."""
    write_views(folder / "dataset", enlarged(LENSES["wide"], 2), RIG)
    path = folder / "dataset" / "lightfield.json"
    content = LightField.read(path).changed(render={"camera_motion": motion}).with_exposure()
    content.write(path)
    source = SourceDataset(folder / "dataset", "", ".exr")
    settings = EXPORTERS["ncore"].model_validate({"sources": ["views"], "points": 40000})
    exports.run(source, settings, folder / "ncore")
    rays = source.lens.pixel_rays()
    names = [view.name for view in content.views]
    np.savez(
        folder / "views.npz", names=names, matrices=content.world_from_cameras, rays=rays, **motion
    )


def publish_views(folder: Path) -> None:
    """Publish views with a split and a reprojection."""
    rig = RIG | {"split": {"every": 3}}
    dataset = folder / "dataset"
    write_views(dataset, LENSES["fisheye"], rig)
    write_views(dataset / "perspective", LENSES["perspective"], rig, suffix=".png")
    path = dataset / "lightfield.json"
    LightField.read(path).changed(scene={"name": "sphere"}, render={"samples": 4}).write(path)
    files = sorted(path for path in dataset.rglob("*") if path.is_file())
    lines = [f"{sha256(path)}  {path.relative_to(dataset)}\n" for path in files]
    (dataset / "sha256sums.txt").write_text("".join(lines))
    publish(dataset, "sphere", Credits.model_validate(PUBLISHED), folder / "sphere", None)


def main() -> None:
    folder = Path(sys.argv[1])
    shutil.rmtree(folder, ignore_errors=True)
    write_views(folder / "dataset", enlarged(LENSES["wide"], 2), RIG)
    for name in sorted({name for sources in OF.values() for name in sources}):
        write_views(folder / "dataset" / name, enlarged(LENSES[name], 2), RIG)
        source = SourceDataset(folder / "dataset", name, ".exr")
        np.savez(
            folder / f"{name}.npz",
            names=[view.name for view in source.lightfield.views],
            matrices=source.lightfield.world_from_cameras,
            rays=source.lens.pixel_rays(),
        )
    for kind, sources in OF.items():
        for name in sources:
            options = {"sources": [name], "points": 40000}
            # LichtFeld has no depth maps of panoramas.
            is_panorama = kind == "lichtfeld" and name == "panorama"
            if kind != "ncore" and not is_panorama:
                options["depth"] = True
            settings = EXPORTERS[kind].model_validate(options)
            source = SourceDataset(folder / "dataset", name, ".exr")
            exports.run(source, settings, folder / kind / name)
    for name, motion in MOVING.items():
        export_moving(folder / "moving" / name, motion)
    write_sequence(folder / "sequence")
    publish_views(folder / "publish")
    views_of_all.write(folder / "each")
    write_views(folder / "learn" / "dataset", LENSES["perspective"], LEARNED_RIG)
    source = SourceDataset(folder / "learn" / "dataset", "", ".exr")
    settings = EXPORTERS["nerfstudio"].model_validate({"sources": ["views"], "depth": True})
    exports.run(source, settings, folder / "learn" / "export")


if __name__ == "__main__":
    main()
