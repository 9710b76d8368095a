"""The blocks of a scene YAML, each of which is right by itself.

scene_yaml.py reads scene YAMLs. It checks with scene_checks/ whether the blocks go together.
"""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from lightfield.configuration.family import Family
from lightfield.configuration.heads import with_cameras
from lightfield.configuration.publication import Credits
from lightfield.configuration.render_settings import Render
from lightfield.configuration.reprojections import (
    OPTICS,
    Light,
    Reprojection,
    ReprojectionEntry,
    bracketed,
)
from lightfield.configuration.scene_source import SceneSource
from lightfield.core.names import FILE
from lightfield.exporters import Exports
from lightfield.formats.sensors import Sensor
from lightfield.geometry.rigs import AnyRig
from lightfield.imaging import blender_looks
from lightfield.settings.base import Name, Settings
from lightfield.settings.types import Auto, unique_names


class Flow(Settings):
    """Optical flow between pairs of views."""

    pairs: Literal["neighbours"] = Field(
        description="Pairs of views. neighbours: from each view to the view whose camera is "
        "nearest."
    )


class MeshFiles(Settings):
    """Meshes of the surface that cameras can see, and the boxes and poses of its objects."""

    formats: Annotated[list[Literal["glb", "ply"]], AfterValidator(unique_names)] = Field(
        ["glb", "ply"],
        description="Formats to write. glb: objects keep their names, and instances share a mesh. "
        "ply: all triangles together, in world coordinates.",
    )
    rigs: list[str] | None = Field(
        None,
        min_length=1,
        description="Rigs whose datasets get the meshes. Without this key, all rigs.",
    )


class Video(Settings):
    """A short video of a dataset, synthesised from its views."""

    path: Literal["turntable", "walk"] = Field(
        description="How the eye moves. turntable: around what the cameras look at; cameras that "
        "do not surround it give a sway to both sides. walk: a loop between the cameras."
    )
    format: Literal["mp4", "webp"] = Field(
        "mp4", description="Format of the file. mp4: H.264, needs ffmpeg. webp: an animation."
    )
    seconds: float = Field(
        6.0,
        ge=1,
        le=20,
        description="How long the video is. It ends where it begins.",
        json_schema_extra={"unit": "s"},
    )
    height: int = Field(
        360,
        ge=36,
        le=1080,
        multiple_of=2,
        description="Height of the pictures.",
        json_schema_extra={"unit": "pixels"},
    )
    rigs: list[str] | None = Field(
        None,
        min_length=1,
        description="Rigs whose datasets get the video. Without this key, all rigs.",
    )


class Report(Settings):
    """What the page of a dataset shows."""

    panorama: Auto | bool = Field(
        "auto",
        description="Whether the page shows a panorama from the rig's centre. auto: only if the "
        "cameras look outward in all directions. Otherwise, the page shows the view in the rig's "
        "middle.",
    )


class SceneBlocks(Credits):
    """The blocks of a scene YAML, and what follows from them."""

    scene: SceneSource = Field(
        description="Where the scene comes from: a builder, a .blend, a model, or a dataset."
    )
    render: Render | None = Field(
        None,
        description="How Cycles renders the views. Required, but not allowed with scene.dataset.",
    )
    rigs: Annotated[dict[Name, AnyRig], AfterValidator(with_cameras)] = Field(
        {},
        min_length=1,
        description="Camera setups, by the names of their folders. Leave it out with "
        "scene.dataset, which has its own cameras.",
    )
    reprojections: Annotated[dict[Name, ReprojectionEntry], AfterValidator(bracketed)] = Field(
        {},
        description="Versions of the views through other lenses or as other files, by the names of "
        "their folders.",
    )
    relight: dict[Name, Light] = Field(
        {},
        description="Versions of the views under other lights, as EXR, by the names of their "
        "folders. A light gives light groups a strength, or one each for red, green and blue. "
        "Other groups keep theirs. each: every group alone, one after the other.",
    )
    sensor: Sensor | None = Field(
        None,
        description="Versions of the views as a real sensor would record them, with noise, "
        "vignetting or exposure brackets.",
    )
    flow: Flow | None = Field(
        None,
        description="Optical flow between views, from depth and poses, for scenes that do not "
        "move.",
    )
    mesh: MeshFiles | None = Field(
        None,
        description="Meshes of the surface that cameras can see, and the bounding boxes of its "
        "objects.",
    )
    video: Video | None = Field(
        None,
        description="A turntable or a walk as a video, synthesised from the views and their depth.",
    )
    exports: Exports = Field(
        Exports(), description="Exports to the formats of trainers and other programs."
    )
    report: Report = Field(Report(), description="What the page of a dataset shows.")
    family: Family | None = Field(
        None, description="Many scenes that differ in seed, model or drawn values."
    )

    @property
    def keys_of_file_look(self) -> list[str]:
        """The keys that ask for the look of the .blend."""
        blocks: dict[str, Any] = {
            **{f"reprojections.{name}": entry for name, entry in self.reprojections.items()},
            **{f"exports.{name}": export for name, export in self.exports.selected.items()},
            "sensor": self.sensor,
        }
        return [f"{key}.look" for key, block in blocks.items() if look_of(block) == FILE]

    @property
    def developments(self) -> dict[str, Reprojection]:
        """The reprojections, and those that ``sensor`` adds, by the names of their folders."""
        developments = {
            name: entry.resolved(self.light_of(entry)) for name, entry in self.reprojections.items()
        }
        for source in self.sensor.sources if self.sensor else ():
            developments |= self._sensor_reprojections(source)
        return developments

    def _sensor_reprojections(self, source: str) -> dict[str, Reprojection]:
        """Return the reprojections that ``sensor`` adds for a source, by their folders' names."""
        assert self.sensor
        original = self.reprojections.get(source) or ReprojectionEntry()
        optics = {name: getattr(original, name) for name in OPTICS}
        return {
            name: Reprojection.of(
                **optics,
                rigs=self.sensor.rigs or original.rigs,
                bits=8 if sensor.bits <= 8 else 16,
                formats=["png"],
                sensor=sensor,
                look=sensor.look,
                look_source=blender_looks.source_of(sensor.look),
            )
            for name, sensor in self.sensor.folders(source).items()
        }

    def light_of(self, reprojection: ReprojectionEntry) -> Any:
        """Return the strengths of a reprojection's light, or `each`. None for unchanged light."""
        light = reprojection.relight
        return self.relight[light] if isinstance(light, str) and light in self.relight else light


def look_of(block: Any) -> str | None:
    """Return the look of a reprojection, of an export or of the sensor, if it has one."""
    return getattr(block, "look", None)
