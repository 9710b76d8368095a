"""Describes a published dataset and its provenance as an RO-Crate 1.2.

A CreateAction says by which software, from which scene, and with which settings the files were
made. Source: w3id.org/ro/crate/1.2.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from lightfield.dataset.keys import RENDER_VERSION
from lightfield.dataset.publication import CARD, CROISSANT, DATACITE, RO_CRATE, Creator
from lightfield.report.published import Published
from lightfield.report.shards import INDEX, OTHER_FILES

SOFTWARE = "#plenoforge"
RENDERER = "#bpy"
SCENE = "#scene"
MEDIA_TYPES = {
    "csv": "text/csv",
    "json": "application/json",
    "md": "text/markdown",
    "tar": "application/x-tar",
}
# The files that are no shards.
DESCRIPTIONS = {
    INDEX: "Which shard has which view",
    f"{OTHER_FILES}.tar": "The dataset's files that belong to no single view",
    CARD: "The card of the dataset for people",
    CROISSANT: "The dataset's description as Croissant",
    DATACITE: "The dataset's description for a DOI",
}
Entity = dict[str, Any]


def describe(published: Published, documents: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the content of ro-crate-metadata.json.

    ``documents`` are the entries of the other files that describe the dataset.
    """
    publication = published.publication
    files = [_file(entry) for entry in (*published.files, *documents)]
    creators = [_creator(number, creator) for number, creator in enumerate(published.creators, 1)]
    settings = _settings(published)
    graph = [
        {
            "@id": RO_CRATE,
            "@type": "CreativeWork",
            "name": "The metadata of this RO-Crate",
            "conformsTo": {"@id": "https://w3id.org/ro/crate/1.2"},
            "about": {"@id": "./"},
        },
        _root(published, files, creators),
        {
            "@id": published.licence_url,
            "@type": "CreativeWork",
            "name": published.credits.data_licence,
            "description": "The licence of this dataset",
        },
        {"@id": "#publisher", "@type": "Organization", "name": publication.publisher},
        *(
            {"@id": address, "@type": "CreativeWork", "name": address}
            for address in publication.derived_from
        ),
        *creators,
        *files,
        *_provenance(published, files, settings),
        *settings,
    ]
    return {"@context": "https://w3id.org/ro/crate/1.2/context", "@graph": graph}


def _root(published: Published, files: Sequence[Entity], creators: Sequence[Entity]) -> Entity:
    publication = published.publication
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": published.title,
        "description": published.credits.description,
        "datePublished": published.date,
        "license": {"@id": published.licence_url},
        "creator": _references(creators),
        "publisher": {"@id": "#publisher"},
        "url": publication.url,
        "version": publication.version,
        "keywords": publication.keywords,
        "hasPart": _references(files),
        "mentions": {"@id": "#rendering"},
    }
    if publication.doi:
        root["identifier"] = f"https://doi.org/{publication.doi}"
    if publication.derived_from:
        sources = [{"@id": address} for address in publication.derived_from]
        # The specification recommends no lists of one entry.
        root["isBasedOn"] = sources if sources[1:] else sources[0]
    return root


def _references(entities: Sequence[Entity]) -> list[Entity]:
    return [{"@id": entity["@id"]} for entity in entities]


def _creator(number: int, creator: Creator) -> Entity:
    content: Entity = {
        "@id": f"https://orcid.org/{creator.orcid}" if creator.orcid else f"#creator{number}",
        "@type": "Person" if creator.type == "person" else "Organization",
        "name": creator.name,
    }
    if creator.affiliation:
        content["affiliation"] = creator.affiliation
    return content


def _file(entry: Mapping[str, Any]) -> Entity:
    name = entry["file"]
    return {
        "@id": name,
        "@type": "File",
        "name": name,
        "description": DESCRIPTIONS.get(name, "Views with their passes, as a WebDataset shard"),
        "encodingFormat": MEDIA_TYPES[name.rpartition(".")[2]],
        "contentSize": str(entry["bytes"]),
        "sha256": entry["sha256"],
    }


def _provenance(
    published: Published, files: Sequence[Entity], settings: Sequence[Entity]
) -> list[Entity]:
    """Return the action that made the files, its software, and its input."""
    entities: list[Entity] = [
        {
            "@id": SOFTWARE,
            "@type": "CreativeWork",
            "name": "Plenoforge",
            "description": "Makes light-field datasets from a scene YAML.",
            "version": f"rendering {RENDER_VERSION}",
        },
        {
            "@id": SCENE,
            "@type": "CreativeWork",
            "name": f"The scene {published.lightfield.scene['name']}",
            "description": published.credits.credit or published.credits.description,
        },
    ]
    instruments = [SOFTWARE]
    if published.card["software"]:
        version = published.card["software"].rpartition(" ")[2]
        entities.append(
            {
                "@id": RENDERER,
                "@type": "SoftwareApplication",
                "name": "Cycles in bpy",
                "url": "https://pypi.org/project/bpy/",
                "version": version,
                "softwareVersion": version,
            }
        )
        instruments.append(RENDERER)
    action = {
        "@id": "#rendering",
        "@type": "CreateAction",
        "name": "Rendering and packing of the views",
        "instrument": [{"@id": name} for name in instruments],
        "object": [{"@id": SCENE}, *_references(settings)],
        "result": _references(files),
    }
    return [action, *entities]


def _settings(published: Published) -> list[Entity]:
    """Return what decided the pixels, as the first lightfield.json of the dataset has it."""
    content = published.lightfield.content
    settings: dict[str, Any] = {}
    for block in ("scene", "render", "camera"):
        settings |= _flat(block, content.get(block, {}))
    for key in ("lf_type", "resolution", "sensor_size", "frame", "depth", "machine"):
        if key in content:
            settings |= _flat(key, content[key])
    return [
        {"@id": f"#{name}", "@type": "PropertyValue", "name": name, "value": value}
        for name, value in settings.items()
    ]


def _flat(name: str, value: Any) -> dict[str, Any]:
    """Return a value by its dotted name. A mapping has an entry for each of its keys."""
    if isinstance(value, Mapping):
        return {
            dotted: inner
            for key, content in value.items()
            for dotted, inner in _flat(f"{name}.{key}", content).items()
        }
    if isinstance(value, list | tuple):
        return {name: ", ".join(map(str, value))}
    return {name: value}
