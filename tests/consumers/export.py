"""Exports views of a scene known in closed form, for the consumers' own code to read.

`make consumers` runs this in the project's environment, before check.py.
"""

import shutil
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts"), str(ROOT / "tests")]

from sphere import LENSES, enlarged, write_views  # noqa: E402

from lightfield import export  # noqa: E402
from lightfield.dataset.exports import settings_of  # noqa: E402
from lightfield.export.source import SourceDataset  # noqa: E402

RIG = {"type": "plane", "cameras": [3, 2], "size": 1.2, "center": [0.3, -0.2, 0.1]}
# Enough views for a radiance field to learn from.
LEARNED_RIG = {"type": "random", "count": 40, "size": [2, 2, 1]}
OF = {
    "colmap": ("perspective", "shifted", "fisheye", "opencv", "panorama"),
    "nerfstudio": ("perspective", "shifted", "fisheye", "wide", "panorama"),
    "ncore": ("perspective", "shifted", "fisheye", "wide"),
}


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
            matrices=source.lightfield.matrices,
            rays=source.lens.pixel_rays(),
        )
    for kind, sources in OF.items():
        for name in sources:
            options = {"sources": [name], "points": 40000}
            # COLMAP has no depth maps of panoramas.
            if kind != "ncore" and (kind, name) != ("colmap", "panorama"):
                options["depth"] = True
            settings = settings_of(kind).model_validate(options)
            source = SourceDataset(folder / "dataset", name, ".exr")
            export.run(kind, source, settings, folder / kind / name)
    write_views(folder / "learn" / "dataset", LENSES["panorama"], LEARNED_RIG)
    source = SourceDataset(folder / "learn" / "dataset", "", ".exr")
    settings = settings_of("nerfstudio").model_validate({"sources": ["views"], "depth": True})
    export.run("nerfstudio", source, settings, folder / "learn" / "export")


if __name__ == "__main__":
    main()
