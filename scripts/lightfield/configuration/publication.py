"""What only the author of a dataset knows: the texts and the key `publish` of a scene YAML.

Croissant and Hugging Face ask for these facts. The responsible-AI texts are
those that NeurIPS asks for since 2026.
"""

import datetime
import re
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from lightfield.core.names import READER
from lightfield.settings.base import Address, Settings, pattern


def _as_text(value: Any) -> Any:
    """Return a date as a text, because YAML reads 2026-11-30 as a date."""
    return value.isoformat() if type(value) is datetime.date else value


Date = Annotated[
    str,
    BeforeValidator(_as_text),
    Field(
        pattern=pattern(
            r"^[0-9]{4}-(0[1-9]|1[0-2])-(0[1-9]|[12][0-9]|3[01])$", "a date such as 2026-11-30"
        )
    ),
]
# This folder stands beside the rigs' folders. It has a folder for each published dataset.
PUBLISHED_FOLDER = "published"
CARD = "README.md"
CROISSANT = "croissant.json"
# The files that describe a published dataset and read it, and the checksums of all its files.
DOCUMENTS = (CARD, CROISSANT, READER, "sha256sums.txt")

# The form of a licence's short name at https://spdx.org/licenses.
SPDX = r"^[A-Za-z0-9][A-Za-z0-9.+-]*$"
Licence = Annotated[
    str,
    Field(
        pattern=pattern(
            SPDX, "a short name from https://spdx.org/licenses, such as CC-BY-4.0 or CC0-1.0"
        )
    ),
]
Text = Annotated[
    str, Field(min_length=1, pattern=pattern(r"\S", "a text with more than white space"))
]


class Creator(Settings):
    """A person or an organization that made a dataset."""

    name: Text = Field(description="Full name.")
    type: Literal["person", "organization"] = Field(
        "person", description="Whether the creator is a person or an organization."
    )
    orcid: str | None = Field(
        None,
        pattern=pattern(
            r"^[0-9]{4}-[0-9]{4}-[0-9]{4}-[0-9]{3}[0-9X]$", "digits such as 0000-0002-1825-0097"
        ),
        description="ORCID of the person.",
    )


# What repositories and their readers ask for.
_EXPECTED = (
    "creators",
    "url",
    "publisher",
    "date",
    "limitations",
    "biases",
    "personal_information",
    "use_cases",
    "social_impact",
)


class Publication(Settings):
    """Facts about a dataset that only its author knows. Publishing requires a licence, here or of
    the scene. It warns of these missing keys: `creators`, `url`, `publisher`, `date`,
    `limitations`, `biases`, `personal_information`, `use_cases` and `social_impact`.
    """

    creators: Annotated[list[Creator], Field(min_length=1)] | None = Field(
        None, description="People and organizations that made the dataset."
    )
    licence: Licence | None = Field(
        None,
        description="Licence of the data, by its short name at https://spdx.org/licenses. Without "
        "this key, it is the licence of the scene.",
    )
    url: Address | None = Field(
        None, description="Address of the web page where the dataset will be available."
    )
    publisher: Text | None = Field(
        None,
        description="Name of the publisher that hosts the dataset, such as Zenodo, Hugging Face or "
        "a university.",
    )
    date: Date | None = Field(None, description="Date of publication, such as 2026-11-30.")
    limitations: Text | None = Field(
        None, description="Limitations of the dataset: what it cannot show."
    )
    biases: Text | None = Field(
        None, description="Biases of the dataset: what it shows too often or too rarely."
    )
    personal_information: Text | None = Field(
        None,
        description="Which personal information the dataset contains. For most scenes, write None.",
    )
    use_cases: Text | None = Field(
        None,
        description="Uses for which the dataset was made, and uses for which it is unsuitable.",
    )
    social_impact: Text | None = Field(
        None, description="Benefits and risks of the dataset for society."
    )
    title: Text | None = Field(
        None,
        description="Title of the dataset. Without this key, it is the archive's name, "
        "<scene>_<rig>.",
    )
    doi: str | None = Field(
        None,
        pattern=pattern(r"""^10\.[0-9]{4,9}/[^\s"'<>]+$""", "a DOI such as 10.5281/zenodo.1234"),
        description="DOI of the dataset, if one is reserved.",
    )
    version: str = Field(
        "1.0.0",
        pattern=pattern(r"^[0-9]+\.[0-9]+\.[0-9]+$", "three numbers such as 1.0.0"),
        description="Version of the dataset.",
    )
    synthetic: bool = Field(
        True, description="Whether the views are rendered. false: they are photographed."
    )
    keywords: list[Text] = Field(
        ["light field", "novel view synthesis", "synthetic images"],
        min_length=1,
        description="Keywords by which people find the dataset.",
    )
    derived_from: list[Address] = Field(
        [], description="Addresses of the models, textures or scans from which the scene was made."
    )

    @property
    def missing_keys(self) -> list[str]:
        """The keys without a value that repositories ask for."""
        return [name for name in _EXPECTED if getattr(self, name) is None]


class Credits(Settings):
    """What a package's card says about the scene, and what publishing needs in addition."""

    description: str | None = Field(None, description="Description of the scene, in one line.")
    licence: str | None = Field(
        None,
        description="Licence of the scene, for a package's card. It is also the licence of the "
        "data, unless publish has another.",
    )
    credit: str | None = Field(None, description="How to cite the artist of the scene.")
    publish: Publication | None = Field(
        None,
        description="What a repository of datasets needs to know. With this key, its metadata and "
        "shards are also written. Without it, a package is only an archive.",
    )

    @property
    def data_licence(self) -> str | None:
        """The short name of the data's licence: its own, or else the scene's."""
        if self.publish and self.publish.licence:
            return self.publish.licence
        is_short_name = self.licence and re.fullmatch(SPDX, self.licence)
        return self.licence if is_short_name else None

    @property
    def missing_texts(self) -> list[str]:
        """The keys without a value that a published dataset should have."""
        keys = [] if self.description else ["description"]
        if self.publish:
            keys += [f"publish.{key}" for key in self.publish.missing_keys]
        return keys

    @model_validator(mode="after")
    def _can_be_published(self) -> Self:
        if self.publish and self.data_licence is None:
            raise ValueError(
                "publish.licence: is missing; must be a short name from https://spdx.org/licenses, "
                "unless the scene's licence is one"
            )
        return self
