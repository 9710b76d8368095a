"""Describes a published dataset and its provenance as an RO-Crate 1.2.

A CreateAction says by which software, from which scene, and with which settings the files were
made. Source: w3id.org/ro/crate/1.2.
"""

from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import quote

from lightfield.dataset.keys import RENDER_VERSION
from lightfield.dataset.publication import CARD, CROISSANT, DATACITE, RO_CRATE, Creator, Publication
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
    creators = [
        _creator(number, creator, publication.contact)
        for number, creator in enumerate(published.creators, 1)
    ]
    publisher = _publisher(publication)
    settings = _settings(published)
    graph = [
        {
            "@id": RO_CRATE,
            "@type": "CreativeWork",
            "name": "The metadata of this RO-Crate",
            "conformsTo": {"@id": "https://w3id.org/ro/crate/1.2"},
            "about": {"@id": "./"},
        },
        _root(published, files, creators, publisher),
        {
            "@id": published.licence_url,
            "@type": "CreativeWork",
            "name": published.credits.data_licence,
            "description": "The licence of this dataset",
        },
        *_contextual(publication, creators, publisher),
        *(
            {"@id": address, "@type": "CreativeWork", "name": address}
            for address in publication.derived_from
        ),
        *files,
        *_provenance(published, files, settings),
        *settings,
    ]
    return {"@context": "https://w3id.org/ro/crate/1.2/context", "@graph": graph}


def _contextual(
    publication: Publication, creators: Sequence[Entity], publisher: Entity
) -> list[Entity]:
    """Return the entities of creators, affiliations, publisher, contact and DOI, each once."""
    entities = [publisher, *creators]
    for creator in publication.creators or []:
        if creator.affiliation:
            entities.append(_organization(creator.affiliation, creator.ror))
    if publication.contact:
        entities.append(
            {
                "@id": f"mailto:{publication.contact}",
                "@type": "ContactPoint",
                "name": "Contact",
                "contactType": "questions about the dataset",
                "email": publication.contact,
            }
        )
    if publication.doi:
        address = f"https://doi.org/{publication.doi}"
        entities.append(
            {
                "@id": address,
                "@type": "PropertyValue",
                "name": "DOI",
                "propertyID": "https://registry.identifiers.org/registry/doi",
                "value": f"doi:{publication.doi}",
                "url": address,
            }
        )
    return list({entity["@id"]: entity for entity in reversed(entities)}.values())[::-1]


def _organization(name: str, ror: str | None) -> Entity:
    """Return an organization. Its ROR, if it has one, is its identifier and its page."""
    address = f"https://ror.org/{ror}"
    content = {"@id": address if ror else f"#{quote(name)}", "@type": "Organization", "name": name}
    return {**content, "url": address} if ror else content


def _publisher(publication: Publication) -> Entity:
    publisher = _organization(publication.publisher or "", publication.publisher_ror)
    if publication.publisher_url:
        publisher["url"] = publication.publisher_url
    return publisher


def _root(
    published: Published,
    files: Sequence[Entity],
    creators: Sequence[Entity],
    publisher: Entity,
) -> Entity:
    publication = published.publication
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": published.title,
        "description": published.credits.description,
        "datePublished": published.date,
        "license": {"@id": published.licence_url},
        "author": _references(creators),
        "creator": _references(creators),
        "publisher": {"@id": publisher["@id"]},
        "url": publication.url,
        "version": publication.version,
        "keywords": _compact(publication.keywords),
        "hasPart": _references(files),
        "mentions": {"@id": "#rendering"},
    }
    if publication.doi:
        root["identifier"] = {"@id": f"https://doi.org/{publication.doi}"}
    if publication.derived_from:
        root["isBasedOn"] = _compact([{"@id": address} for address in publication.derived_from])
    return root


def _references(entities: Sequence[Entity]) -> Any:
    return _compact([{"@id": entity["@id"]} for entity in entities])


def _compact(values: Sequence[Any]) -> Any:
    """Return a list of values. The specification recommends no lists of one: return its entry."""
    return list(values) if len(values) > 1 else values[0]


def _creator(number: int, creator: Creator, contact: str | None) -> Entity:
    """Return a creator. The contact for questions is that of the first one."""
    if creator.type == "person":
        address = f"https://orcid.org/{creator.orcid}" if creator.orcid else f"#creator{number}"
        content: Entity = {"@id": address, "@type": "Person", "name": creator.name}
        if creator.affiliation:
            organization = _organization(creator.affiliation, creator.ror)
            content["affiliation"] = {"@id": organization["@id"]}
    else:
        content = _organization(creator.name, creator.ror)
    if contact and number == 1:
        content["contactPoint"] = {"@id": f"mailto:{contact}"}
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
        "instrument": _compact([{"@id": name} for name in instruments]),
        "object": _references([{"@id": SCENE}, *settings]),
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
