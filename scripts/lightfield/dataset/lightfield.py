"""lightfield.json: the lens of a dataset once, and the pose of each of its views.

The keys are SILVR's (``camera``, ``lf_type``, ``resolution``, ``sensor_size``, ``frames``) and ours
beside them: ``depth``, what channel Z of the views means, ``frame`` of the scene, ``scene`` and
``render``, what was rendered and how, and ``machine``, what of it changes last digits. ``passes``,
of a reprojection, are those of ``render`` that it has. A frame's ``split`` is what the view is for,
and its ``flow`` the view to which its flow leads. Files that SILVR's tools wrote are read too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import read_json, write_json
from lightfield.core.settings import FARTHEST
from lightfield.dataset import passes
from lightfield.dataset.passes import PASSES, Pass
from lightfield.geometry import lenses, rotations
from lightfield.geometry.flow import neighbours
from lightfield.geometry.lenses import Lens

if TYPE_CHECKING:
    from lightfield.geometry import rigs

Floats = NDArray[np.float64]

NAME = "lightfield.json"
# Where this key is, metres between the eyes of a pair, the views have no centre.
OMNIDIRECTIONAL = "omnidirectional_stereo"
# What of the machine changes bytes, as where the file was made; each view names its own.
MACHINE = "machine"


@dataclass(frozen=True, eq=False)
class View:
    """One of ``frames``: what SILVR calls a frame is a view, for a scene has frames of its own.

    ``matrix`` (4, 4) is camera-to-world, in metres; the camera looks along −Z, +Y is up.
    ``position`` (3,) in metres and ``rotation`` (3,), XYZ Euler angles in radians as Blender has
    them, say the same. ``others`` are the frame's other keys.
    """

    name: str
    matrix: Floats
    position: Floats
    rotation: Floats
    others: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def placed(cls, name: str, matrix: Floats, others: Mapping[str, Any] | None = None) -> "View":
        """Return a view of which the matrix (4, 4) is known."""
        rotation = rotations.matrix_to_euler(matrix[:3, :3])
        return cls(name, matrix, matrix[:3, 3], rotation, others or {})

    @property
    def split(self) -> str | None:
        """What the view is for: ``train``, ``validate`` or ``test``; None where none is said."""
        return self.others.get("split")

    @property
    def flow(self) -> str | None:
        """The name of the view's flow, if it has any: <its own>_to_<the other's>."""
        return f"{self.name}_to_{self.others['flow']}" if "flow" in self.others else None

    def to_json(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "position": self.position.tolist(),
            "rotation": self.rotation.tolist(),
            "world_matrix": self.matrix.tolist(),
            **self.others,
        }


@dataclass(eq=False)
class LightField:
    """A lightfield.json: ``content`` holds all its keys but ``frames``, which are the ``views``.

    ``lens`` is that of every view. ``depth`` is what channel Z of the views means: "z", along the
    optical axis, "distance", or None for no depth; where the file lacks the key, as SILVR's do, it
    is "z" if the lens can have that. Raises `UserError`, one line with ``path`` and the key, for a
    lens that is not known, for a depth that it cannot have, and for passes that there are not.
    """

    content: Mapping[str, Any]
    views: Sequence[View]
    path: Path = Path(NAME)
    lens: Lens = field(init=False)
    depth: str | None = field(init=False)

    def __post_init__(self) -> None:
        try:
            self.lens = lenses.from_lightfield(self.content)
        except UserError as error:
            raise UserError(f"{self.path}: {error}") from None
        usual = self.lens.usual_depth
        self.depth = self.content.get("depth", usual)
        if self.depth not in (None, "distance", usual):
            raise UserError(
                f"{self.path}: depth: is {self.depth!r}; with this lens it must be "
                f"{'z, ' if usual == 'z' else ''}distance or null"
            )
        try:
            self.passes  # noqa: B018
        except (LookupError, TypeError):
            raise UserError(f"{self.path}: passes: must be of {', '.join(PASSES)}") from None

    @classmethod
    def from_rig(cls, rig: "rigs.Rig | Mapping[str, Any]", lens: Lens, **keys: Any) -> "LightField":
        """Return what a rig sees through a lens; ``keys`` are further ones of the file.

        Raises `UserError` where a cube map's lens is not a 90° rectilinear.
        """
        # Here, for most programs read a file and need no rig's settings.
        from lightfield.geometry import rigs

        rig = rigs.from_settings(rig)
        intrinsics = lens.to_lightfield()
        if rig.cube_map:
            diagonal = np.diagonal(intrinsics["camera"].get("projection_matrix", np.zeros((4, 4))))
            if not np.allclose(diagonal[:2], 1.0, rtol=0, atol=1e-6):
                raise UserError("cube_map: its camera must be rectilinear with fov: 90 and square")
        content = {
            "camera": intrinsics["camera"],
            "lf_type": rig.lf_type,
            "resolution": intrinsics["resolution"],
            "sensor_size": intrinsics["sensor_size"],
            **keys,
        }
        views = [
            View(
                pose.name,
                np.round(pose.matrix(), 12) + 0.0,  # without noise such as 6e-17 or −0
                np.array(pose.position),
                np.array(pose.rotation),
                {"split": pose.split} if pose.split else {},
            )
            for pose in rig.poses()
        ]
        return cls(content, views)

    @classmethod
    def read(cls, path: Path | str) -> "LightField":
        """Read a file; whatever is wrong with it is a `UserError` of one line that names the key.

        Of ``world_matrix`` on one side and ``position`` and ``rotation`` on the other, one may be
        missing. Where both are there they are not compared: validation does that.
        """
        path = Path(path)
        content = read_json(path)
        if not isinstance(content, dict):
            raise UserError(f"{path}: must be a mapping, not a {type(content).__name__}")
        return cls.from_json(content, path)

    @classmethod
    def from_json(cls, content: Mapping[str, Any], path: Path = Path(NAME)) -> "LightField":
        """Return what a file's ``content`` says; errors are those of `read`."""
        others = dict(content)
        frames = others.pop("frames", None)
        lightfield = cls(others, (), path)
        try:
            if not isinstance(frames, list):
                raise UserError("frames: must be a list of views")
            if not frames:
                raise UserError("frames: is empty")
            views = [_view(f"frames[{index}]", frame) for index, frame in enumerate(frames)]
            seen: set[str] = set()
            for index, view in enumerate(views):
                if view.name in seen:
                    raise UserError(f"frames[{index}]: {view.name}: is the name of two frames")
                seen.add(view.name)
        except UserError as error:
            raise UserError(f"{path}: {error}") from None
        return replace(lightfield, views=views)

    def write(self, path: Path | str) -> None:
        """Write the file, atomically."""
        write_json(path, self.to_json())

    def to_json(self) -> dict[str, Any]:
        """Return the file's content."""
        return {**self.content, "frames": [view.to_json() for view in self.views]}

    def changed(
        self, lens: Lens | None = None, views: Sequence[View] | None = None, **keys: Any
    ) -> "LightField":
        """Return a copy with another lens, other views, or other values of ``keys``."""
        intrinsics = lens.to_lightfield() if lens else {}
        return replace(
            self,
            content={**self.content, **intrinsics, **keys},
            views=self.views if views is None else views,
        )

    def with_flow(self) -> "LightField":
        """Return a copy in which each view has a neighbour to which its flow leads."""
        others = [self.views[number].name for number in neighbours(self.matrices)]
        return self.changed(
            views=[
                replace(view, others={**view.others, "flow": other})
                for view, other in zip(self.views, others, strict=True)
            ]
        )

    @property
    def folder(self) -> Path:
        """The folder that the file lies in."""
        return self.path.parent

    @cached_property
    def matrices(self) -> Floats:
        """The views' camera-to-world matrices, (n, 4, 4)."""
        return np.array([view.matrix for view in self.views]).reshape(-1, 4, 4)

    @property
    def frame(self) -> int:
        """The frame of the scene that was rendered."""
        frame: int = self._key("frame", int, "a whole number")
        return frame

    @property
    def scene(self) -> Mapping[str, Any]:
        """What was rendered: ``name``, ``fingerprint`` and how the scene was built."""
        found: Mapping[str, Any] = self._key("scene")
        return found

    @property
    def render(self) -> Mapping[str, Any]:
        """How it was rendered: the scene YAML's ``render`` block."""
        found: Mapping[str, Any] = self._key("render")
        return found

    @property
    def passes(self) -> list[Pass]:
        """What the views have beside colour and depth; of a reprojection, what it has itself."""
        return passes.selected(self.content if "passes" in self.content else self._render)

    @property
    def transparent(self) -> bool:
        """Whether the views' channel A is how much of a pixel the scene covers."""
        return bool(self._render.get("transparent"))

    def require_rig(self, rig: "rigs.Rig") -> None:
        """Raise `UserError` where these are not as many views as a rig has."""
        if rig.view_count != len(self.views):
            raise UserError(
                f"{self.path}: frames: are {len(self.views)}, but its rig has {rig.view_count}"
            )

    def require_centre(self) -> None:
        """Raise `UserError` where the rays of a view do not start from one point."""
        if OMNIDIRECTIONAL in self.content:
            raise UserError(
                f"{self.path}: {OMNIDIRECTIONAL}: its views have no centre, so that no other lens "
                "sees what they do, and no other program reads their poses"
            )

    @property
    def _render(self) -> Mapping[str, Any]:
        return self.render if "render" in self.content else {}

    def _key(self, key: str, kind: type = Mapping, words: str = "a mapping") -> Any:
        if key not in self.content:
            raise UserError(f"{self.path}: {key}: is missing; scripts/make_lightfield.py writes it")
        if not isinstance(self.content[key], kind):
            raise UserError(f"{self.path}: {key}: must be {words}")
        return self.content[key]


