"""Validates what is published, each description with its own validator, and iterates the shards."""

import json
import os
from importlib.metadata import version
from importlib.resources import files

import numpy as np

# The recommended checks of the RO-Crate that may fail, and why.
UNMET = {
    "51.1": "nothing is at the DOI before the dataset is published",
    "90.1": "only an organization itself knows its contact",
}


def check(folder):
    croissant(folder / "croissant.json")
    ro_crate(folder)
    datacite(folder / "datacite.json")
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


def ro_crate(folder):
    """Validate the RO-Crate by the profile 1.2, without a network."""
    import requests
    from rocrate_validator import models, services
    from rocrate_validator.utils.http import HttpRequester

    # The validator would download the context 1.2. ro-crate-py has that of 1.3. It has all terms of
    # 1.2, and those that are used here have the same meaning.
    context = files("rocrate").joinpath("data", "ro-crate.jsonld").read_bytes()

    def get(self, url, **options):
        response = requests.Response()
        response.status_code = 200 if url.startswith("https://w3id.org/ro/crate/") else 404
        response.url = url
        response._content = context
        response.headers["Content-Type"] = "application/ld+json"
        return response

    HttpRequester.get = get
    failed = {}
    for severity in (models.Severity.REQUIRED, models.Severity.RECOMMENDED):
        settings = services.ValidationSettings(
            rocrate_uri=str(folder),
            profile_identifier="ro-crate-1.2",
            requirement_severity=severity,
        )
        issues = services.validate(settings).get_issues()
        failed[severity.name] = {
            issue.check.identifier.rpartition("_")[2]: issue.check.name for issue in issues
        }
    print(
        f"roc-validator {version('roc-validator')}: RO-Crate 1.2: {len(failed['REQUIRED'])} "
        f"required and {len(failed['RECOMMENDED'])} recommended checks fail"
    )
    for number, name in failed["RECOMMENDED"].items():
        print(f"    {number} {name}: {UNMET.get(number, 'a mistake')}")
    assert not failed["REQUIRED"], failed
    assert failed["RECOMMENDED"].keys() <= UNMET.keys()


def datacite(path):
    from datacite import schema45

    content = json.loads(path.read_text())
    schema45.validate(content)
    print(f"datacite {version('datacite')}: schema 4.5: valid, with {len(content)} properties")


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
