"""Validates what is published, each description with its own validator, and iterates the shards."""

import os
from importlib.metadata import version

import numpy as np


def check(folder):
    croissant(folder / "croissant.json")
    hugging_face(folder / "README.md")
    datasets(folder)
    webdataset(folder)


def croissant(path):
    """Validate Croissant as `mlcroissant validate` does, and read all records."""
    # It unpacks tars to a folder of the user, where it finds those of an earlier run.
    os.environ["CROISSANT_CACHE"] = str(path.parents[1] / "croissant_cache")
    import mlcroissant

    dataset = mlcroissant.Dataset(jsonld=str(path))
    issues = dataset.metadata.ctx.issues
    counts = {
        record_set.id: len([*dataset.records(record_set.id)])
        for record_set in dataset.metadata.record_sets
    }
    print(
        f"mlcroissant {version('mlcroissant')}: Croissant {dataset.metadata.ctx.conforms_to.value}:"
        f" {len(issues.errors)} errors, {len(issues.warnings)} warnings; records: {counts}"
    )
    assert not issues.errors
    assert not issues.warnings
    assert {*counts.values()} == {6}


def hugging_face(path):
    from huggingface_hub import DatasetCard

    card = DatasetCard.load(path).data.to_dict()
    (config,) = card["configs"]
    splits = {
        part["split"]: len([*path.parent.glob(part["path"])]) for part in config["data_files"]
    }
    print(
        f"huggingface_hub {version('huggingface_hub')}: license {card['license']}, "
        f"{card['size_categories'][0]}, shards {splits}"
    )
    assert all(splits.values())
    assert card["license"] == "cc-by-4.0"


def datasets(folder):
    """Load the shards as the card does, and as the Hub's viewer does: by the front matter."""
    from datasets import load_dataset

    code = (folder / "README.md").read_text().partition("from datasets import load_dataset\n")[2]
    names = {"load_dataset": lambda kind, **more: load_dataset(kind, data_dir=folder, **more)}
    exec(code.partition("```")[0], names)
    by_card = {split: [*rows] for split, rows in names["data"].items()}
    by_front_matter = load_dataset(str(folder), streaming=True)
    assert by_front_matter.keys() == by_card.keys()
    for split, rows in by_card.items():
        for row, same in zip(rows, by_front_matter[split], strict=True):
            assert row["thumbnail.jpg"].size == same["thumbnail.jpg"].size
            assert np.asarray(row["thumbnail.jpg"]).std() > 0
            assert row["views.exr"][:4] == b"v/1\x01"
    print(
        f"datasets {version('datasets')}: {sum(map(len, by_card.values()))} rows with "
        f"{', '.join(sorted(names['sample']))}; a thumbnail is {row['thumbnail.jpg'].size}"
    )


def webdataset(folder):
    import webdataset

    tars = sorted(map(str, folder.glob("sphere-*.tar")))
    dataset = webdataset.WebDataset(tars, shardshuffle=False, empty_check=False).decode("rgb8")
    samples = [*dataset]
    for sample in samples:
        assert {"views.exr", "perspective.png", "json"} <= sample.keys()
        assert np.shape(sample["perspective.png"]) == (48, 64, 3)
        pose = np.array(sample["json"]["pictures"]["views.exr"]["world_matrix"])
        assert pose.shape == (4, 4)
    print(
        f"webdataset {version('webdataset')}: {len(samples)} samples of {len(tars)} shards, each "
        f"with {', '.join(sorted(name for name in samples[0] if name[0] != '_'))}"
    )
    assert len(samples) == 6
