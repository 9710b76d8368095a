"""The options of each exporter in a scene YAML, and what each consumer accepts.

Each exporter has a model of its options. Its `refusal` says what the consumer cannot open, and what
to do instead. It is called when a YAML is read. `lightfield.export` says what the options do.
"""

import math
import shutil
from typing import Annotated, Any, ClassVar, Generic, Literal, Self, TypeVar, get_args

from pydantic import Field, model_validator

from lightfield.core.names import PARTS, VIEWS
from lightfield.engine.stage import cause
from lightfield.geometry.lenses import Lens
from lightfield.geometry.lenses.equidistant import Equidistant
from lightfield.geometry.lenses.equirectangular import Equirectangular
from lightfield.geometry.lenses.kannala_brandt import KannalaBrandt
from lightfield.geometry.lenses.rectilinear import Rectilinear
from lightfield.geometry.rigs import BlendCamera, Rig
from lightfield.geometry.rigs.plane import Plane
from lightfield.imaging import blender_looks
from lightfield.imaging.blender_looks import LookName
from lightfield.settings.base import ReaderSettings, Settings, Vector, as_list
from lightfield.settings.types import REINHARD, Stops, White

FARTHEST = 999.9
"""Metres. Disparity treats misses, and everything farther, as if they were at this distance."""
BOUNDS_VIEWS = 64
"""The extent of a scene is measured in this many views."""
BOUNDS_PIXELS = 64
"""The views that measure a scene's extent have this many pixels along the longer side."""

_TO_RECTILINEAR = "reproject to rectilinear"


class Export(Settings):
    """The options that all exporters share."""

    # Whether the export includes other rigs' views, which test the trained models.
    is_for_training: ClassVar[bool] = False
    # Whether the export lists test views also if the rig has no split.
    chooses_tests: ClassVar[bool] = False
    # Whether the export is made of all frames of a sequence.
    is_of_sequence: ClassVar[bool] = False
    # Whether the export has the times of a rolling shutter's rows.
    has_row_times: ClassVar[bool] = False
    # Whether the export lifts points from the depth of the rendered views.
    needs_surfaces: ClassVar[bool] = False

    sources: list[str] = Field(
        min_length=1,
        description=f"What to export: names of reprojections, or `{VIEWS}` for the views as they "
        "were rendered. Each becomes an export of its own.",
    )
    # This changes no file of an export.
    rigs: list[str] | None = Field(
        None,
        min_length=1,
        exclude=True,
        description="Rigs whose views are exported. Without this key, all rigs.",
    )

    @property
    def joins_split(self) -> bool:
        """Whether an export of a rig that trains concerns the rigs that test, and vice versa."""
        return self.is_for_training

    @property
    def recorded(self) -> dict[str, Any]:
        """The options that the export's own files record."""
        return self.model_dump(mode="json", exclude={"sources"})

    @property
    def needed_passes(self) -> tuple[str, ...]:
        """The names of the passes that each source must have."""
        return ()

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        """Return why the consumer cannot take views of a lens, and what to do. None if it can.

        ``has_depth`` says whether the source holds depth: EXR does, and PNG does not.
        """
        return None

    def rig_refusal(self, rig: Rig) -> str | None:
        """Return why the consumer cannot take the views of a rig. None if it can."""
        if self.is_of_sequence and isinstance(rig, BlendCamera):
            return (
                "is of type blend_camera, whose frames are views of one still scene, and this "
                "export is for sequences; give it a rig of another type with frames"
            )
        if self.is_of_sequence and (rig.sequence is None or len(rig.sequence.numbers) < 2):
            return (
                "has fewer than two frames, and this export is for sequences; give the rig frames"
            )
        if self.is_for_training and rig.view_count == 1 and rig.split not in PARTS:
            return "has only one view, so no view is left for testing"
        return None


