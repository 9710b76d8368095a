"""lightfield.json: the lens of a dataset, and the pose of each of its views.

SILVR's keys are ``camera``, ``lf_type``, ``resolution``, ``sensor_size`` and ``frames``. Files that
SILVR's tools wrote have these alone, and are read, too. Ours are:

- ``depth``: what channel Z of the views means.
- ``frame``: the frame of the scene that was rendered.
- ``scene`` and ``render``: what was rendered, and how.
- ``machine``: the properties of the machine that change last digits.
- ``head``: the head that the camera belongs to, and where it sits on the head's body.
- ``passes``: which of the passes in ``render`` a reprojection has.
- ``split`` of a frame: what the view is for.
- ``imu``: the inertial sensor whose files lie beside it.
- ``flow`` of a frame: the view to which its flow leads.
- ``exposure`` of a frame: the camera-to-world matrices at the ``start`` and the ``end`` of the
  exposure of a moving camera. ``world_matrix`` is the matrix in its middle.
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
from lightfield.formats import passes
from lightfield.formats.passes import PASSES, Pass
from lightfield.formats.render_block import RenderBlock
from lightfield.geometry import lenses, rotations
from lightfield.geometry.exposure import pose_at
from lightfield.geometry.flow import neighbours
from lightfield.geometry.frames import Frame, read_frames
from lightfield.geometry.lenses import Lens

if TYPE_CHECKING:
    from lightfield.geometry import rigs

Floats = NDArray[np.float64]

NAME = "lightfield.json"
# Metres between the eyes of a pair. Views of a file with this key have no centre.
OMNIDIRECTIONAL = "omnidirectional_stereo"
# The poses of a moving camera, of a frame.
EXPOSURE = "exposure"
# The properties of the machine that made the file, as far as they change bytes. Each view names its
# own machine.
MACHINE = "machine"
# The size and center of a rig that fits the scene's box, in metres.
RIG_FIT = "rig_fit"
# The head that the camera belongs to, and its pose there.
HEAD = "head"
# How a model came into the unit box: its shift in metres, and then its scale.
MODEL_PLACEMENT = "model_placement"


@dataclass(frozen=True, eq=False)
class View:
    """A view, which SILVR calls a frame. Here, a frame is a frame of an animated scene.

    - ``name``: the name, such as view_0000f.
    - ``world_from_camera``: the camera-to-world matrix (4, 4) in metres. The camera looks along −Z,
      and +Y is up.
    - ``position``: the place (3,) in metres of the same pose.
    - ``rotation``: the rotation (3,) of the same pose, as Blender's XYZ Euler angles in radians.
    - ``others``: the frame's other keys.
    """

    name: str
    world_from_camera: Floats
    position: Floats
    rotation: Floats
    others: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def placed(
        cls, name: str, world_from_camera: Floats, others: Mapping[str, Any] | None = None
    ) -> "View":
        """Return the view with a camera-to-world matrix (4, 4)."""
        rotation = rotations.matrix_to_euler(world_from_camera[:3, :3])
        return cls(name, world_from_camera, world_from_camera[:3, 3], rotation, others or {})

    @classmethod
    def from_frame(cls, frame: Frame) -> "View":
        """Return the view of a frame. Where a form of the pose is missing, the other gives it."""
        world_from_camera = frame.world_from_camera
        if world_from_camera is None:
            assert frame.position is not None
            assert frame.rotation is not None
            world_from_camera = np.eye(4)
            world_from_camera[:3, :3] = rotations.euler_to_matrix(frame.rotation)
            world_from_camera[:3, 3] = frame.position
        if frame.position is None or frame.rotation is None:
            return cls.placed(frame.name, world_from_camera, frame.others)
        return cls(frame.name, world_from_camera, frame.position, frame.rotation, frame.others)

    @property
    def split(self) -> str | None:
        """What the view is for: ``train``, ``validation`` or ``test``. None without a split."""
        return self.others.get("split")

    @property
    def exposure(self) -> tuple[Floats, Floats] | None:
        """The camera-to-world matrices (4, 4) in metres, at the start and the end of the exposure.

        None if the camera stands still.
        """
        poses = self.others.get(EXPOSURE)
        return (np.array(poses["start"]), np.array(poses["end"])) if poses else None

    @property
    def flow(self) -> str | None:
        """The name of the view's flow, <view>_to_<other view>; None without flow."""
        return f"{self.name}_to_{self.others['flow']}" if "flow" in self.others else None

    def to_camera(self, points: Floats) -> Floats:
        """Return points (n, 3) in the world in the camera's coordinates, in metres."""
        world_from_camera = self.world_from_camera
        return np.asarray((points - world_from_camera[:3, 3]) @ world_from_camera[:3, :3])

    def to_json(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "position": self.position.tolist(),
            "rotation": self.rotation.tolist(),
            "world_matrix": self.world_from_camera.tolist(),
            **self.others,
        }


