"""A dataset for nerfbaselines, read as its datasets/_common.py and datasets/colmap.py do."""

from pathlib import Path
from typing import Any

from lightfield.core.files import read_json, reading
from oracles.readers.colmap import exported_model, read_model
from oracles.readers.contents import Exported, Part, development


def read(listing: Path, size: tuple[int, int], options: dict[str, Any]) -> Exported:
    """Read nb-info.json, the model, and the lists of the images to train and to test with."""
    folder = listing.parent
    info = folder / "nb-info.json"
    with reading(info, "nb-info.json"):
        content = read_json(info)
        is_named = all(isinstance(content[key], str) for key in ("id", "scene"))
    model = read_model(folder / "sparse" / "0", ".bin")
    exported = exported_model(model, folder / "images")
    exported.expect(f"{info}: loader", content["loader"], "colmap")
    exported.expect(f"{info}: id and scene", is_named, True)
    names = {image.name for image in model.images}
    for part in ("train", "test"):
        path = folder / f"{part}_list.txt"
        lines = path.read_text(encoding="utf-8").splitlines()
        exported.expect(f"{path}: images that the model lacks", len({*lines} - names), 0)
        exported.parts.append(Part(str(path), part, [Path(line).stem for line in lines]))
    # With a folder of masks, every image needs one.
    has_masks = (folder / "masks").is_dir()
    for image in model.images:
        view = Path(image.name).stem
        colour = folder / "images" / image.name
        exported.add_picture(colour, view, "colour", development=development(options))
        mask = (folder / "masks" / image.name).with_suffix(".png")
        exported.expect(f"{mask}: is a file", mask.is_file(), has_masks)
        exported.add_mask(mask, view)
    return exported