def _view(where: str, frame: Any) -> View:
    """Return the view of one of ``frames``; its matrix from the angles or they from it."""
    if not isinstance(frame, dict):
        raise UserError(f"{where}: must be a mapping, not {frame!r}")
    others = dict(frame)
    name = others.pop("name", None)
    if not isinstance(name, str) or not name or "/" in name or "\\" in name:
        raise UserError(f"{where}: name: must be a file name, not {name!r}")
    numbers = {}
    for key, shape in (("world_matrix", (4, 4)), ("position", (3,)), ("rotation", (3,))):
        if key in others:
            numbers[key] = _numbers(f"{where}: {key}", others.pop(key), shape)
    matrix, position, rotation = map(numbers.get, ("world_matrix", "position", "rotation"))
    if matrix is None:
        if position is None or rotation is None:
            raise UserError(f"{where}: world_matrix: is missing, or position and rotation are")
        matrix = np.eye(4)
        matrix[:3, :3] = rotations.euler_to_matrix(rotation)
        matrix[:3, 3] = position
    if position is None:
        position = matrix[:3, 3]
    if rotation is None:
        rotation = rotations.matrix_to_euler(matrix[:3, :3])
    return View(name, matrix, position, rotation, others)


def _numbers(where: str, value: Any, shape: tuple[int, ...]) -> Floats:
    """Return finite numbers of a given shape as an array."""
    try:
        array = np.array(value)
    except ValueError:  # rows of different lengths
        array = np.empty(0)
    # NaN fails the comparison, too.
    if (
        array.shape != shape
        or array.dtype.kind not in "iuf"
        or not (np.abs(array.astype(np.float64)) <= FARTHEST).all()
    ):
        size = " × ".join(map(str, shape))
        raise UserError(
            f"{where}: must be {size} finite numbers, from -{FARTHEST:g} to {FARTHEST:g}"
        )
    return array.astype(np.float64)