@dataclass(frozen=True, eq=False)
class HeadCamera:
    """One of the cameras of a head, which have fixed poses on one body.

    - ``head``: the head's name.
    - ``name``: the camera's name.
    - ``body_from_camera``: the matrix (4, 4) from the camera's axes to the body's, in metres.
    """

    head: str
    name: str
    body_from_camera: Floats

    def body_of(self, world_from_camera: Floats) -> Floats:
        """Return the body's pose (4, 4) in the world, from the camera's."""
        return np.asarray(world_from_camera @ np.linalg.inv(self.body_from_camera))

    def to_json(self) -> dict[str, Any]:
        return {
            "name": self.head,
            "camera": self.name,
            "body_from_camera": self.body_from_camera.tolist(),
        }


@dataclass(eq=False)
class LightField:
    """A lightfield.json.

    - ``content``: its keys without ``frames``.
    - ``views``: the entries of its key ``frames``.
    - ``path``: the file, for messages.
    - ``lens``: the lens, which all views share.
    - ``depth``: what channel Z of the views means: "z", along the optical axis, "distance", or None
      for no depth. SILVR's files lack this key. Then it is "z" if the lens can have that.

    Raises `UserError`, one line with ``path`` and the key, for an unknown lens, a depth that the
    lens cannot have, and unknown passes.
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
        """Return the light field that a rig sees through a lens. ``keys`` are added to the file.

        Raises `UserError` if a cube map's lens is not a 90° rectilinear one.
        """
        # Imported here, because most programs read a file and need no rig's settings.
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
        if mount := rig.mount:
            content[HEAD] = HeadCamera(mount.head, mount.name, mount.body_from_camera).to_json()
        views = [
            View(
                pose.name,
                np.round(pose.world_from_camera(), 12) + 0.0,  # without noise such as 6e-17 or −0
                np.array(pose.position),
                np.array(pose.rotation),
                {"split": pose.split} if pose.split else {},
            )
            for pose in rig.poses()
        ]
        return cls(content, views)

    @classmethod
    def read(cls, path: Path | str) -> "LightField":
        """Read a file. Raises `UserError`, one line that names the file and the wrong key.

        `lightfield.geometry.frames` says which poses are read. If a frame gives its pose in both
        forms, they are not compared: validation does that.
        """
        path = Path(path)
        content = read_json(path)
        if not isinstance(content, dict):
            raise UserError(f"{path}: must be a mapping, not a {type(content).__name__}")
        return cls.from_json(content, path)

    @classmethod
    def from_json(cls, content: Mapping[str, Any], path: Path = Path(NAME)) -> "LightField":
        """Return the light field of a file's ``content``. Raises the errors of `read`."""
        others = dict(content)
        frames = others.pop("frames", None)
        lightfield = cls(others, (), path)
        try:
            views = [View.from_frame(frame) for frame in read_frames(frames)]
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
        """Return a copy with another lens, with other views, or with other values of ``keys``."""
        intrinsics = lens.to_lightfield() if lens else {}
        return replace(
            self,
            content={**self.content, **intrinsics, **keys},
            views=self.views if views is None else views,
        )

    def with_flow(self) -> "LightField":
        """Return a copy in which the flow of each view leads to a neighbour."""
        targets = [self.views[number].name for number in neighbours(self.world_from_cameras)]
        return self.changed(
            views=[
                replace(view, others={**view.others, "flow": target})
                for view, target in zip(self.views, targets, strict=True)
            ]
        )

    def with_exposure(self) -> "LightField":
        """Return a copy whose views have the poses at the start and the end of their exposures."""
        motion = self.render.camera_motion
        assert motion
        # The cameras of a head move with its body.
        body_from_camera = self.head.body_from_camera if self.head else np.eye(4)
        camera_from_body = np.linalg.inv(body_from_camera)
        views = []
        for view in self.views:
            world_from_body = view.world_from_camera @ camera_from_body
            world_from_cameras = {}
            for name, time in (("start", -0.5), ("end", 0.5)):
                pose = pose_at(world_from_body, motion.travel, motion.turn, time)
                pose = pose @ body_from_camera
                world_from_cameras[name] = (np.round(pose, 12) + 0.0).tolist()
            views.append(replace(view, others={**view.others, EXPOSURE: world_from_cameras}))
        return self.changed(views=views)

    @cached_property
    def head(self) -> HeadCamera | None:
        """The camera's place in its head. None without a head, and for faces of a cube map.

        Raises `UserError` for a wrong entry.
        """
        if HEAD not in self.content:
            return None
        try:
            content = self.content[HEAD]
            if "body_from_camera" not in content:
                return None
            matrix = np.array(content["body_from_camera"], np.float64).reshape(4, 4)
            return HeadCamera(str(content["name"]), str(content["camera"]), matrix)
        except (LookupError, TypeError, ValueError):
            raise UserError(
                f"{self.path}: {HEAD}: must have name, camera and body_from_camera, a matrix of "
                "4 × 4 numbers"
            ) from None

    @property
    def folder(self) -> Path:
        """The folder that the file lies in."""
        return self.path.parent

    @cached_property
    def world_from_cameras(self) -> Floats:
        """The views' camera-to-world matrices (n, 4, 4) in metres."""
        return np.array([view.world_from_camera for view in self.views]).reshape(-1, 4, 4)

    @property
    def frame(self) -> float:
        """The frame of the scene that was rendered.

        Only a .blend's own frame may have a fraction: `frame: file` of a file saved between two.
        """
        frame: float = self._key("frame", (int, float), "a number")
        return frame

    @property
    def scene(self) -> Mapping[str, Any]:
        """What was rendered: ``name``, ``fingerprint`` and how the scene was built."""
        scene: Mapping[str, Any] = self._key("scene")
        return scene

    @cached_property
    def render(self) -> RenderBlock:
        """How the views were rendered. Raises `UserError` if this is missing or wrong."""
        return RenderBlock.read(self._key("render"), f"{self.path}: render")

    @property
    def known_render(self) -> RenderBlock:
        """How the views were rendered, as far as the file says. SILVR's files say nothing."""
        return self.render if "render" in self.content else RenderBlock()

    @property
    def passes(self) -> list[Pass]:
        """The views' passes beside colour and depth. A reprojection may have fewer passes."""
        if "passes" in self.content:
            return [passes.by_name(name) for name in self.content["passes"]]
        return self.known_render.selected_passes

    @property
    def light_groups(self) -> list[str]:
        """The names of the light groups. The views have a pass of each."""
        passes_of_groups = [each for each in self.passes if passes.is_group(each)]
        return [each.name.removeprefix(passes.GROUP_PREFIX) for each in passes_of_groups]

    @property
    def is_relit(self) -> bool:
        """Whether the views show the scene under another light than they were rendered in."""
        return "relight" in self.content.get("reprojection", {})

    @property
    def look(self) -> dict[str, Any] | None:
        """The look with which the views are developed, if they are."""
        look: dict[str, Any] | None = self.content.get("reprojection", {}).get("look")
        return look

    @property
    def has_look(self) -> bool:
        """Whether the views are developed with one of Blender's looks."""
        return self.look is not None

    @property
    def follows_views(self) -> bool:
        """Whether objects of the scene follow each view's camera: each view shows another scene."""
        scene = self.content.get("scene")
        return isinstance(scene, Mapping) and scene.get("followed_camera") == "view"

    @property
    def transparent(self) -> bool:
        """Whether the views have a channel A: the part of each pixel that the scene covers."""
        return bool(self.known_render.transparent)

    def require_rig(self, rig: "rigs.Rig") -> None:
        """Raise `UserError` if the file and a rig differ in the number of views."""
        if rig.view_count != len(self.views):
            raise UserError(
                f"{self.path}: frames: are {len(self.views)}, but its rig has {rig.view_count}"
            )

    def placed(self, rig: "rigs.Rig") -> "rigs.Rig":
        """Return the rig with the size and center that it has here, if they fit the scene's box."""
        if not rig.is_fitted:
            return rig
        place = self._key(RIG_FIT)
        size, center = (
            tuple(value) if isinstance(value, list) else value
            for value in (place.get("size"), place.get("center"))
        )
        return rig.model_copy(update={"size": size, "center": center})

    def require_centre(self) -> None:
        """Raise `UserError` if the rays of a view do not start from one point."""
        if OMNIDIRECTIONAL in self.content:
            raise UserError(
                f"{self.path}: {OMNIDIRECTIONAL}: its views have no centre; no other lens sees "
                "what they see, and no other program reads their poses"
            )

    def _key(self, key: str, kind: Any = Mapping, kind_name: str = "a mapping") -> Any:
        """Return the value of a key. Raises `UserError` if it is missing or of another kind."""
        if key not in self.content:
            raise UserError(f"{self.path}: {key}: is missing; scripts/make_lightfield.py writes it")
        if not isinstance(self.content[key], kind):
            raise UserError(f"{self.path}: {key}: must be {kind_name}")
        return self.content[key]