class Developed(Export):
    """Exports of 8-bit images. ``exposure``, ``reinhard``, ``look`` apply only to EXR sources."""

    exposure: Stops = Field(
        0.0,
        description="Exposure that is applied to EXR sources.",
        json_schema_extra={"unit": "stops"},
    )
    reinhard: White = Field(
        1.0,
        description=f"Tone mapping of EXR sources: the {REINHARD}",
        json_schema_extra={"unit": "light"},
    )
    look: LookName = None

    @model_validator(mode="after")
    def _one_tone_curve(self) -> Self:
        blender_looks.check_beside(self.look, self.reinhard)
        return self

    @property
    def recorded(self) -> dict[str, Any]:
        # An export records what the look is, and only if it is used.
        return {key: value for key, value in super().recorded.items() if key != "look"}


_PointCount = Annotated[int, Field(ge=1)]
# Refusals of views without depth. What to do depends on the source, and scene_yaml.py adds it.
NO_DEPTH = "holds no depth"
NOT_EXR = "is not in EXR"


class InstantNgp(Export):
    """The transforms.json of instant-ngp."""

    scale: Annotated[float, Field(gt=0, le=1e6)] | None = Field(
        None,
        description="Scale from metres to unit cubes. Without this key, it is fitted to the scene.",
        json_schema_extra={"unit": "cubes/m"},
    )
    offset: Vector | None = Field(
        None,
        description="Position of the mean camera in the unit cube. Without this key, it is 0.5 "
        "along each axis.",
        json_schema_extra={"unit": "cubes"},
    )
    bounds: Literal["rig", "depth"] = Field(
        "rig",
        description="What the unit cube is fitted to without a scale. rig: the cameras. depth: the "
        "cameras, and most of the surfaces that the views see.",
    )
    aabb_scale: Literal[1, 2, 4, 8, 16, 32, 64, 128] | None = Field(
        None,
        description="Length of a side of the volume in which instant-ngp trains.",
        json_schema_extra={"unit": "cubes"},
    )
    render_aabb: Annotated[tuple[Vector, Vector], as_list(2)] | None = Field(
        None,
        description="Two opposite corners of the part of the unit cube that instant-ngp shows.",
        json_schema_extra={"unit": "cubes"},
    )
    depth: bool = Field(
        False, description="Also write depth maps of 16 bits. The source must have depth."
    )

    @model_validator(mode="after")
    def _one_placement(self) -> Self:
        if self.scale is not None and self.bounds == "depth":
            raise ValueError("bounds: does not go with scale, which it would determine")
        if self.scale is None and self.offset is not None:
            raise ValueError("offset: needs scale; without scale, both are fitted")
        if self.render_aabb:
            lowest, highest = self.render_aabb
            if any(low >= high for low, high in zip(lowest, highest, strict=True)):
                raise ValueError("render_aabb: must have the corner of smaller numbers first")
        return self

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return NO_DEPTH if (self.depth or self.bounds == "depth") and not has_depth else None

    def rig_refusal(self, rig: Rig) -> str | None:
        if self.scale is None and self.bounds == "rig" and rig.positions == 1:
            return "has cameras at one place, which gives no scale; give scale, or bounds: depth"
        return None

    @property
    def joins_split(self) -> bool:
        # Test views get the scale and offset of the training views.
        return True

    @property
    def recorded(self) -> dict[str, Any]:
        options = super().recorded
        del options["offset"]
        # Without a scale the offset is fitted, too.
        return options if self.scale is None else {**options, "offset": list(self.middle)}

    @property
    def middle(self) -> tuple[float, float, float]:
        """The mean camera's place in the unit cube, if a scale is given."""
        return self.offset or (0.5, 0.5, 0.5)


