"""Makes a rig of each camera of a head. Nothing else in the program knows heads."""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from lightfield.geometry.rigs import Rig
from lightfield.geometry.rigs.mount import Mount


def camera_rig(rig: str, camera: str) -> str:
    """Return the name of the rig of a head's camera."""
    return f"{rig}_{camera}"


def with_cameras(rigs: dict[str, Rig]) -> dict[str, Rig]:
    """Replace each rig with a head by one rig for each camera of the head.

    Raises ValueError, which begins with the key, if two rigs would have one name.
    """
    expanded: dict[str, Rig] = {}
    for name, rig in rigs.items():
        if rig.mount:
            raise ValueError(f"{name}.mount: is not for scene YAMLs; give the rig a head")
        if rig.head is None:
            expanded[name] = rig
            continue
        for camera, settings in rig.head.items():
            key = camera_rig(name, camera)
            if key in expanded or key in rigs:
                raise ValueError(
                    f"{name}.head.{camera}: becomes the rig {key}, which is there, too; choose "
                    "another name"
                )
            mount = Mount(
                head=name, name=camera, position=settings.position, rotation=settings.rotation
            )
            update = {"head": None, "camera": settings.camera, "mount": mount}
            expanded[key] = rig.model_copy(update=update)
    return expanded


def keys_as_written(problem: str, content: Any) -> str:
    """Return a problem with the keys that a scene YAML's ``content`` has for its heads' rigs.

    rigs.car_front.camera becomes rigs.car.head.front.camera. rigs.car_front.split becomes
    rigs.car.split.
    """
    for rig, camera in _cameras(content):
        key = re.escape(f"rigs.{camera_rig(rig, camera)}")
        problem = re.sub(rf"{key}(?=\.camera\b)", f"rigs.{rig}.head.{camera}", problem)
        problem = re.sub(rf"{key}(?![\w-])", f"rigs.{rig}", problem)
    return problem


def _cameras(content: Any) -> Iterator[tuple[str, str]]:
    """Yield the rig and the name of each head's camera in a scene YAML's content."""
    rigs = content.get("rigs") if isinstance(content, Mapping) else None
    for name, rig in rigs.items() if isinstance(rigs, Mapping) else ():
        head = rig.get("head") if isinstance(rig, Mapping) else None
        for camera in head if isinstance(head, Mapping) else ():
            yield name, str(camera)
