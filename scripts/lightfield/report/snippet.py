"""The Python that a page, a card and a README show: how to read the dataset with the library."""

import json

from lightfield.formats.lightfield import OMNIDIRECTIONAL, LightField


def arrays(lightfield: LightField) -> list[str]:
    """Return the arrays that each view of a light field has, as Python expressions."""
    arrays = ["view.rgb"]
    if lightfield.transparent:
        arrays.append("view.alpha")
    if lightfield.depth:
        arrays.append("view.depth")
    if "normal" in [each.name for each in lightfield.passes]:
        arrays.append("view.normal")
    return arrays


def reading(place: str, lightfield: LightField) -> str:
    """Return Python that reads the dataset at a place: a folder, a .tar, or shards."""
    lines = [
        "from lightfield import open_dataset",
        "",
        f"data = open_dataset({json.dumps(place, ensure_ascii=False)})",
        "view = data.views[0]",
        f"{', '.join(arrays(lightfield))}  # arrays, as float32",
    ]
    if OMNIDIRECTIONAL not in lightfield.content:
        lines += [
            "origins, directions = view.rays()  # of every pixel, in the world",
            "pixels, visible = view.project([[0, 0, 0]])  # points (n, 3) in metres to pixels",
        ]
    return "\n".join(lines)
