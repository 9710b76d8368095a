"""ScanNet++'s fisheye layout, read as 3DGRUT does: a COLMAP model as text, and two lists."""

from pathlib import Path
from typing import Any

from lightfield.core.files import read_json, reading
from oracles.readers.colmap import exported_model, read_model
from oracles.readers.contents import Exported, Part, development

IMAGES = "image_undistorted_fisheye"


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read the model of an export, and its train_test_lists.json."""
    folder = listing.parent
    exported = exported_model(read_model(folder / "colmap", ".txt"), folder / IMAGES)
    for view in exported.views:
        name = view.name or ""
        colour = folder / IMAGES / f"{name}.png"
        exported.add_picture(colour, name, "colour", development=development(options))
        exported.add_mask(folder / IMAGES / f"{name}_mask.png", name)
    path = folder / "train_test_lists.json"
    with reading(path, "list of ScanNet++'s"):
        content = read_json(path)
        for part in ("train", "test"):
            names = [Path(str(name)).stem for name in content[part]]
            exported.parts.append(Part(f"{path}: {part}", part, names))
        masks = any((folder / IMAGES).glob("*_mask.png"))
        exported.expect(f"{path}: has_masks", content["has_masks"], masks)
    return exported
