"""A sequence of NCore v4 of all frames of an animation: a camera for each view, with all frames."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lightfield.core.files import reading
from oracles.readers import ncore
from oracles.readers.contents import Exported


def read(
    listing: Path, size: tuple[int, int], options: dict[str, Any], frames: Mapping[str, int]
) -> list[Exported]:
    """Read the cameras and the points of each frame, whose times follow from their numbers."""
    exported = [Exported() for _ in frames]
    sequence = ncore.read_sequence(listing, exported[0])
    first = min(frames.values())
    times = [round(1e6 * (number - first) / options["rate"]) for number in frames.values()]
    for name in sequence.cameras:
        camera = Exported()
        ncore.read_camera(sequence, name, size, camera)
        exported[0].cameras += camera.cameras
        exported[0].faults += camera.faults
        place = sequence.store.file(f"cameras/{name}/frames/.zattrs")
        with reading(place, "times of NCore's frames"):
            spans = sequence.store.attributes(f"cameras/{name}/frames")["frames_timestamps_us"]
            since_first = [start - spans[0][0] for start, _ in spans]
            exported[0].expect(f"{place}: times", since_first, times)
        for content, view in zip(exported, camera.views, strict=True):
            content.views.append(view)
            content.expect(f"{view.file}: {view.place}: camera of {view.name}", name, view.name)
    place = sequence.store.file(f"{ncore.POINTS}/.zattrs")
    with reading(place, "times of NCore's points"):
        spans = sequence.store.attributes(ncore.POINTS)["frames_timestamps_us"]
        exported[0].expect(f"{place}: times", spans, [[time, time] for time in times])
    for content, time in zip(exported, times, strict=True):
        ncore.read_points(sequence.store, time, content)
    return exported
