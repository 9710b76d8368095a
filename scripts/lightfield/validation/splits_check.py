"""Checks splits.json: it matches the rigs, and no test view has the pose of a training view."""

from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from lightfield.core.errors import UserError
from lightfield.core.files import absolute_path, read_json
from lightfield.core.names import PARTS
from lightfield.core.paths import inside, place_in
from lightfield.formats.layout import ImageSet, rendered, source_view
from lightfield.formats.lightfield import NAME, LightField
from lightfield.formats.splits_file import splits_content
from lightfield.validation.result import Check

# Two poses are the same if they agree to this many decimals, in metres and in the rotation matrix.
_SAME_POSE = 6


def check(path: Path, dataset: Path, sets: Sequence[ImageSet]) -> Check:
    """Check a scene's splits.json, and that the image sets of one ``dataset`` agree with it.

    ``path`` is splits.json, which lies beside the folders of the scene's rigs. No view for
    validation or testing may have the pose of a training view: both would be the same picture.
    Raises `UserError` if splits.json cannot be read, or belongs to another scene.
    """
    home = absolute_path(path).parent
    place = place_in(home, dataset)
    if place is None:
        raise UserError(f"{path}: belongs to the rigs in {home}, but {dataset} is not in it")
    content = read_json(path)
    try:
        parts = {part: [str(name) for name in content[part]] for part in PARTS}
    except (LookupError, TypeError):
        raise UserError(f"{path}: must map {', '.join(PARTS)} to names of views") from None
    # Views of one rig may be in several lists.
    folders = sorted({name.rpartition("/")[0] for name in chain(*parts.values())})
    try:
        lightfields = {
            folder: LightField.read(inside(home, folder, str(path)) / NAME) for folder in folders
        }
    except UserError as error:
        return Check("splits", False, "cannot be checked", problems=[str(error)])
    expected = splits_content(lightfields)
    problems = [
        f"{path.name}: {part}: is not what the rigs' {NAME} say"
        for part in PARTS
        if sorted(parts[part]) != sorted(expected[part])
    ]
    lightfield = lightfields.get(place.as_posix())
    split = {view.name: view.split for view in lightfield.views} if lightfield else {}
    source = rendered(sets)
    for image_set in sets:
        for view in image_set.lightfield.views:
            number = source_view(source, view.name)
            if source is None or number is None:
                continue  # The check of lightfield.json reports it.
            if view.split != split.get(source.views[number]):
                problems.append(f"{image_set.prefix}{NAME}: frames: {view.name}: split is another")
    problems += _shared_poses(lightfields)
    detail = ", ".join(f"{len(parts[part])} {part}" for part in PARTS)
    return Check("splits", not problems, detail, problems=problems)


def _shared_poses(lightfields: Mapping[str, LightField]) -> list[str]:
    """Return a line for each view to validate or test that has the pose of a training view."""
    problems = []
    training_views: dict[bytes, str] = {}
    for part in PARTS:
        for folder, lightfield in lightfields.items():
            for view in lightfield.views:
                if view.split != part:
                    continue
                name = f"{folder}/{view.name}"
                # Adding 0.0 turns -0.0 into 0.0, so that equal poses have equal bytes.
                pose = (np.round(view.world_from_camera, _SAME_POSE) + 0.0).tobytes()
                if part == "train":
                    training_views[pose] = name
                elif pose in training_views:
                    problems.append(
                        f"{name}: is for {part}, but has the pose of {training_views[pose]}, "
                        "which trains"
                    )
    return problems
