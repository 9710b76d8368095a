"""A dataset as Python sees it: its views, with pixels, rays and projections.

A lightfield.json is read when it is first needed, and pixels each time that they are asked for.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path, PurePosixPath
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.core.names import PARTS
from lightfield.formats import passes
from lightfield.formats.depth import check_size, depth_of
from lightfield.formats.layout import ImageSet
from lightfield.formats.lightfield import NAME, LightField, View
from lightfield.formats.passes import FLOW, NAMES, Pass
from lightfield.geometry.lenses import Lens
from lightfield.imaging import images
from lightfield.reading.files import Files, Folder
from lightfield.reading.surface import SeenSurface

Array = NDArray[Any]
Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False, repr=False)
class OpenView:
    """One view. Arrays have a row for each row of pixels, from the top: (height, width, …).

    A property reads its file each time, so keep the arrays that you need again.

    - ``dataset``: the dataset of its frame.
    - ``camera``: its entry in lightfield.json.
    """

    dataset: "OpenDataset"
    camera: View

    def __repr__(self) -> str:
        return f"<view {self.name} of {self.dataset.lightfield.path}>"

    @property
    def name(self) -> str:
        """The name, such as view_0000f."""
        return self.camera.name

    @property
    def split(self) -> str | None:
        """What the view is for: train, validation or test. None without a split."""
        return self.camera.split

    @property
    def world_from_camera(self) -> Doubles:
        """The camera-to-world matrix (4, 4) in metres. The camera looks along −Z, +Y is up."""
        return self.camera.world_from_camera.copy()

    @property
    def position(self) -> Doubles:
        """The place (3,) of the camera in metres."""
        return self.world_from_camera[:3, 3]

    @property
    def lens(self) -> Lens:
        """The lens, which all views of the dataset share."""
        return self.dataset.lens

    @property
    def frame(self) -> float | None:
        """The frame of the animation. None in files that SILVR's tools wrote."""
        return self.dataset.lightfield.content.get("frame")

    @property
    def time(self) -> float:
        """The time in a sequence, from 0 for its first frame to 1 for its last. 0 without one."""
        return self.dataset.times[0]

    @property
    def rgb(self) -> Floats:
        """The colour (height, width, 3): linear light from an EXR, or 0 to 1 in sRGB from a PNG."""
        image = self.image([*"RGB"])
        is_light = image.channels["R"].dtype.kind == "f"
        return (image.colour if is_light else image.encoded).astype(np.float32, copy=False)

    @property
    def alpha(self) -> Floats:
        """The part of each pixel (height, width) that the scene covers, from 0 to 1.

        1 in a view without transparency, whose file has no alpha.
        """
        image = self.image()
        if "A" not in image.channels:
            return np.ones((self.lens.height, self.lens.width), np.float32)
        return image.alpha.astype(np.float32)

    @property
    def depth(self) -> Floats:
        """The depth (height, width) in metres, of the kind that `OpenDataset.depth` names.

        inf for a miss, and NaN for a pixel without depth.
        """
        return self.depth_as(self.dataset.depth).astype(np.float32)

    @property
    def distance(self) -> Floats:
        """The depth (height, width) in metres, measured from the camera along the ray."""
        return self.depth_as("distance").astype(np.float32)

    @property
    def z(self) -> Floats:
        """The depth (height, width) in metres, measured along the optical axis."""
        return self.depth_as("z").astype(np.float32)

    @property
    def normal(self) -> Floats:
        """The unit normals (height, width, 3) in the world. 0 for a miss."""
        return self.read("normal")

    def read(self, name: str) -> Array:
        """Return a pass: (height, width, channels), or (height, width) if it has one channel.

        Numbers of objects are whole. All other passes are float32. The reference of passes has
        their units.
        """
        self.dataset.require_pass(name)
        view_pass = _pass_named(name)
        image = self._read(self._file_of_pass(view_pass), view_pass.channels)
        pixels: Array = np.stack(
            [image.channels[channel] for channel in view_pass.channels], axis=-1
        )
        if pixels.dtype.kind == "f":
            pixels = pixels.astype(np.float32, copy=False)
        return pixels if len(view_pass.channels) > 1 else pixels.squeeze(axis=-1)

    def pass_path(self, name: str) -> Path:
        """Return the file of a pass. It may be missing."""
        return self.dataset.files.place(self._file_of_pass(_pass_named(name)))

    def _file_of_pass(self, view_pass: Pass) -> str:
        view = (self.camera.flow or "") if view_pass == FLOW else self.name
        return view_pass.path(Path(self.dataset.folder), view).as_posix()

    def rays(self) -> tuple[Doubles, Doubles]:
        """Return the rays of all pixels' centres in the world: origins and unit directions.

        Both are (height, width, 3) in metres. Directions are NaN where the lens has no ray.
        Raises `UserError` for omnidirectional stereo, whose rays have no common origin.
        """
        self.dataset.lightfield.require_centre()
        directions = _unit_rays(self.lens) @ self.world_from_camera[:3, :3].T
        origins = np.empty_like(directions)
        origins[:] = self.position
        return origins, directions

    def project(self, points: ArrayLike) -> tuple[Doubles, Bools]:
        """Return the pixels (n, 2) of points (n, 3) in the world, and which of them are visible.

        Pixels are right and down from the image's top left corner: (0.5, 0.5) is the first pixel's
        centre. They are NaN where the lens does not see a point. A visible point is within the lens
        and the frame. Another surface may hide it. Raises `UserError` as `rays` does.
        """
        self.dataset.lightfield.require_centre()
        pixels = self.lens.pixels(self.camera.to_camera(np.asarray(points, np.float64)))
        return pixels, self.lens.in_frame(pixels)

    def depth_as(self, meaning: str | None) -> Doubles:
        """Return the depth (height, width) in metres, as "z" or "distance", with all its digits.

        inf for a miss, NaN for a pixel without depth. Raises `UserError` for another ``meaning``.
        """
        lightfield = self.dataset.lightfield
        if meaning is None:
            raise UserError(f"{lightfield.path}: depth: is null; these views have no depth")
        if meaning not in ("z", "distance"):
            raise UserError(f"depth: is {meaning!r}; must be z or distance")
        with self.dataset.files.on_disk(self._picture) as file:
            return depth_of(file, lightfield, _unit_rays(self.lens), meaning)

    def surface(self) -> SeenSurface:
        """Return the surface that the view sees, from its depth."""
        return SeenSurface(self.lens, self.camera, _unit_rays(self.lens), self.depth_as("distance"))

    @property
    def has_ray(self) -> Bools:
        """Which pixels (height, width) have a ray."""
        has_ray: Bools = np.isfinite(_unit_rays(self.lens)[..., 0])
        return has_ray

    @property
    def path(self) -> Path:
        """The file of the view. In a tar, it is the tar's path and the file's name in it."""
        return self.dataset.files.place(self._picture)

    @property
    def _picture(self) -> str:
        """The name of the view's file."""
        names = self.dataset.pictures_of(self.name)
        return next(filter(self.dataset.files.has, names), names[0])

    def image(self, channels: Sequence[str] | None = None) -> images.Image:
        """Return the view's picture with all channels, or with the ``channels`` named.

        Raises `UserError` if its size is not the lens's.
        """
        return self._read(self._picture, channels)

    def _read(self, name: str, channels: Sequence[str] | None) -> images.Image:
        with self.dataset.files.on_disk(name) as file:
            image = images.read_image(file, channels)
            check_size(file, self.dataset.lightfield, next(iter(image.channels.values())))
        return image


