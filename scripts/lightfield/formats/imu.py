"""The files of a rig's inertial sensor (IMU), in the columns of EuRoC and TUM-VI.

- ``imu.csv``: what the sensor measures.
- ``groundtruth.csv``: pose and velocity of the body in the world, and the biases, at the same
  times.
- ``views.csv``: the time of each view, in the middle of its exposure. With a rolling shutter, also
  the times of the first and the last row: the rows between them follow at equal steps.

Times are whole nanoseconds. The first is 0, at the start of the path. The key ``imu`` in
lightfield.json has the sensor's settings.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.files import atomic_path, write_csv
from lightfield.formats.layout import IMAGES, IMU_FILES
from lightfield.formats.lightfield import LightField
from lightfield.formats.render_block import CameraMotion
from lightfield.geometry import rigs
from lightfield.geometry.exposure import row_times
from lightfield.geometry.inertia import GRAVITY, Imu, measured, world_from_body
from lightfield.geometry.rotations import Floats

_TIME = "#timestamp [ns]"
_SENSOR = [
    _TIME,
    *(f"w_RS_S_{axis} [rad s^-1]" for axis in "xyz"),
    *(f"a_RS_S_{axis} [m s^-2]" for axis in "xyz"),
]
# EuRoC's own header has blanks, and no unit of the time.
_TRUTH = [
    "#timestamp",
    *(f" p_RS_R_{axis} [m]" for axis in "xyz"),
    *(f" q_RS_{part} []" for part in "wxyz"),
    *(f" v_RS_R_{axis} [m s^-1]" for axis in "xyz"),
    *(f" b_w_RS_S_{axis} [rad s^-1]" for axis in "xyz"),
    *(f" b_a_RS_S_{axis} [m s^-2]" for axis in "xyz"),
]
_ROWS = ["first_row [ns]", "last_row [ns]"]


def settings_content(imu: Imu) -> dict[str, Any]:
    """Return the key of lightfield.json that describes a sensor."""
    return {**imu.model_dump(mode="json"), "gravity": GRAVITY}


def write(folder: Path, rig: rigs.Path, lightfield: LightField) -> None:
    """Write the sensor's files of a ``rig`` into a dataset's ``folder``."""
    imu = rig.imu
    assert imu
    sensor, truth, views = (folder / name for name in IMU_FILES)
    _write_samples(sensor, truth, rig, imu)
    times = np.repeat(rig.view_times(), rig.views_a_position)
    rows: Floats = np.zeros((len(times), 0))
    motion = lightfield.known_render.camera_motion
    if motion and motion.rolling is not None:
        assert imu.exposure
        ends = row_times(lightfield.lens.height, motion.rolling)[[0, -1]]
        rows = times[:, np.newaxis] + ends * imu.exposure
    header = [_TIME, "filename", *_ROWS[: rows.shape[1]]]
    lines = zip(
        _nanoseconds(times).tolist(), lightfield.views, _nanoseconds(rows).tolist(), strict=True
    )
    write_csv(
        views,
        [
            dict(zip(header, (time, f"{IMAGES}/{view.name}.exr", *ends), strict=True))
            for time, view, ends in lines
        ],
    )


def exposure_note(rig: rigs.Path, motion: CameraMotion) -> str:
    """Return how far a view's ``motion`` during its exposure is from the motion of the path."""
    assert rig.imu and rig.imu.exposure
    path = rig.motion(rig.view_times())
    travel = np.einsum("nij,ni->nj", path.world_from_camera, path.velocities) * rig.imu.exposure
    turn = np.degrees(path.rates * rig.imu.exposure)
    metres = np.max(np.linalg.norm(travel - motion.travel, axis=-1))
    degrees = np.max(np.linalg.norm(turn - motion.turn, axis=-1))
    return (
        "render.camera_motion differs from the path's own motion in imu.exposure by up to "
        f"{metres:.2g} m and {degrees:.2g} degrees"
    )


def _write_samples(sensor: Path, truth: Path, rig: rigs.Path, imu: Imu) -> None:
    """Write what the sensor measures, and the true motion, at each sample."""
    from scipy.spatial.transform import Rotation

    times = _nanoseconds(np.arange(imu.samples) / imu.rate)
    motion = rig.motion(times / 1e9)
    found = measured(motion, imu)
    _write_table(sensor, _SENSOR, times, found.rates, found.forces)
    quaternions = Rotation.from_matrix(world_from_body(motion)).as_quat(canonical=True)
    _write_table(
        truth,
        _TRUTH,
        times,
        motion.positions,
        np.roll(quaternions, 1, axis=-1),
        motion.velocities,
        found.rate_biases,
        found.force_biases,
    )


def _nanoseconds(seconds: Floats) -> NDArray[np.int64]:
    """Return times as whole nanoseconds."""
    return np.asarray(np.rint(seconds * 1e9), np.int64)


def _write_table(path: Path, header: list[str], times: NDArray[np.int64], *columns: Floats) -> None:
    """Write columns (n, k) after the ``times`` (n,), with 12 digits after the point."""
    # Without noise such as −0.
    values = np.round(np.concatenate(columns, axis=-1), 12) + 0.0
    with atomic_path(path) as temporary:
        np.savetxt(
            temporary,
            np.column_stack([times, values]),
            fmt=["%d", *["%.12f"] * values.shape[1]],
            delimiter=",",
            header=",".join(header),
            comments="",
        )
