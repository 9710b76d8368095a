"""The SHA-256 that a .blend must have. The scene YAML or a lock file records it."""

from pathlib import Path

from lightfield.configuration.scene_source import SceneSource
from lightfield.core.errors import UserError
from lightfield.core.files import read_json, write_json


def blend_sha256(scene: str, source: SceneSource) -> tuple[str | None, Path]:
    """Return the SHA-256 that a scene's .blend must have, or None if none is recorded yet.

    The second value is the file that records it: the scene YAML or its lock file.
    """
    # Import it only here, because it imports the models of all keys. Built scenes need none.
    from lightfield.configuration.scene_yaml import scene_path

    if source.sha256:
        return source.sha256, scene_path(scene)
    lock = scene_path(scene).with_suffix(".lock.json")
    try:
        return (str(read_json(lock)["sha256"]) if lock.exists() else None), lock
    except (LookupError, TypeError):
        raise UserError(f"{lock}: sha256: is missing; remove the file to record it again") from None


def expected_blend(scene: str, source: SceneSource, blend: Path, digest: str) -> Path | None:
    """Check that a .blend has the recorded SHA-256. Raises `UserError` if not.

    ``source`` is as in the scene YAML. Returns None. If none is recorded yet, returns the lock file
    that should record it.
    """
    expected, origin = blend_sha256(scene, source)
    if expected in (None, digest):
        return origin if expected is None else None
    remedy = "write its sha256 there" if origin.suffix == ".yaml" else f"delete {origin}"
    raise UserError(
        f"{blend}: its sha256 is {digest}, but {origin} says {expected}; to take the new file, "
        f"{remedy}"
    )


def record_blend(blend: Path, digest: str, lock: Path) -> None:
    """Record the SHA-256 that a .blend must have."""
    write_json(lock, {"blend": blend.name, "sha256": digest})
    print(f"note: {blend}: its sha256 {digest} is now recorded in {lock}")
