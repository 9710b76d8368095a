"""What a scene YAML's `exports` may ask of each exporter, one model an exporter."""

from typing import Annotated, Literal

from pydantic import Field

from lightfield.core.settings import Settings, Vector

# In `sources`, the rendered views themselves.
VIEWS = "views"


class Export(Settings):
    sources: list[str] = Field(
        min_length=1,
        description=f"Names of reprojections; `{VIEWS}` stands for the rendered views.",
    )


class InstantNgp(Export):
    """The transforms.json of instant-ngp."""

    scale: Annotated[float, Field(gt=0)] | None = Field(
        None, description="World to unit cube; without it, fitted to the scene."
    )
    offset: Vector = Field(
        (0.5, 0.5, 0.5), description="Where the mean camera lies in the unit cube."
    )
    aabb_scale: Literal[1, 2, 4, 8, 16, 32, 64, 128] | None = Field(
        None, description="Side of the training volume, in unit cubes."
    )

    def words(self) -> list[str]:
        """Return the words that place the scene in instant-ngp's unit cube."""
        words = []
        if self.scale is not None:
            words += ["--scale", str(self.scale), "--offset", *map(str, self.offset)]
        if self.aabb_scale is not None:
            words += ["--aabb-scale", str(self.aabb_scale)]
        return words


class Exports(Settings):
    instant_ngp: InstantNgp | None = None
