"""Make a dataset's page: one file that shows what it looks like, how good it is, what it cost.

Everything is in the file, pictures too, so that it can be read without a network, kept and sent.
What is not there (measurements that were not asked for, depth, costs) is told, and is no error.
"""

import argparse
import json
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from lightfield.core.cli import run
from lightfield.dataset.lightfield import NAME, LightField
from lightfield.geometry import rigs
from lightfield.geometry.overview import middle_view
from lightfield.report import faults, page
from lightfield.report import tables as report_tables
from lightfield.report import views as report_views
from lightfield.validation.files import IMAGES, REPORT, SUMS

PICTURES = ("overview", "contact_sheet")
PLOTS = ("depth", "noise")
WIDEST = 1600


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dataset", required=True, type=Path, help="folder of the dataset")
    parser.add_argument("--name", required=True, help="how it is called: scene/rig")
    parser.add_argument("--rig", required=True, type=json.loads, help="the scene YAML's rig, JSON")
    parser.add_argument(
        "--panorama",
        nargs="?",
        help="what the overview was made of, where it is not the view in the rig's middle",
    )
    parser.add_argument(
        "--measurements",
        type=Path,
        nargs="*",
        default=[],
        help="files that the measurements wrote: .csv, .json, and plots .svg or .png",
    )
    parser.add_argument("--output", required=True, type=Path, help="HTML file to write")
    arguments = parser.parse_args()

    folder: Path = arguments.dataset
    rig = rigs.from_settings(arguments.rig)
    lightfield = LightField.read(folder / NAME)
    name = str(lightfield.scene["name"])
    validation = report_tables.validation(folder / "validation.json")
    looks = report_views.collect(folder / IMAGES, lightfield, rig, unreadable(validation))
    listed = files(folder, lightfield)
    if validation is None or validation["valid"]:
        listed.append((SUMS, f"checksums of all of these: sha256sum -c {SUMS}"))
    report = folder / REPORT
    measured = {
        "reprojection": report_tables.reprojection(arguments.measurements),
        "stability": report_tables.stability(arguments.measurements),
        "error_vs_time": report_tables.error_vs_time(arguments.measurements, name),
    }
    page.write(
        arguments.output,
        "page.html.j2",
        name=arguments.name,
        home="../" * (arguments.name.count("/") + 2) + "index.html",
        facts=facts(folder, lightfield, rig),
        pictures={stem: page.photo(report / f"{stem}.png", WIDEST) for stem in PICTURES},
        plots={stem: page.plot(report / stem) for stem in PLOTS},
        looks=looks,
        middle=None if arguments.panorama else lightfield.views[middle_view(rig)].name,
        render=lightfield.render,
        validation=validation,
        faults=fault_pictures(folder, validation),
        measured=measured,
        costs=report_tables.costs(report / "costs.json"),
        files=listed,
        transforms=sorted(
            path.relative_to(folder).as_posix() for path in folder.glob("**/transforms.json")
        ),
        scene=name,
    )


def failed_checks(validation: Mapping[str, Any] | None) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield each failed check with the image set that it is of, "" for the views."""
    for group, checks in (validation or {"groups": {}})["groups"].items():
        yield from ((group, check) for check in checks if check["passed"] is False)


def unreadable(validation: Mapping[str, Any] | None) -> set[str]:
    """Return the views of which validation says that they are missing or no whole images."""
    return {
        view
        for group, check in failed_checks(validation)
        if not group and check["short"] in ("views", "images")
        for view in check["views"]
    }


def fault_pictures(
    folder: Path, validation: Mapping[str, Any] | None
) -> dict[tuple[str, str], list[faults.Fault]]:
    """Return pictures of the views that failed a check, by image set and check."""
    return {
        (group, check["short"]): faults.collect(folder / (group or IMAGES), check["views"])
        for group, check in failed_checks(validation)
    }


def facts(folder: Path, lightfield: LightField, rig: rigs.Rig) -> list[tuple[str, str]]:
    """Return what one wants to know first of a dataset, each with its title."""
    lens, render = lightfield.lens, lightfield.render
    samples = f"{render.get('samples', '–')} a pixel"
    if render.get("adaptive_threshold"):
        samples = f"up to {samples}, adaptive"
    if render.get("denoise"):
        samples += ", denoised"
    depth = {"z": "Z-depth, metres", "distance": "distance, metres"}
    size = sum(path.stat().st_size for path in (folder / IMAGES).glob("*.exr"))
    return [
        ("Views", str(len(lightfield.views))),
        ("Rig", rig_text(rig)),
        ("Lens", lightfield.lens.description),
        ("Resolution", f"{lens.width} × {lens.height}"),
        ("Samples", samples),
        ("Depth", depth.get(lightfield.depth or "", "none")),
        ("Size of the views", page.bytes_(size)),
        ("Rendered by", f"Cycles in bpy {version('bpy')}" if "samples" in render else "others"),
    ]


def rig_text(rig: rigs.Rig) -> str:
    """Return a rig in words: its type, its cameras along each axis, and its size."""
    kind = rig.type
    if isinstance(rig, rigs.Grid):
        kind += " " + " × ".join(map(str, rig.cameras))
    if isinstance(rig.size, tuple):
        return f"{kind}, {' × '.join(f'{side:g}' for side in rig.size)} m"
    return f"{kind}, {'⌀ ' if rig.is_round else ''}{rig.size:g} m"


def files(folder: Path, lightfield: LightField) -> list[tuple[str, str]]:
    """Return the dataset's files and what each is."""
    depth = {
        "z": ", and Z: metres along the optical axis",
        "distance": ", and Z: metres from the camera",
    }.get(lightfield.depth or "", "")
    if depth:
        depth += "; inf where a ray hit nothing"
    first = lightfield.views[0].name
    found = [
        (f"{IMAGES}/{first}.exr …", f"the views: scene-linear Rec. 709 R, G, B as half{depth}"),
        ("lightfield.json", "the lens once; position, rotation, and world_matrix of each view"),
    ]
    for inner in sorted(folder.glob(f"*/{NAME}")):
        lens = LightField.read(inner).lens.description
        found.append((f"{inner.parent.name}/", f"the same views through another lens: {lens}"))
    return [
        *found,
        ("validation.json", "what was checked, and what came out"),
    ]


if __name__ == "__main__":
    run(main)
