"""Writes the files for publishing a dataset: WebDataset shards, and descriptions for repositories.

Equal datasets and settings give equal bytes, because the date is the author's.
"""

import sys
from pathlib import Path

from lightfield.configuration.publication import CARD, CROISSANT
from lightfield.configuration.scene_yaml import Credits
from lightfield.configuration.shown_look import ShownLook
from lightfield.core import units
from lightfield.core.errors import UserError
from lightfield.core.files import write_json, write_text
from lightfield.core.names import READER
from lightfield.core.paths import files_below, place_in
from lightfield.formats.layout import SUMS
from lightfield.formats.lightfield import NAME, LightField
from lightfield.publishing import croissant, hugging_face, package, shards
from lightfield.publishing.published import Published
from lightfield.stages.publishing import Publish


def write(job: Publish) -> None:
    """Publish the folder of a rig."""
    if place_in(job.folder, job.output):
        raise UserError(f"--output {job.output}: must not be in the folder that it publishes")
    settings = job.settings
    name = job.output.resolve().name
    published = publish(
        job.folder,
        name,
        settings.scene,
        job.output,
        settings.most_bytes,
        settings.rig,
        look=settings.look,
    )
    size = sum(file["bytes"] for file in published.files)
    print(f"{job.output}: {units.count(len(published.files), 'file')}, {units.size(size)}")


def publish(
    folder: Path,
    name: str,
    scene: Credits,
    output: Path,
    most: float | None,
    rig: str | None = None,
    *,
    look: ShownLook | None = None,
) -> Published:
    """Write the shards and the descriptions of the dataset in ``folder`` to ``output``.

    A shard has at most ``most`` bytes, or `shards.SHARD_BYTES`. ``rig`` is the type of the rig.
    Thumbnails have the ``look``.
    Warns of texts that the scene YAML lacks, which the descriptions then lack, too. Raises
    `UserError` if the dataset is not finished, or if the scene YAML has no key ``publish``.
    """
    if scene.publish is None:
        raise UserError(
            "publish: is missing in the scene YAML: see docs/how-to/publish-a-dataset.md"
        )
    if missing_texts := scene.missing_texts:
        print(
            f"warning: published without {', '.join(missing_texts)}, which repositories ask for; "
            "write them into the scene YAML",
            file=sys.stderr,
        )
    card = package.card(folder, name, scene, rig)
    folders = sorted({path.parent for path in files_below(folder) if path.name == SUMS})
    if not folders:
        raise UserError(f"{folder / SUMS}: is missing; only a valid dataset can be published")
    datasets = [shards.read_dataset(folder, dataset) for dataset in folders]
    output.mkdir(parents=True, exist_ok=True)
    lightfield = LightField.read(next(each for each in folders if (each / NAME).is_file()) / NAME)
    shown = look.resolved(lightfield) if look else None
    written = shards.write_shards(output, name, datasets, most or shards.SHARD_BYTES, shown)
    rest = shards.write_others(output, name, datasets)
    names = {field for dataset in datasets for sample in dataset.samples for field in sample.files}
    published = Published(
        name,
        scene,
        card,
        lightfield,
        {split: package.listed(paths) for split, paths in written.items()},
        package.listed([output / shards.INDEX, rest]),
        ("json", *sorted({*names, shards.THUMBNAIL})),
        sum(len(dataset.samples) for dataset in datasets),
    )
    write_text(output / CARD, hugging_face.describe(published))
    write_json(output / CROISSANT, croissant.describe(published))
    write_text(output / READER, package.source_of_reader(folder, shards=True))
    documents = [output / name for name in (CARD, CROISSANT, READER)]
    entries = [*published.files, *package.listed(documents)]
    sums = sorted(f"{entry['sha256']}  {entry['file']}\n" for entry in entries)
    write_text(output / SUMS, "".join(sums))
    return published
