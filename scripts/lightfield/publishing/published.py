"""A published dataset: the facts in the files that describe it."""

import re
from dataclasses import dataclass
from typing import Any

from lightfield.configuration.publication import Creator, Publication
from lightfield.configuration.scene_yaml import Credits
from lightfield.formats.lightfield import LightField
from lightfield.publishing.markdown import one_line


@dataclass(frozen=True)
class Published:
    """A dataset as it is published.

    ``card`` is its package's card, ``lightfield`` its first lightfield.json. ``shards`` has an
    entry for each tar of each split. ``others`` has an entry for each file beside them. An entry
    has the keys file, bytes and sha256. ``fields`` are the names of a sample's members. ``views``
    counts the samples.
    """

    name: str
    credits: Credits
    card: dict[str, Any]
    lightfield: LightField
    shards: dict[str, list[dict[str, Any]]]
    others: list[dict[str, Any]]
    fields: tuple[str, ...]
    views: int

    @property
    def publication(self) -> Publication:
        assert self.credits.publish
        return self.credits.publish

    @property
    def creators(self) -> list[Creator]:
        return self.publication.creators or []

    @property
    def date(self) -> str:
        return self.publication.date or ""

    @property
    def title(self) -> str:
        return self.publication.title or self.name

    @property
    def licence_url(self) -> str:
        return f"https://spdx.org/licenses/{self.credits.data_licence}.html"

    @property
    def files(self) -> list[dict[str, Any]]:
        """The entries of all files except the descriptions."""
        return [*(entry for entries in self.shards.values() for entry in entries), *self.others]

    @property
    def looks(self) -> dict[str, str]:
        """Blender's look of each of the ``fields`` that is a picture with one."""
        # In a sequence, a folder lies in the folder of a frame.
        looks = {
            place.rpartition("/")[2]: look for place, look in self.card.get("looks", {}).items()
        }
        folders = {field: re.split(r"[+.]", field)[0] for field in self.fields}
        return {
            field: looks[folder]
            for field, folder in folders.items()
            if field.endswith(".png") and folder in looks
        }

    @property
    def citation(self) -> str:
        """The citation as BibTeX."""
        publication = self.publication
        lines = {
            "title": f"{{{self.title}}}",
            "author": " and ".join(creator.name for creator in self.creators),
            "publisher": publication.publisher,
            "year": self.date[:4],
            "version": publication.version,
            "doi": publication.doi,
            "url": publication.url,
        }
        # An angle bracket could begin HTML on a page that shows this.
        texts = {
            name: one_line(value).replace("<", r"{\textless}")
            for name, value in lines.items()
            if value
        }
        entries = [f"  {name} = {{{text}}}" for name, text in texts.items()]
        return "@misc{" + self.name + ",\n" + ",\n".join(entries) + "\n}"
