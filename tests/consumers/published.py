"""Validates what is published, each description with its own validator, and iterates the shards."""

import os
from importlib.metadata import version

import numpy as np


def check(folder):
    croissant(folder / "croissant.json")
    hugging_face(folder / "README.md")
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
