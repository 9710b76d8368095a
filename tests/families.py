"""Writes members of a family as a build leaves them: small datasets of the inside of a sphere."""

import numpy as np
from sphere import write_views

from lightfield.core.files import sha256, write_json

RIG = {"type": "plane", "cameras": [3, 1], "size": [1, 0, 1]}
CAMERA = {"lens": "equidistant", "fov": 180, "resolution": [16, 16]}


def add_member(family, name, **values):
    """Write a valid member with one dataset of three views. Returns its folder."""
    dataset = family / name / "dataset"
    shade = values.get("shade", 1.0)

    def see(lens, matrix):
        rays = lens.pixel_rays()
        colour = np.full((*rays.shape[:2], 3), 0.2 * shade, np.float32)
        return colour, np.full(rays.shape[:2], 2 * shade, np.float32)

    write_views(dataset, CAMERA, RIG, see=see)
    write_json(dataset / "validation.json", {"valid": True})
    files = sorted(path for path in dataset.rglob("*") if path.is_file())
    lines = [f"{sha256(path)}  {path.relative_to(dataset)}\n" for path in files]
    (dataset / "sha256sums.txt").write_text("".join(lines))
    # `write_views` gives the images a folder of their own only in this one.
    dataset = dataset.rename(family / name / "plane")
    record = {
        "views": 3,
        "bytes": sum(path.stat().st_size for path in dataset.rglob("*") if path.is_file()),
        "split": None,
        "sha256sums": sha256(dataset / "sha256sums.txt"),
    }
    return write_record(
        family, name, state="valid", values=values, datasets={"plane": record}, seed=int(name)
    )


def add_failure(family, name, cause):
    """Write a member that failed."""
    failure = {"stage": "import_model", "cause": cause, "log": f"work/chairs/{name}/log"}
    return write_record(
        family,
        name,
        state="failed",
        values={},
        datasets={},
        model=f"models/{name}.glb",
        failure=failure,
    )


def write_record(family, name, **content):
    record = {"format": "plenoforge member", "name": name, "key": "0" * 64, **content}
    write_json(family / name / "member.json", record)
    return family / name
