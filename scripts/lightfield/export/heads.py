"""The cameras of an export's views: one for each lens, or the cameras of a head."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lightfield.export.source import Floats, SourceDataset
from lightfield.formats.lightfield import HeadCamera, View
from lightfield.geometry.lenses import Lens


@dataclass(frozen=True)
class HeadSensor:
    """A camera that takes some of the views. ``mount`` is its place in the head, if it is in one.

    ``views`` are in the order of the source. In a head, they are named <camera>/<view>.
    """

    lens: Lens
    mount: HeadCamera | None
    views: Sequence[View]

    @property
    def views_by_place(self) -> Mapping[str, View]:
        """The views of a head's camera by their names in its dataset, which tell the place."""
        return {view.name.partition("/")[2]: view for view in self.views}


def by_camera(source: SourceDataset) -> SourceDataset:
    """Return the source with views named <camera>/<view>, if they are of one head's cameras.

    Returns it unchanged if they are not.
    """
    mounts = _mounts(source)
    if not mounts:
        return source
    names = {
        f"{mounts[view.name].name}/{source.view(view).name}": view.name
        for view in source.lightfield.views
    }
    return replace(source, renamed=names)


def sensors(source: SourceDataset) -> list[HeadSensor]:
    """Return the cameras of a source that `by_camera` returned, in the order of their views."""
    mounts = _mounts(source)
    views: dict[Lens | str, list[View]] = {}
    for view in source.lightfield.views:
        lens = source.view(view).lens
        views.setdefault(mounts[view.name].name if mounts else lens, []).append(view)
    return [
        HeadSensor(source.view(first).lens, mounts.get(first.name), [first, *others])
        for first, *others in views.values()
    ]


def places(cameras: Sequence[HeadSensor]) -> list[list[View]]:
    """Return the views of a head's cameras at each place of its body."""
    by_place = [camera.views_by_place for camera in cameras]
    return [[views[name] for views in by_place] for name in by_place[0]]


def from_first(cameras: Sequence[HeadSensor]) -> list[Floats]:
    """Return the matrix (4, 4) from each camera of a head to the first, in metres.

    Empty for cameras that are no head.
    """
    mounts = [camera.mount.body_from_camera for camera in cameras if camera.mount]
    return [np.linalg.inv(mounts[0]) @ mount for mount in mounts]


def _mounts(source: SourceDataset) -> dict[str, HeadCamera]:
    """Return the camera of each view in their head. Empty if they are not several of one head."""
    mounts: dict[str, HeadCamera] = {}
    for view in source.lightfield.views:
        mount = source.view(view).dataset.lightfield.head
        if mount is None:
            return {}
        mounts[view.name] = mount
    heads = {mount.head for mount in mounts.values()}
    cameras = {mount.name for mount in mounts.values()}
    return mounts if len(heads) == 1 and len(cameras) > 1 else {}