class OpenViews(Sequence[OpenView]):
    """Views in the order of lightfield.json, as a Python sequence.

    ``views[3]``, ``views[-1]`` and ``views["view_0003f"]`` are an `OpenView`, and ``views[2:5]`` is
    an `OpenViews`. Raises `UserError` for an unknown name, and IndexError for an unknown number.
    """

    def __init__(self, views: Iterable[OpenView]) -> None:
        self._views = list(views)

    def __repr__(self) -> str:
        return repr(self._views)

    def __len__(self) -> int:
        return len(self._views)

    @overload
    def __getitem__(self, key: int | str) -> OpenView: ...
    @overload
    def __getitem__(self, key: slice) -> "OpenViews": ...
    def __getitem__(self, key: int | str | slice) -> "OpenView | OpenViews":
        if isinstance(key, slice):
            return OpenViews(self._views[key])
        return self._named(key) if isinstance(key, str) else self._numbered(key)

    def _numbered(self, number: int) -> OpenView:
        try:
            return self._views[number]
        except IndexError:
            # Python's own exception, by which loops over a sequence end.
            count = len(self)
            among = f"; they are 0 to {count - 1}" if count else ""
            raise IndexError(f"{number}: is none of the {count} views{among}") from None

    @cached_property
    def _by_name(self) -> dict[str, list[OpenView]]:
        views: dict[str, list[OpenView]] = {}
        for view in self._views:
            views.setdefault(view.name, []).append(view)
        return views

    def _named(self, name: str) -> OpenView:
        views = self._by_name.get(name, [])
        if len(views) == 1:
            return views[0]
        if views:
            raise UserError(f"{name}: is a view of {len(views)} frames; choose one of .frames")
        names = [*self._by_name]
        among = f"; they are {names[0]} to {names[-1]}" if names else ""
        raise UserError(f"{name}: is none of the {len(self)} views{among}")


class Reprojections(dict[str, "OpenDataset"]):
    """The reprojections of a dataset by their names, as a dict of `OpenDataset`.

    Raises `UserError` for an unknown name.
    """

    def __init__(self, place: Path, datasets: Mapping[str, "OpenDataset"]) -> None:
        super().__init__(datasets)
        self._place = place

    def __missing__(self, name: str) -> "OpenDataset":
        among = ", ".join(self) or "none"
        raise UserError(f"{self._place}: reprojections: has no {name!r}; it has {among}")


