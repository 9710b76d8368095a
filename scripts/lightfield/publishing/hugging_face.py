"""Writes the README.md of a published dataset: a card with Hugging Face's front matter.

Source: huggingface.co/docs/hub/datasets-cards.
"""

import json
from typing import Any

import yaml

from lightfield.configuration.publication import Publication
from lightfield.core.names import VIEWS
from lightfield.formats.lightfield import LightField
from lightfield.formats.passes import FLOW, PASSES
from lightfield.publishing.markdown import markdown, one_line
from lightfield.publishing.published import Published
from lightfield.publishing.shards import THUMBNAIL

# Licences that Hugging Face knows by their names. They are the short names in small letters.
_HUGGING_FACE_LICENCES = {
    "apache-2.0",
    "mit",
    "cc0-1.0",
    "cc-by-3.0",
    "cc-by-4.0",
    "cc-by-sa-3.0",
    "cc-by-sa-4.0",
    "cc-by-nc-3.0",
    "cc-by-nc-4.0",
    "cc-by-nd-4.0",
    "cc-by-nc-nd-4.0",
    "cc-by-nc-sa-4.0",
}
# The largest number of views of each of Hugging Face's classes of size.
SIZES = (
    (1e3, "n<1K"),
    (1e4, "1K<n<10K"),
    (1e5, "10K<n<100K"),
    (1e6, "100K<n<1M"),
    (1e7, "1M<n<10M"),
)


def describe(published: Published) -> str:
    """Return the content of README.md."""
    licence = published.credits.data_licence or ""
    front_matter: dict[str, Any] = {"pretty_name": published.title}
    if licence.lower() in _HUGGING_FACE_LICENCES:
        front_matter["license"] = licence.lower()
    else:
        front_matter |= {
            "license": "other",
            "license_name": licence.lower(),
            "license_link": published.licence_url,
        }
    tasks = ["image-to-3d", *(["depth-estimation"] if published.card["depth"] else [])]
    data_files = [
        {"split": split, "path": f"{published.name}-{split}-*.tar"} for split in published.shards
    ]
    front_matter |= {
        "task_categories": tasks,
        "size_categories": [next((size for most, size in SIZES if published.views < most), "n>1T")],
        "tags": ["webdataset", *published.publication.keywords],
        "configs": [{"config_name": "default", "data_files": data_files}],
    }
    return markdown(
        "published.md.j2",
        front_matter=yaml.safe_dump(front_matter, sort_keys=False, allow_unicode=True),
        title=one_line(published.title),
        description=published.credits.description,
        name=published.name,
        card=published.card,
        views=published.views,
        licence=licence,
        licence_url=published.licence_url,
        shards=published.shards,
        data_files=json.dumps({part["split"]: part["path"] for part in data_files}),
        first_shard=next(iter(published.shards.values()))[0]["file"],
        fields=published.fields,
        meanings={name: _meaning(name, published.lightfield) for name in published.fields},
        looks=published.looks,
        limits=_limits(published.publication),
        citation=published.citation,
    )


def _limits(publication: Publication) -> dict[str, str]:
    """Return what the author says about the limits and the use of the dataset, by titles."""
    texts = {
        "Limitations": publication.limitations,
        "Biases": publication.biases,
        "Personal information": publication.personal_information,
        "Use cases": publication.use_cases,
        "Social impact": publication.social_impact,
    }
    return {title: text for title, text in texts.items() if text}


def _meaning(field: str, lightfield: LightField) -> str:
    """Describe a member of a sample by its name without the sample's key."""
    if field == "json":
        return "pose, camera and checksum of each picture"
    if field == THUMBNAIL:
        return "the view as a small picture, tone-mapped, which the viewer on this page shows"
    stem = field.rpartition(".")[0]
    if stem == VIEWS:
        alpha = ", opacity in A" if lightfield.transparent else ""
        depth = ", depth in Z" if lightfield.depth else ""
        return f"the view: colour in R, G, B{alpha}{depth}"
    *reprojection, last = stem.split("+")
    view_pass = FLOW if last == FLOW.name else PASSES.get(last)
    if view_pass is None:
        return f"the view, reprojected: {stem}"
    meaning = view_pass.meaning
    return f"{meaning}, reprojected: {' '.join(reprojection)}" if reprojection else meaning
