"""Writes Kalibr's camchain.yaml: the lenses of one camera or of a head, and their relative poses.

- ``cam0``, ``cam1`` …: the cameras, in the order of the scene YAML.
- ``intrinsics``: focal lengths and principal point in pixels. Pixel centres are whole numbers.
- ``T_cn_cnm1``: the matrix from the camera before to this one, with x right, y down and z forward,
  in metres.

Source: Kalibr's wiki, "YAML formats", and its CameraParameters.
"""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.core.files import write_text
from lightfield.export import cameras, heads
from lightfield.export.source import SourceDataset
from lightfield.exporters.base import TO_RECTILINEAR, Joined, sideways_refusal
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.brown_conrady import BrownConrady
from lightfield.geometry.lenses.calibrated import CalibratedLens
from lightfield.geometry.lenses.double_sphere import DoubleSphere
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.extended_unified import ExtendedUnified
from lightfield.geometry.lenses.fov_model import FovModel
from lightfield.geometry.lenses.kannala_brandt import KannalaBrandt
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.lenses.unified import Unified
from lightfield.geometry.rigs import Rig

# Kalibr's models whose intrinsics begin with the lens's coefficients.
_OWN_INTRINSICS: dict[type[Lens], str] = {
    Unified: "omni",
    DoubleSphere: "ds",
    ExtendedUnified: "eucm",
}
_OMNI = tuple(_OWN_INTRINSICS)
_LENSES: tuple[type[Lens], ...] = (
    *(Rectilinear, Equidistant, BrownConrady, KannalaBrandt, FovModel),
    *_OMNI,
)

# From Blender's camera (y up, looks along −z) to Kalibr's (y down, looks along z).
_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])


class Kalibr(Joined):
    """Kalibr's calibration of one camera or of a head."""

    name = "kalibr"
    summary = "Kalibr's camchain.yaml: lenses, and the relative poses of a head's cameras."
    rank = 18
    loader = "import yaml\ncameras = yaml.safe_load(open('{}/camchain.yaml'))"

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if isinstance(lens, BrownConrady) and any(lens.coefficients[4:]):
            return f"has k3 to k6, which Kalibr lacks; {TO_RECTILINEAR}"
        if not isinstance(lens, _LENSES):
            return f"has a lens that Kalibr lacks; {TO_RECTILINEAR}, or equidistant below 180°"
        return None if isinstance(lens, _OMNI) else sideways_refusal(lens, "Kalibr's")

    def joins(self, lens: Lens, other: Lens) -> bool:
        return True

    def rig_refusal(self, rig: Rig) -> str | None:
        if self.joined_rigs and rig.mount is None:
            return "is no camera of a head, so it has no fixed pose to the others"
        return super().rig_refusal(rig)

    def export(self, source: SourceDataset, folder: Path) -> None:
        """Write ``camchain.yaml`` into ``folder``."""
        # Only here, because most plans need no YAML to write.
        import yaml

        sensors = heads.sensors(heads.by_camera(source))
        chain = {f"cam{n}": _camera(sensor, n) for n, sensor in enumerate(sensors)}
        for number, (last, this) in enumerate(pairwise(heads.from_first(sensors)), 1):
            this_from_last = _FLIP @ np.linalg.inv(this) @ last @ _FLIP
            chain[f"cam{number}"]["T_cn_cnm1"] = (this_from_last + 0.0).tolist()
        text = yaml.safe_dump(chain, default_flow_style=None, width=10**6)
        write_text(folder / "camchain.yaml", text)


def _camera(sensor: heads.Sensor, number: int) -> dict[str, Any]:
    """Return the keys of a camera."""
    lens = sensor.lens
    assert isinstance(lens, Rectilinear | Equidistant | CalibratedLens)
    name = sensor.mount.name if sensor.mount else f"cam{number}"
    model, own, distortion, coefficients = _model(lens)
    fx, fy = cameras.focal_pixels(lens)
    return {
        "camera_model": model,
        "intrinsics": [*own, fx, fy, lens.center[0] - 0.5, lens.center[1] - 0.5],
        "distortion_model": distortion,
        "distortion_coeffs": coefficients,
        "resolution": [lens.width, lens.height],
        "rostopic": f"/{name}/image_raw",
    }


def _model(lens: Lens) -> tuple[str, tuple[float, ...], str, list[float]]:
    """Return a lens's camera model, its first intrinsics, its distortion, and the coefficients."""
    if isinstance(lens, Rectilinear):
        return "pinhole", (), "radtan", [0.0] * 4
    if isinstance(lens, Equidistant):
        return "pinhole", (), "equidistant", [0.0] * 4
    assert isinstance(lens, CalibratedLens)
    if type(lens) in _OWN_INTRINSICS:
        return _OWN_INTRINSICS[type(lens)], lens.coefficients, "none", []
    if isinstance(lens, BrownConrady):
        return "pinhole", (), "radtan", list(lens.coefficients[:4])
    model = "fov" if isinstance(lens, FovModel) else "equidistant"
    return "pinhole", (), model, list(lens.coefficients)
