"""Describes a published dataset for programs, as Croissant 1.1 with the responsible-AI fields.

Sources: docs.mlcommons.org/croissant/docs/croissant-spec-1.1.html and croissant-rai-spec.html.
NeurIPS 2026 asks for the responsible-AI fields that `_RESPONSIBLE_AI` names, for hasSyntheticData,
and for the provenance.
"""

from collections.abc import Mapping
from typing import Any

from lightfield.configuration.publication import Creator, Publication
from lightfield.publishing.published import Published
from lightfield.publishing.shards import INDEX

# The context that the specification recommends, with PROV for the provenance.
_CONTEXT: dict[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "arrayShape": "cr:arrayShape",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "containedIn": "cr:containedIn",
    "cr": "http://mlcommons.org/croissant/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "description": {"@container": "@language"},
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileObject": "cr:fileObject",
    "fileProperty": "cr:fileProperty",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isArray": "cr:isArray",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "name": {"@container": "@language"},
    "parentField": "cr:parentField",
    "path": "cr:path",
    "prov": "http://www.w3.org/ns/prov#",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "samplingRate": "cr:samplingRate",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}
# The responsible-AI fields, with the keys of `publish` that they hold.
_RESPONSIBLE_AI = {
    "rai:dataLimitations": "limitations",
    "rai:dataBiases": "biases",
    "rai:personalSensitiveInformation": "personal_information",
    "rai:dataUseCases": "use_cases",
    "rai:dataSocialImpact": "social_impact",
}
# Croissant names formats by media types. EXR has none that is registered.
FORMATS = {
    "exr": "https://openexr.com",
    "jpg": "image/jpeg",
    "png": "image/png",
    "json": "application/json",
    "csv": "text/csv",
    "tar": "application/x-tar",
}


def describe(published: Published) -> dict[str, Any]:
    """Return the content of croissant.json. Facts that the author has not given are left out."""
    publication = published.publication
    content: dict[str, Any] = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": [
            "http://mlcommons.org/croissant/1.1",
            "http://mlcommons.org/croissant/RAI/1.0",
        ],
        "name": published.title,
        "description": published.credits.description,
        "url": publication.url,
        "license": published.licence_url,
        "creator": [_creator(creator) for creator in published.creators],
        "publisher": _publisher(publication),
        "datePublished": publication.date,
        "version": publication.version,
        "keywords": publication.keywords,
        "citeAs": published.citation,
        "isLiveDataset": False,
        "distribution": [*map(_file, published.files), *_file_sets(published)],
        "recordSet": [_views(), *_pictures(published)],
    }
    for name, key in _RESPONSIBLE_AI.items():
        content[name] = getattr(publication, key)
    content["rai:hasSyntheticData"] = publication.synthetic
    content["rai:dataCollection"] = _generation(published)
    content["prov:wasDerivedFrom"] = _sources(published)
    content["prov:wasGeneratedBy"] = {
        "@type": "prov:Activity",
        "prov:label": _generation(published),
    }
    return {key: value for key, value in content.items() if value not in (None, "", [])}


def _publisher(publication: Publication) -> dict[str, str] | None:
    if publication.publisher is None:
        return None
    return {"@type": "sc:Organization", "name": publication.publisher}


def _creator(creator: Creator) -> dict[str, Any]:
    kind = "sc:Person" if creator.type == "person" else "sc:Organization"
    content = {"@type": kind, "name": creator.name}
    if creator.orcid:
        content["url"] = f"https://orcid.org/{creator.orcid}"
    return content


def _generation(published: Published) -> str:
    """Return in one sentence how the views were made."""
    software = published.card["software"]
    if not software:
        return "The views were imported as others had made them."
    return f"Plenoforge rendered the views by {software}, with the settings in lightfield.json."


def _sources(published: Published) -> list[dict[str, str]]:
    scene = published.lightfield.scene
    origin = scene.get("builder") or scene.get("blend") or scene.get("dataset") or scene["name"]
    entities = [{"@type": "prov:Entity", "prov:label": f"the scene {origin}"}]
    for address in published.publication.derived_from:
        entities.append({"@type": "prov:Entity", "@id": address, "prov:label": address})
    return entities


def _file(entry: Mapping[str, Any]) -> dict[str, Any]:
    name = entry["file"]
    return {
        "@type": "cr:FileObject",
        "@id": name,
        "name": name,
        "contentUrl": name,
        "contentSize": f"{entry['bytes']} B",
        "encodingFormat": FORMATS[name.rpartition(".")[2]],
        "sha256": entry["sha256"],
    }


def _file_sets(published: Published) -> list[dict[str, Any]]:
    """Return a set of files for each member of a sample."""
    return [
        {
            "@type": "cr:FileSet",
            "@id": f"files-{name}",
            "name": f"files-{name}",
            "containedIn": [
                {"@id": entry["file"]} for files in published.shards.values() for entry in files
            ],
            "encodingFormat": FORMATS[name.rpartition(".")[2]],
            "includes": f"*.{name}",
            **_colours(name, published),
        }
        for name in published.fields
    ]


def _colours(name: str, published: Published) -> dict[str, str]:
    """Return a description of what the values of a member are, if it is a PNG."""
    if not name.endswith(".png"):
        return {}
    look = published.looks.get(name)
    return {"description": f"sRGB{f', developed by Blender with the look {look}' if look else ''}"}


def _views() -> dict[str, Any]:
    """Return the records of the views, which are the rows of the index."""
    fields = [
        {
            "@type": "cr:Field",
            "@id": f"views/{column}",
            "name": column,
            "dataType": "sc:Text",
            "source": {"fileObject": {"@id": INDEX}, "extract": {"column": column}},
        }
        for column in ("sample", "view", "split", "shard")
    ]
    return {
        "@type": "cr:RecordSet",
        "@id": "views",
        "name": "views",
        "key": {"@id": "views/sample"},
        "field": fields,
    }


def _pictures(published: Published) -> list[dict[str, Any]]:
    """Return the records of each member that is a picture: its sample's key, and its file."""
    return [_picture(name) for name in published.fields if name != "json"]


def _picture(name: str) -> dict[str, Any]:
    file_set = {"fileSet": {"@id": f"files-{name}"}}
    identifier = f"pictures-{name}"
    key: dict[str, Any] = {
        "@type": "cr:Field",
        "@id": f"{identifier}/sample",
        "name": "sample",
        "dataType": "sc:Text",
        "source": {
            **file_set,
            "extract": {"fileProperty": "filename"},
            "transform": {"regex": r"^([^.]+)\."},
        },
    }
    file: dict[str, Any] = {
        "@type": "cr:Field",
        "@id": f"{identifier}/file",
        "name": "file",
        "dataType": "sc:Text",
        "source": {**file_set, "extract": {"fileProperty": "fullpath"}},
    }
    return {
        "@type": "cr:RecordSet",
        "@id": identifier,
        "name": identifier,
        "key": {"@id": key["@id"]},
        "field": [key, file],
    }