class Colmap(Developed):
    """A COLMAP model, for gsplat, 3DGRUT, Brush and the original 3D Gaussian splatting."""

    is_for_training: ClassVar[bool] = True
    needs_surfaces: ClassVar[bool] = True

    format: Literal["binary", "text"] = Field("binary", description="Form of COLMAP's files.")
    points: _PointCount = Field(
        50000,
        description="Largest number of points, which are computed from depth. An image in which "
        "none of them lies gets one more.",
    )
    depth: bool = Field(False, description="Also write depth maps. The source must have depth.")

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if isinstance(lens, Equidistant | KannalaBrandt):
            # COLMAP projects only points in front of the camera.
            if lens.fov >= math.pi:
                return f"{_angle(lens)}, but COLMAP's fisheye ends below 180; give it a smaller fov"
        elif isinstance(lens, Equirectangular):
            if not lens.is_full:
                return f"is a part of a panorama; COLMAP takes whole ones; {_TO_RECTILINEAR}"
            if self.depth:
                return "is a panorama, for which COLMAP has no depth maps; leave out depth: true"
        elif not isinstance(lens, Rectilinear):
            return f"has a lens that COLMAP lacks; {_TO_RECTILINEAR}, or equidistant below 180°"
        return NO_DEPTH if self.depth and not has_depth else None


