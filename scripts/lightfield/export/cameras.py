"""A lens as other programs' camera models have it, in pixels."""

from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.kannala_brandt import KannalaBrandt
from lightfield.geometry.lenses.rectilinear import Rectilinear


def focal_pixels(lens: Rectilinear | KannalaBrandt) -> tuple[float, float]:
    """Return a focal length in mm in pixels across and down."""
    return (
        lens.focal_length * lens.width / lens.sensor[0],
        lens.focal_length * lens.height / lens.sensor[1],
    )


def opencv_fisheye(lens: Lens) -> tuple[float, ...]:
    """Return fx, fy in pixels and k1 to k4 of OpenCV's fisheye: r = f (θ + k1 θ³ + …).

    Raises TypeError for a lens that is none: `lightfield.dataset.exports` refuses it before.
    """
    if isinstance(lens, KannalaBrandt):
        return (*focal_pixels(lens), *lens.coefficients)
    if isinstance(lens, Equidistant):
        return (lens.width / lens.fov, lens.height / lens.fov, 0.0, 0.0, 0.0, 0.0)
    raise TypeError(f"{type(lens).__name__} is no fisheye of OpenCV's")