@dataclass(frozen=True, eq=False)
class OpenDataset:
    """The views of one rig, or of one of its ``reprojection``s: each has a lens and poses.

    - ``files``: the files of the dataset, in a folder, a package or shards.
    - ``folders``: the folder of each frame of a sequence. Without a sequence, the dataset's own.
    - ``reprojection``: the name of the reprojection. Empty for the rig's own views.
    - ``times``: the time of each frame: 0 for the first, 1 for the last.
    - ``member``: in a corpus, what corpus.json says of the scene, such as ``name`` and ``split``.
    - ``suffix``: of the views' files, such as .png. Without it, each view has its best file.
    """

    files: Files
    folders: tuple[str, ...] = ("",)
    times: tuple[float, ...] = (0.0,)
    reprojection: str = ""
    member: Mapping[str, Any] = field(default_factory=dict)
    suffix: str | None = None

    @classmethod
    def in_folder(
        cls, folder: Path, reprojection: str = "", suffix: str | None = None
    ) -> "OpenDataset":
        """Return the dataset of a folder's lightfield.json, or one of its reprojections."""
        return cls(Folder(folder), reprojection=reprojection, suffix=suffix)

    @cached_property
    def lightfield(self) -> LightField:
        """The lightfield.json. ``content`` has its keys. In a sequence, it is the first frame's."""
        name = str(PurePosixPath(self.folder, NAME))
        with self.files.on_disk(name) as file:
            return replace(LightField.read(file), path=self.files.place(name))

    @property
    def lens(self) -> Lens:
        """The lens of all views."""
        return self.lightfield.lens

    @property
    def depth(self) -> str | None:
        """The depth that the views store: "z", "distance", or None."""
        return self.lightfield.depth

    @property
    def passes(self) -> list[str]:
        """The names of the passes that the views have beside colour and depth."""
        names = [each.name for each in self.lightfield.passes]
        has_flow = any(view.flow for view in self.lightfield.views)
        return [*names, FLOW.name] if has_flow else names

    def require_pass(self, name: str) -> None:
        """Raise `UserError` if the views do not have this pass."""
        if name not in self.passes:
            raise UserError(
                f"{self.lightfield.path}: passes: has no {name!r}; it has "
                f"{', '.join(self.passes) or 'none'}"
            )

    def names(self, name: str) -> dict[str, int]:
        """Return the numbers in a pass of ids by the names that they stand for."""
        self.require_pass(name)
        with self.files.on_disk(str(PurePosixPath(self.folders[0], name, NAMES))) as file:
            names: dict[str, int] = read_json(file)
        return names

    @cached_property
    def frames(self) -> "list[OpenDataset]":
        """The dataset of each frame of a sequence. Without a sequence, only this one."""
        if len(self.folders) == 1:
            return [self]
        return [
            replace(self, folders=(folder,), times=(time,))
            for folder, time in zip(self.folders, self.times, strict=True)
        ]

    @cached_property
    def views(self) -> OpenViews:
        """All views. In a sequence, frame follows frame."""
        return OpenViews(
            OpenView(frame, camera) for frame in self.frames for camera in frame.lightfield.views
        )

    def split(self, part: str) -> OpenViews:
        """Return the views of a part: train, validation or test. Without a split, all train."""
        if part not in PARTS:
            raise UserError(f"split: is {part!r}; must be {', '.join(PARTS)}")
        return OpenViews(view for view in self.views if (view.split or "train") == part)

    @cached_property
    def reprojections(self) -> Reprojections:
        """The same views through other lenses, by the reprojections' names."""
        names = [] if self.reprojection else self.files.datasets_in(self.folders[0])
        place = self.files.place(str(self.folder))
        return Reprojections(place, {name: replace(self, reprojection=name) for name in names})

    @property
    def folder(self) -> PurePosixPath:
        """The folder of the lightfield.json."""
        return PurePosixPath(self.folders[0], self.reprojection)

    def pictures_of(self, view: str) -> list[str]:
        """Return the names that a view's file may have, the best first."""
        images = ImageSet(self.reprojection, self.lightfield)
        folder = PurePosixPath(self.folders[0], images.folder)
        suffixes = (self.suffix,) if self.suffix else images.suffixes
        return [f"{folder / view}{suffix}" for suffix in suffixes]


def _pass_named(name: str) -> Pass:
    try:
        return FLOW if name == FLOW.name else passes.by_name(name)
    except KeyError:
        names = ", ".join([*passes.PASSES, FLOW.name])
        raise UserError(f"passes: has no {name!r}; there are {names}") from None


# Every view of a dataset has the same lens, and its rays take as much memory as six pictures.
@lru_cache(maxsize=2)
def _unit_rays(lens: Lens) -> Doubles:
    return lens.pixel_rays()
