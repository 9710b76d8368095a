"""Export views of a scene that is known in closed form, for the consumers' own code to read.

Run by `make consumers` in the project's environment; check.py reads what this writes in another.
"""

import shutil
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts"), str(ROOT / "tests")]

from sphere import write_views  # noqa: E402

from lightfield import export  # noqa: E402
from lightfield.dataset.exports import settings_of  # noqa: E402
from lightfield.export.source import Source  # noqa: E402

RIG = {"type": "plane", "cameras": [3, 2], "size": 1.2, "center": [0.3, -0.2, 0.1]}
LENSES = {
    "perspective": {"lens": "rectilinear", "fov": 70, "resolution": [96, 72]},
    "shifted": {
        "lens": "rectilinear",
        "focal_length": 20,
        "sensor_size": [36, 30],
        "principal_point": [44.25, 40.0],
        "resolution": [96, 72],
    },
    "fisheye": {"lens": "equidistant", "fov": 170, "resolution": [96, 90]},
    "opencv": {
        "lens": "kannala_brandt",
        "focal_length": 9,
        "coefficients": [0.02, -0.01, 0.003, -0.001],
        "fov": 150,
        "resolution": [96, 96],
    },
    "wide": {"lens": "equidistant", "fov": 220, "resolution": [96, 96]},
    "panorama": {"lens": "equirectangular", "resolution": [96, 48]},
}
OF = {
    "colmap": ("perspective", "shifted", "fisheye", "opencv"),
    "nerfstudio": ("perspective", "shifted", "fisheye", "wide", "panorama"),
}


def main() -> None:
    folder = Path(sys.argv[1])
    shutil.rmtree(folder, ignore_errors=True)
    write_views(folder / "dataset", {**LENSES["wide"], "resolution": [160, 160]}, RIG)
    for name, camera in LENSES.items():
        write_views(folder / "dataset" / name, camera, RIG)
        source = Source(folder / "dataset", name, ".exr")
        np.savez(
            folder / f"{name}.npz",
            names=[view.name for view in source.lightfield.views],
            matrices=source.lightfield.matrices,
            rays=source.lens.pixel_rays(),
        )
    for kind, sources in OF.items():
        for name in sources:
            settings = settings_of(kind).model_validate(
                {"sources": [name], "points": 40000, "depth": True}
            )
            source = Source(folder / "dataset", name, ".exr")
            export.run(kind, source, settings, folder / kind / name)


if __name__ == "__main__":
    main()
