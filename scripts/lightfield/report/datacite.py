"""Describes a published dataset for a DOI, by DataCite's schema 4.5.

Source: schema.datacite.org/meta/kernel-4.5.
"""

from typing import Any

from lightfield.dataset.publication import Creator, Publication
from lightfield.report.published import Published


def describe(published: Published) -> dict[str, Any]:
    """Return the content of datacite.json."""
    publication = published.publication
    content: dict[str, Any] = {
        "schemaVersion": "http://datacite.org/schema/kernel-4",
        "types": {"resourceType": "Light field", "resourceTypeGeneral": "Dataset"},
        "creators": [_creator(creator) for creator in published.creators],
        "titles": [{"title": published.title}],
        "publisher": _publisher(publication),
        "publicationYear": published.date[:4],
        "dates": [{"date": published.date, "dateType": "Issued"}],
        "url": publication.url,
        "version": publication.version,
        "subjects": [{"subject": keyword} for keyword in publication.keywords],
        "descriptions": [
            {"description": published.credits.description, "descriptionType": "Abstract"}
        ],
        "rightsList": [
            {
                "rightsUri": published.licence_url,
                "rightsIdentifier": published.credits.data_licence,
                "rightsIdentifierScheme": "SPDX",
            }
        ],
        "sizes": [f"{sum(entry['bytes'] for entry in published.files)} bytes"],
        "formats": ["application/x-tar", "text/csv"],
    }
    if publication.doi:
        content["doi"] = publication.doi
    if publication.derived_from:
        content["relatedIdentifiers"] = [
            {
                "relatedIdentifier": address,
                "relatedIdentifierType": "URL",
                "relationType": "IsDerivedFrom",
            }
            for address in publication.derived_from
        ]
    return content


def _publisher(publication: Publication) -> dict[str, Any]:
    content: dict[str, Any] = {"name": publication.publisher}
    if publication.publisher_ror:
        content |= {
            "publisherIdentifier": f"https://ror.org/{publication.publisher_ror}",
            "publisherIdentifierScheme": "ROR",
            "schemeUri": "https://ror.org",
        }
    return content


def _creator(creator: Creator) -> dict[str, Any]:
    is_person = creator.type == "person"
    content: dict[str, Any] = {
        "name": creator.name,
        "nameType": "Personal" if is_person else "Organizational",
    }
    if creator.orcid:
        content["nameIdentifiers"] = [
            {
                "nameIdentifier": f"https://orcid.org/{creator.orcid}",
                "nameIdentifierScheme": "ORCID",
                "schemeUri": "https://orcid.org",
            }
        ]
    ror = f"https://ror.org/{creator.ror}"
    if creator.ror and not is_person:
        content["nameIdentifiers"] = [
            {"nameIdentifier": ror, "nameIdentifierScheme": "ROR", "schemeUri": "https://ror.org"}
        ]
    if creator.affiliation:
        affiliation = {"name": creator.affiliation}
        if creator.ror:
            affiliation |= {
                "affiliationIdentifier": ror,
                "affiliationIdentifierScheme": "ROR",
                "schemeUri": "https://ror.org",
            }
        content["affiliation"] = [affiliation]
    return content
