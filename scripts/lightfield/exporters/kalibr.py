"""Writes Kalibr's camchain.yaml: the lenses of one camera or of a head, and their relative poses.

- ``cam0``, ``cam1`` …: the cameras, in the order of the scene YAML.
- ``intrinsics``: the model's parameters, focal lengths and principal point in pixels. Pixel centres
  are whole numbers.
- ``T_cn_cnm1``: the matrix from the camera before to this one, with x right, y down and z forward,
  in metres.

Source: Kalibr's wiki, "YAML formats", and its CameraParameters.
"""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

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
from lightfield.geometry.rotations import OPENCV_AXES

# The number of coefficients of Kalibr's radtan: k1, k2, p1 and p2.
_RADTAN = 4


class Kalibr(Joined):
    """Kalibr's calibration of one camera or of a head."""

    name = "kalibr"
    summary = "Kalibr's camchain.yaml: lenses, and the relative poses of a head's cameras."
    rank = 18
    loader = "import yaml\ncameras = yaml.safe_load(open('{}/camchain.yaml'))"

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if isinstance(lens, BrownConrady) and any(lens.coefficients[_RADTAN:]):
            return f"has k3 to k6, which Kalibr lacks; {TO_RECTILINEAR}"
        model = _model(lens)
        if model is None:
            return f"has a lens that Kalibr lacks; {TO_RECTILINEAR}, or equidistant below 180°"
        return sideways_refusal(lens, "Kalibr's") if model.projection == "pinhole" else None

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
            this_from_last = OPENCV_AXES @ np.linalg.inv(this) @ last @ OPENCV_AXES
            chain[f"cam{number}"]["T_cn_cnm1"] = (this_from_last + 0.0).tolist()
        text = yaml.safe_dump(chain, default_flow_style=None, width=10**6)
        write_text(folder / "camchain.yaml", text)


class _KalibrModel(NamedTuple):
    """A lens in Kalibr's words. ``parameters`` stand before the focal lengths."""

    projection: str
    parameters: Sequence[float]
    distortion: str
    coefficients: Sequence[float]


def _model(lens: Lens) -> _KalibrModel | None:
    """Return Kalibr's model of a lens. None for a lens that it lacks."""
    match lens:
        case Rectilinear():
            return _KalibrModel("pinhole", (), "radtan", (0.0,) * _RADTAN)
        case BrownConrady():
            return _KalibrModel("pinhole", (), "radtan", lens.coefficients[:_RADTAN])
        case Equidistant() | KannalaBrandt():
            _, _, *coefficients = cameras.opencv_fisheye(lens)
            return _KalibrModel("pinhole", (), "equidistant", coefficients)
        case FovModel():
            return _KalibrModel("pinhole", (), "fov", lens.coefficients)
        case DoubleSphere():
            return _KalibrModel("ds", lens.coefficients, "none", ())
        case ExtendedUnified():
            return _KalibrModel("eucm", lens.coefficients, "none", ())
        case Unified():
            return _KalibrModel("omni", lens.coefficients, "none", ())
    return None


def _camera(sensor: heads.HeadSensor, number: int) -> dict[str, Any]:
    """Return the keys of a camera."""
    lens = sensor.lens
    model = _model(lens)
    # `refusal` comes before.
    assert model
    assert isinstance(lens, Rectilinear | Equidistant | CalibratedLens)
    center = [lens.center[0] - 0.5, lens.center[1] - 0.5]
    name = sensor.mount.name if sensor.mount else f"cam{number}"
    return {
        "camera_model": model.projection,
        "intrinsics": [*model.parameters, *cameras.focal_pixels(lens), *center],
        "distortion_model": model.distortion,
        "distortion_coeffs": [*model.coefficients],
        "resolution": [lens.width, lens.height],
        "rostopic": f"/{name}/image_raw",
    }
