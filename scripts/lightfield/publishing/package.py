"""Packs a dataset into reproducible archives, with a card that explains it.

Each part is a tar by itself. All parts unpack into one folder, <scene>_<rig> as in SILVR. Names,
order, times, owners and modes depend on the files alone.
"""

import json
import tarfile
from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from lightfield.configuration.publication import Credits
from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import (
    atomic_path,
    open_file,
    read_json,
    read_keys,
    read_text,
    sha256,
    write_json,
)
from lightfield.core.names import MESH, READER, VIDEO
from lightfield.core.paths import files_below, place_in
from lightfield.core.progress import Progress
from lightfield.exporters import EXPORTERS, SEQUENCE_EXPORTS, lists_beside_views
from lightfield.formats.export_lists import MANIFEST
from lightfield.formats.layout import CARD, IMAGES, README, REPORT, WALK, further_parts
from lightfield.formats.lightfield import NAME, LightField
from lightfield.formats.passes import PASSES, group_pass
from lightfield.imaging import images
from lightfield.imaging.blender_looks import title
from lightfield.publishing.markdown import markdown
from lightfield.report import snippet, walk_page
from lightfield.stages.publishing import Package

SILVR = (
    "Courteaux, Artois, De Pauw, Lambert and Van Wallendael, SILVR: A Synthetic Immersive "
    "Large-Volume Plenoptic Dataset, MMSys 2022, doi:10.1145/3524273.3532890"
)

# The file that reads any dataset without Plenoforge. Every package has it.
READER_SOURCE = Path(__file__).with_name(READER)

# How to load each export, the mesh and the video. {} stands for the folder that holds it.
LOADERS = {name: exporter.loader for name, exporter in EXPORTERS.items()} | {
    MESH: "import trimesh\nscene = trimesh.load('{}/scene.glb')",
    VIDEO: "from glob import glob\n(video,) = glob('{}/*.[mw]*')  # a browser plays it",
}

# At most: two empty blocks, and zeros up to a whole record.
TAR_END = 2 * tarfile.BLOCKSIZE + tarfile.RECORDSIZE


def write(job: Package) -> None:
    """Pack the folder of a rig, and write a JSON with its card and its parts beside the archive."""
    if job.output.suffix != ".tar":
        raise UserError(f"--output {job.output}: must end in .tar; .json lies beside it")
    if place_in(job.folder, job.output):
        raise UserError(f"--output {job.output}: must not be in the folder that it packs")
    content = card(job.folder, job.output.stem, job.settings.scene, job.settings.rig)
    written = pack(job.folder, content, job.output, job.settings.most_bytes)
    parts = listed(written)
    card_path = job.output.with_suffix(".json")
    write_json(card_path, {**content, "parts": parts})
    size = sum(part["bytes"] for part in parts)
    print(f"{job.output}: {units.count(len(parts), 'part')}, {units.size(size)}")


def card(folder: Path, name: str, scene: Credits, rig: str | None = None) -> dict[str, Any]:
    """Return the content of card.json for a rig's folder.

    The folder of a sequence has a folder for each frame. The first one counts. Without the type of
    the ``rig``, the card has the type in lightfield.json, which knows fewer.
    """
    frames = _frames(folder)
    first = frames[0] if frames else folder
    lightfield = LightField.read(first / NAME)
    view = lightfield.views[0].name
    bpy = images.attribute(first / IMAGES / f"{view}.exr", images.BPY_ATTRIBUTE)
    return {
        "name": name,
        "scene": {
            "name": lightfield.scene["name"],
            "description": scene.description,
            "licence": scene.licence,
            "credit": scene.credit,
        },
        "rig": rig or lightfield.content["lf_type"],
        **({"frames": [frame.name for frame in frames]} if frames else {}),
        "views": len(lightfield.views),
        "lens": lightfield.lens.description,
        "resolution": [lightfield.lens.width, lightfield.lens.height],
        "transparent": lightfield.transparent,
        "depth": lightfield.depth,
        "passes": [
            name
            for name in (*PASSES, *map(group_pass, lightfield.light_groups))
            if (first / name).is_dir()
        ],
        "reprojections": sorted(path.parent.name for path in first.glob(f"*/{NAME}")),
        **({"looks": looks} if (looks := _looks(folder, first)) else {}),
        "software": f"Cycles in bpy {bpy}" if bpy else None,
        "cite": [SILVR, *([scene.credit] if scene.credit else [])],
        "python": snippet.reading(name, lightfield),
        "loaders": dict(_loaders(folder, first, view)),
    }


def _looks(folder: Path, first: Path) -> dict[str, str]:
    """Return Blender's look of each folder of pictures that has one. Other pictures are sRGB.

    ``first`` is the folder of a sequence's first frame. Without a sequence, it is ``folder``.
    """
    looks = {path.parent: LightField.read(path).look for path in first.glob(f"*/{NAME}")}
    for path in {*files_below(first), *_lists_of_sequence(folder)}:
        if path.name == MANIFEST:
            looks[path.parent] = read_json(path).get("look")
    return {
        place.relative_to(folder).as_posix(): title(look)
        for place, look in sorted(looks.items())
        if look
    }