class Nerfstudio(Developed):
    """A nerfstudio dataset, for nerfstudio and Brush."""

    is_for_training: ClassVar[bool] = True
    chooses_tests: ClassVar[bool] = True
    needs_surfaces: ClassVar[bool] = True

    points: _PointCount = Field(50000, description="Largest number of points in the point cloud.")
    depth: bool = Field(False, description="Also write depth maps. The source must have depth.")
    # This changes no file.
    splatfacto: bool = Field(
        False, exclude=True, description="Whether to refuse lenses that splatfacto cannot train on."
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if self.splatfacto and not isinstance(lens, Rectilinear):
            return f"would be taken for a pinhole by splatfacto; {_TO_RECTILINEAR}"
        if isinstance(lens, Equidistant | KannalaBrandt):
            has_pixel_on_axis = lens.center[0] % 1 == 0.5 and lens.center[1] % 1 == 0.5
            if has_pixel_on_axis:
                return "has a pixel on its optical axis, which is NaN to nerfstudio; use even sizes"
        elif isinstance(lens, Equirectangular):
            if not lens.is_full:
                return f"is a part of a panorama; nerfstudio takes whole ones; {_TO_RECTILINEAR}"
        elif not isinstance(lens, Rectilinear):
            return f"has a lens that nerfstudio lacks; {_TO_RECTILINEAR}, equidistant or a panorama"
        return NO_DEPTH if self.depth and not has_depth else None


class NerfSynthetic(Developed):
    """The layout of NeRF's synthetic scenes: RGBA images, and a list for each part of the split."""

    is_for_training: ClassVar[bool] = True
    chooses_tests: ClassVar[bool] = True

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return _centred_pinhole(lens)


class OpenDibr(Developed):
    """The views and list that OpenDIBR plays."""

    format: Literal["png", "h265"] = Field(
        "png", description="Form of the colour and disparity images. h265 needs ffmpeg."
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if isinstance(lens, Equidistant):
            if lens.center != (lens.width / 2, lens.height / 2):
                return "has its axis off centre, which OpenDIBR's fisheye cannot have"
        elif not isinstance(lens, Rectilinear | Equirectangular):
            return f"has a lens that OpenDIBR lacks; {_TO_RECTILINEAR}, equidistant or a panorama"
        if self.format == "h265" and shutil.which("ffmpeg") is None:
            return "becomes H.265, for which ffmpeg must be installed; or give format: png"
        refusal = _odd_size_refusal(lens) if self.format == "h265" else None
        return refusal or (None if has_depth else NO_DEPTH)


class Miv(Developed):
    """A sequence for TMIV, the test model of MPEG immersive video."""

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if not isinstance(lens, Rectilinear | Equirectangular):
            return (
                "has a lens that MIV lacks; reproject to rectilinear, or to equirectangular, "
                "a fisheye of 180 degrees with longitude: [-90, 90], and format: exr"
            )
        return _odd_size_refusal(lens) or (None if has_depth else NO_DEPTH)


class Hci(Developed):
    """The layout of the HCI 4D light field benchmark, with disparities."""

    disparity: Literal["exr"] | None = Field(
        None,
        description="exr: also write the disparity maps as EXR, with a channel Y of 32-bit floats, "
        "in pixels between neighbouring views.",
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return _centred_pinhole(lens) or (None if has_depth else NO_DEPTH)

    def rig_refusal(self, rig: Rig) -> str | None:
        if not isinstance(rig, Plane) or rig.cube_map or rig.look_at is not None:
            return "is not a rig of type plane with parallel cameras, which HCI's layout needs"
        steps = rig.steps
        if not steps:
            return "has only one view"
        if math.isclose(steps[0], steps[-1], rel_tol=1e-6):
            return None
        return (
            f"has cameras {steps[0]:g} m apart across and {steps[1]:g} m apart down, which are "
            "equal in HCI's layout; give it a baseline in place of size"
        )


class ScanNetPP(Developed):
    """ScanNet++'s layout of a fisheye camera, for 3DGRUT and Fisheye-GS."""

    is_for_training: ClassVar[bool] = True
    chooses_tests: ClassVar[bool] = True
    needs_surfaces: ClassVar[bool] = True

    points: _PointCount = Field(
        50000,
        description="Largest number of points, which are computed from depth. An image in which "
        "none of them lies gets one more.",
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if isinstance(lens, Equidistant):
            if lens.fov < math.pi:
                return None
            return f"{_angle(lens)}, but this layout ends below 180; give it a smaller fov"
        return "is not an equidistant fisheye below 180 degrees; reproject to one"


class NCore(Developed):
    """A sequence of NCore v4, for gsplat and 3DGRUT."""

    is_for_training: ClassVar[bool] = True
    has_row_times: ClassVar[bool] = True
    needs_surfaces: ClassVar[bool] = True

    points: _PointCount = Field(
        50000, description="Largest number of points, which are computed from depth."
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if isinstance(lens, Equidistant | Rectilinear):
            return None
        return "is not an equidistant fisheye or a pinhole; reproject to one of them"


class LichtFeld(Developed):
    """A dataset for LichtFeld Studio."""

    is_for_training: ClassVar[bool] = True
    chooses_tests: ClassVar[bool] = True
    needs_surfaces: ClassVar[bool] = True

    format: Literal["png", "exr"] = Field(
        "png", description="Format of the images. exr keeps linear light, for HDR training."
    )
    points: _PointCount = Field(50000, description="Largest number of points in the point cloud.")
    depth: bool = Field(False, description="Also write depth maps. The source must have depth.")
    normals: bool = Field(
        False, description="Also write normals. The source must have the pass normal."
    )

    @model_validator(mode="after")
    def _look_is_of_png(self) -> Self:
        if self.look and self.format == "exr":
            raise ValueError("look: is only for format png; an EXR keeps the light")
        return self

    @property
    def needed_passes(self) -> tuple[str, ...]:
        return ("normal",) if self.normals else ()

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if isinstance(lens, Equidistant | KannalaBrandt):
            if lens.fov >= math.pi:
                return f"{_angle(lens)}, but LichtFeld's ends below 180; give it a smaller fov"
            if isinstance(lens, KannalaBrandt) and lens.coefficients[3] != 0:
                return "has a fourth coefficient, which LichtFeld drops; reproject to equidistant"
        elif isinstance(lens, Equirectangular):
            if not lens.is_full:
                return f"is a part of a panorama; LichtFeld takes whole ones; {_TO_RECTILINEAR}"
            if self.depth:
                return "is a panorama, which has no depth along an axis; leave out depth: true"
        elif not isinstance(lens, Rectilinear):
            return f"has a lens that LichtFeld lacks; {_TO_RECTILINEAR}, equidistant or a panorama"
        if self.format == "exr" and not has_depth:
            return NOT_EXR
        return NO_DEPTH if self.depth and not has_depth else None


class Dnerf(Developed):
    """D-NeRF's layout of a sequence: NeRF's synthetic layout with a time for each picture."""

    is_for_training: ClassVar[bool] = True
    chooses_tests: ClassVar[bool] = True
    is_of_sequence: ClassVar[bool] = True
    needs_surfaces: ClassVar[bool] = True

    points: _PointCount = Field(
        50000, description="Largest number of points in the point cloud of the first frame."
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return _centred_pinhole(lens)


class Neural3dVideo(Developed):
    """The layout of Neural 3D Video: a video for each camera, and LLFF's poses_bounds.npy."""

    is_for_training: ClassVar[bool] = True
    is_of_sequence: ClassVar[bool] = True
    needs_surfaces: ClassVar[bool] = True

    points: _PointCount = Field(
        50000, description="Largest number of points in the point cloud of the first frame."
    )
    rate: float = Field(
        30,
        gt=0,
        le=1000,
        description="Frames per second of the videos.",
        json_schema_extra={"unit": "Hz"},
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if shutil.which("ffmpeg") is None:
            return "becomes a video, for which ffmpeg must be installed"
        return _centred_pinhole(lens) or _odd_size_refusal(lens)


class ColmapFrames(Colmap):
    """A COLMAP model for each frame of a sequence, for SpacetimeGaussians."""

    is_of_sequence: ClassVar[bool] = True

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        if not isinstance(lens, Rectilinear):
            return f"is not a pinhole, the only camera of SpacetimeGaussians; {_TO_RECTILINEAR}"
        return super().refusal(lens, has_depth)


class MultipleView(Developed):
    """The layout of 4DGaussians' own recordings: a folder of frames for each camera."""

    is_of_sequence: ClassVar[bool] = True
    needs_surfaces: ClassVar[bool] = True

    points: _PointCount = Field(
        50000, description="Largest number of points in the point cloud of the first frame."
    )

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return _centred_pinhole(lens)


class SceneFlow(Export):
    """How far each surface moves in the world from one frame to the next."""

    is_of_sequence: ClassVar[bool] = True

    @property
    def needed_passes(self) -> tuple[str, ...]:
        return ("motion",)

    def refusal(self, lens: Lens, has_depth: bool) -> str | None:
        return None if has_depth else NO_DEPTH

    def rig_refusal(self, rig: Rig) -> str | None:
        if rig.sequence and rig.sequence.step != 1:
            return "leaves out frames, but the pass motion leads to the next frame; give it step: 1"
        return super().rig_refusal(rig)


class Coco(Export):
    """COCO's list of the objects in each view, with their boxes."""

    @property
    def needed_passes(self) -> tuple[str, ...]:
        return ("object",)


class PosesCsv(Export):
    """A table of poses: name, position, rotation."""


class PointCloud(Developed):
    """A .ply of all surfaces that the views see."""

    needs_surfaces: ClassVar[bool] = True

    voxel: float = Field(
        0.01,
        gt=0,
        description="Side of a voxel. Each voxel keeps one point at most.",
        json_schema_extra={"unit": "m"},
    )


class Exports(Settings):
    """The exports, by format."""

    instant_ngp: InstantNgp | None = Field(None, description="transforms.json for instant-ngp.")
    colmap: Colmap | None = Field(
        None,
        description="COLMAP model for gsplat, 3DGRUT, Brush and the original 3D Gaussian "
        "splatting.",
    )
    nerfstudio: Nerfstudio | None = Field(None, description="Dataset for nerfstudio and Brush.")
    nerf_synthetic: NerfSynthetic | None = Field(
        None, description="Layout of NeRF's synthetic scenes, for programs that read it."
    )
    opendibr: OpenDibr | None = Field(None, description="Views for OpenDIBR.")
    miv: Miv | None = Field(
        None, description="Sequence for TMIV, the test model of MPEG immersive video."
    )
    hci: Hci | None = Field(
        None, description="Layout of the HCI 4D light field benchmark, for programs that read it."
    )
    scannetpp: ScanNetPP | None = Field(
        None, description="ScanNet++'s fisheye layout, for 3DGRUT and Fisheye-GS."
    )
    ncore: NCore | None = Field(
        None, description="NCore v4 for gsplat and 3DGRUT, also for fisheyes wider than 180°."
    )
    lichtfeld: LichtFeld | None = Field(None, description="Dataset for LichtFeld Studio.")
    coco: Coco | None = Field(
        None, description="Boxes of the objects in each view, for object detectors."
    )
    dnerf: Dnerf | None = Field(None, description="Sequence for D-NeRF and 4DGaussians.")
    neural_3d_video: Neural3dVideo | None = Field(
        None, description="Sequence in the layout of Neural 3D Video, for programs that read it."
    )
    colmap_frames: ColmapFrames | None = Field(
        None, description="Sequence for SpacetimeGaussians: a COLMAP model for each frame."
    )
    multipleview: MultipleView | None = Field(
        None, description="Sequence for 4DGaussians, in its layout MultipleView."
    )
    scene_flow: SceneFlow | None = Field(
        None, description="Motion of surfaces in the world, for each frame of a sequence."
    )
    poses_csv: PosesCsv | None = Field(None, description="Table of poses, for any program.")
    point_cloud: PointCloud | None = Field(
        None, description="Point cloud of all surfaces that the views see, for any program."
    )

    @property
    def selected(self) -> dict[str, Export]:
        """The exports that the scene YAML selects, by name."""
        return {name: export for name, export in self if export}


def _angle(lens: Equidistant | KannalaBrandt) -> str:
    return f"sees {math.degrees(lens.fov):g} degrees"


def _odd_size_refusal(lens: Lens) -> str | None:
    """Return why YUV 4:2:0, where 2 × 2 pixels share a colour, cannot hold an image. Or None."""
    if lens.width % 2 or lens.height % 2:
        return "has an odd width or height, which YUV 4:2:0 cannot have; use even sizes"
    return None


def _centred_pinhole(lens: Lens) -> str | None:
    """Return why a lens is not a pinhole with a centred axis and square pixels. None if it is."""
    if not isinstance(lens, Rectilinear):
        return f"is not a pinhole camera, the only one that this layout has; {_TO_RECTILINEAR}"
    if lens.center != (lens.width / 2, lens.height / 2) or not lens.has_square_pixels:
        return "has its axis off centre or oblong pixels, which this layout cannot describe"
    return None


Options = TypeVar("Options", bound=Export)


class ExportSettings(ReaderSettings, Generic[Options]):
    """The settings of one job, which exports the views of one source."""

    options: Options = Field(
        description="Keys of the export in the scene YAML, with exactly one source."
    )
    suffix: Literal[".png", ".exr"] = Field(".exr", description="Suffix of the source's images.")
    tested_by: dict[str, str] = Field(
        {},
        description="Datasets whose views are the test views of this export: their folders, by the "
        "names of their rigs.",
    )
    frames: list[str] | None = Field(
        None,
        min_length=2,
        description="Names of the folders of a sequence's frames, in the rig's folder.",
    )
    trained_by: str | None = Field(
        None,
        description="Path of the transforms.json of the training views, whose scale and offset "
        "these views get.",
    )
    spread_version: int | None = cause(
        "Version of the choice of test views, if the rig has no split."
    )
    look_source: str | None = cause(
        "Version of bpy and SHA-256 of its config.ocio, if there is a look."
    )

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if len(self.options.sources) != 1:
            raise ValueError("options.sources: must name one source")
        return self

    @property
    def source(self) -> str:
        """The source's folder within the dataset's folder. Empty for the rendered views."""
        (name,) = self.options.sources
        return "" if name == VIEWS else name


def export_settings_of(name: str) -> type[ExportSettings[Export]]:
    """Return the model of an exporter's settings file."""
    generic: Any = ExportSettings
    model: type[ExportSettings[Export]] = generic[settings_of(name)]
    return model


def settings_of(name: str) -> type[Export]:
    """Return the model of an exporter's options."""
    annotation = Exports.model_fields[name].annotation
    model: type[Export] = next(kind for kind in get_args(annotation) if kind is not type(None))
    return model


# The formats of scripts/export.py. instant-ngp has a program of its own.
EXPORTS = tuple(name for name in Exports.model_fields if name != "instant_ngp")

# The formats of exports that are made of a whole sequence.
SEQUENCE_EXPORTS = tuple(name for name in EXPORTS if settings_of(name).is_of_sequence)