def _frames(folder: Path) -> list[Path]:
    """Return the folders of a sequence's frames. Empty for one dataset.

    Raises `UserError` if there is no dataset.
    """
    if (folder / NAME).is_file():
        return []
    frames = sorted(path.parent for path in folder.glob(f"*/{NAME}"))
    if not frames:
        raise UserError(f"{folder}: has no {NAME}")
    return frames


def _loaders(folder: Path, first: Path, view: str) -> Iterator[tuple[str, str]]:
    """Yield the places in ``folder`` of each export, and how to load it.

    ``first`` is the folder of a sequence's first frame. Without a sequence, it is ``folder``.
    """

    def loader(name: str, place: Path) -> str:
        text = LOADERS[name].replace("{view}", view).replace("{frame}", first.name)
        return text.replace("{}", place.relative_to(folder).as_posix())

    for name, path in lists_beside_views(first):
        yield path.relative_to(folder).as_posix(), loader(name, path.parent)
    lists = [path for path in files_below(first) if path.name == MANIFEST]
    for path in [*lists, *(_lists_of_sequence(folder) if first != folder else ())]:
        yield path.parent.relative_to(folder).as_posix(), loader(_format(path), path.parent)


def _lists_of_sequence(folder: Path) -> Iterator[Path]:
    """Yield the list of each export of a whole sequence."""
    lists = [*folder.glob(f"exports/*/{MANIFEST}"), *folder.glob(f"*/exports/*/{MANIFEST}")]
    yield from (path for path in sorted(lists) if _format(path) in SEQUENCE_EXPORTS)


def _format(path: Path) -> str:
    """Return the format of an export from its list. Raises `UserError` if nothing loads it."""
    name = read_keys(path, "export.py", "format")["format"]
    if name not in LOADERS:
        raise UserError(f"{path}: format: is {name!r}; must be one of {', '.join(LOADERS)}")
    return str(name)


def pack(folder: Path, content: dict[str, Any], target: Path, most: float | None) -> list[Path]:
    """Write a folder as ``target``, and as further parts if that would exceed ``most`` bytes.

    Further parts are named <target's stem>.2.tar and so on. Removes the parts of an earlier
    package.
    """
    walk = _walk(folder)
    readme = markdown(
        "card.md.j2", **{"frames": None, "looks": None, **content}, walk=walk is not None
    )
    texts = {
        CARD: json.dumps(content, indent=1) + "\n",
        README: readme,
        READER: read_text(READER_SOURCE),
        **({WALK: walk} if walk else {}),
    }
    paths = [
        path for path in files_below(folder) if REPORT not in path.relative_to(folder).parts[:2]
    ]
    for old in further_parts(target):
        old.unlink()
    written = []
    card_size = sum(tar_size(len(text.encode())) for text in texts.values())
    for number, part in enumerate(_parts(paths, most, card_size), 1):
        name = target if number == 1 else target.with_name(f"{target.stem}.{number}.tar")
        progress = Progress(len(part), name.name, "files")
        with atomic_path(name) as temporary, tarfile.open(temporary, "w") as archive:
            for file, text in texts.items() if number == 1 else ():
                add_entry(archive, f"{content['name']}/{file}", text.encode())
            for path in part:
                inside = f"{content['name']}/{path.relative_to(folder).as_posix()}"
                add_entry(archive, inside, path)
                progress.done()
        written.append(name)
    return written


def _walk(folder: Path) -> str | None:
    """Return the walk of a rig's dataset, or of a sequence's first one. None without any."""
    frames = _frames(folder)
    page = (frames[0] if frames else folder) / REPORT / "index.html"
    return walk_page.of_page(page) if page.is_file() else None


def listed(paths: Sequence[Path]) -> list[dict[str, Any]]:
    """Return name, size and SHA-256 of each part."""
    return [{"file": p.name, "bytes": p.stat().st_size, "sha256": sha256(p)} for p in paths]


def _parts(paths: Sequence[Path], most: float | None, first: int) -> Iterator[list[Path]]:
    """Yield runs of files whose tar has at most ``most`` bytes. A larger file gets its own tar.

    The first tar holds ``first`` bytes beside its files.
    """
    part: list[Path] = []
    size = TAR_END + first
    for path in paths:
        needed = tar_size(path.stat().st_size)
        if part and most is not None and size + needed > most:
            yield part
            part = []
            size = TAR_END
        part.append(path)
        size += needed
    yield part


def tar_size(content: int) -> int:
    """Return the most bytes that a file takes in a tar: its header, and its content in blocks."""
    return content + 2 * tarfile.BLOCKSIZE


def add_entry(archive: tarfile.TarFile, name: str, content: Path | bytes) -> None:
    """Add a file without any trace of this machine, user or time."""
    entry = tarfile.TarInfo(name)
    if isinstance(content, bytes):
        entry.size = len(content)
        archive.addfile(entry, BytesIO(content))
        return
    entry.size = content.stat().st_size
    with open_file(content) as file:
        archive.addfile(entry, file)
