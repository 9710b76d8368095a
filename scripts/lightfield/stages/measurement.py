"""The stages that measure error, quality and time, and that estimate costs."""

import re
from pathlib import Path
from typing import Annotated, Generic, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from lightfield.configuration.config_file import Energy
from lightfield.core.names import INVENTORY, VIEWS
from lightfield.engine.stage import PlainStage, Stage, StageSettings, option, reads, writes
from lightfield.imaging import blender_looks
from lightfield.imaging.blender_looks import LookName
from lightfield.planning.sampling import PROBES, WINDOW_SIZE
from lightfield.settings.base import ReaderSettings, Settings
from lightfield.settings.types import REINHARD, AtLeastOne, Stops, White


class FullSize(Settings):
    """A dataset at full size. ``samples`` and ``denoise`` default to the small dataset's."""

    views: AtLeastOne = Field(
        description="Number of views of the rig.", json_schema_extra={"unit": "views"}
    )
    resolution: list[AtLeastOne] = Field(
        min_length=2,
        max_length=2,
        description="Width and height of a view.",
        json_schema_extra={"unit": "pixels"},
    )
    samples: AtLeastOne | Literal["file"] | None = Field(
        None, description="Number of paths for each pixel.", json_schema_extra={"unit": "paths"}
    )
    denoise: bool | None = Field(None, description="Whether views are denoised.")


class CostSettings(ReaderSettings):
    """The settings of scripts/costs.py: the key `energy` of config.yaml, and the full dataset."""

    energy: Energy = Field(description="The block `energy` of config.yaml.")
    full: FullSize = Field(
        description="Size of the dataset at full size, for which costs are estimated."
    )
    reprojections: list[str] = Field([], description="Names of the dataset's reprojections.")


class Costs(Stage[CostSettings]):
    """Adds up what a dataset has cost, and estimates what it costs at full size."""

    name = "costs"
    function = "lightfield.measurement.costs:write"
    reads_history = True

    dataset: Path = reads("folder of the dataset")
    receipts: Path = reads("folder of the receipts of its shards")
    benchmarks: Path = reads("folder of the benchmark files that Snakemake wrote for its jobs")
    scene_benchmarks: list[Path] = reads(
        "folders of the benchmark files that Snakemake wrote for the scene's jobs"
    )
    blend: Path | None = reads("the scene's .blend, if there is one", None)
    inventory: Path | None = reads(INVENTORY, None)
    # These are no inputs: a later probe does not make the page again.
    probe: Path | None = option(
        "JSON that scripts/probe.py wrote for the dataset at full size, if there is one", None
    )
    gpu_check: Path | None = option(
        "JSON that scripts/gpu_check.py wrote for the scene, if there is one", None
    )
    finished: list[tuple[Path, Path]] = option(
        "views of the rig that may be finished, also under other presets: their lightfield.json, "
        "and the folder of their shards' receipts",
        [],
        metavar=("LIGHTFIELD", "RECEIPTS"),
    )
    output: Path = writes("JSON to write")


class ProbeSettings(Settings):
    """The settings of scripts/probe.py."""

    views: AtLeastOne = Field(
        3, description="Number of views to render.", json_schema_extra={"unit": "views"}
    )
    size: AtLeastOne = Field(
        48,
        description="Longer side of these views, in pixels.",
        json_schema_extra={"unit": "pixels"},
    )


class Probe(Stage[ProbeSettings]):
    """Estimates the time and size of a dataset's views from a few small views."""

    name = "probe"
    function = "lightfield.rendering.views.probe:write"
    by_hand = ProbeSettings

    blend: Path = reads("the scene's .blend")
    inventory: Path = reads(INVENTORY)
    lightfield: Path = reads("lightfield.json of the dataset")
    device: str = option("device on which Cycles renders", "auto")
    output: Path = writes("JSON to write")


class Plan(PlainStage):
    """Tabulates the views, hours and gigabytes of the chosen datasets."""

    name = "plan"
    function = "lightfield.measurement.plan:write"

    dataset: list[tuple[str, AtLeastOne, Path]] = reads(
        "a dataset: scene/rig, its number of frames, and the JSON that scripts/probe.py wrote",
        [],
        metavar=("NAME", "FRAMES", "PROBE"),
    )
    advice: list[tuple[str, Path]] = reads(
        "advice for a dataset: scene/rig, and the JSON that scripts/error_vs_time.py wrote for its "
        "scene",
        [],
        metavar=("NAME", "JSON"),
    )
    calibration: list[tuple[str, Path, Path]] = reads(
        "calibration of a dataset with a target error: scene/rig, and the two JSON that "
        "scripts/calibrate.py wrote for its scene",
        [],
        metavar=("NAME", "JSON", "SECONDS"),
    )
    finished: list[tuple[str, Path, Path]] = option(
        "views of a dataset that may be finished, also under other presets: its name, their "
        "lightfield.json, and the folder of their shards' receipts",
        [],
        metavar=("NAME", "LIGHTFIELD", "RECEIPTS"),
    )
    family: list[str] = option("name of a family of scenes", [], metavar="NAME")
    watts: float = option("power of the machine when all its cores work", 65.0)
    cores: AtLeastOne | None = option("number of cores of that machine", None)
    output: Path = writes("Markdown file to write")


# The beginning of the line with the GPU that a run uses.
RENDERS_ON = "renders on "


class CheckDevice(PlainStage):
    """Checks that Cycles can render on a device of this machine."""

    name = "check_device"
    function = "lightfield.rendering.setup.cycles:check_device"

    device: Literal["auto", "cpu", "gpu", "optix", "cuda", "hip", "oneapi", "metal"] = option(
        "device to look for", positional=True
    )


class TrialStage(Stage[StageSettings], Generic[StageSettings]):
    """A stage that renders windows of a dataset's views."""

    blend: Path = reads("the scene's .blend")
    inventory: Path = reads(INVENTORY)
    lightfield: Path = reads("lightfield.json")
    device: str = option("device on which Cycles renders", "auto")
    threads: AtLeastOne = option("CPU threads", 1)
    cache: Path = writes(
        "folder that keeps finished renders, so that an interrupted run can continue"
    )


class CalibratedTrialStage(TrialStage[StageSettings], Generic[StageSettings]):
    """A stage that renders windows with the samples of a scene, or of its calibration."""

    calibration: Path | None = reads(
        "JSON that scripts/calibrate.py wrote, for a scene with target_error", None
    )


class _WindowSettings(Settings):
    size: AtLeastOne = Field(
        WINDOW_SIZE,
        description="Width and height of each rendered window, in pixels.",
        json_schema_extra={"unit": "pixels"},
    )


class CalibrationSettings(_WindowSettings):
    """The settings of scripts/calibrate.py."""

    probes: AtLeastOne = Field(
        PROBES,
        description="Number of windows of views to render. As many others are held out to check "
        "the choice.",
        json_schema_extra={"unit": "windows"},
    )


class Calibrate(TrialStage[CalibrationSettings]):
    """Chooses the cheapest method that reaches a scene's target error."""

    name = "calibrate"
    function = "lightfield.measurement.calibration:write"
    by_hand = CalibrationSettings

    lightfield: Path = reads("lightfield.json with render.target_error")
    output: Path = writes(
        "JSON to write: the chosen method, and the measurements behind the choice"
    )
    seconds: Path | None = writes("JSON to write: the seconds that each method took", None)


class ErrorVsTimeSettings(_WindowSettings):
    """The settings of scripts/error_vs_time.py."""

    probes: AtLeastOne = Field(
        1,
        description="Windows of each stratum of the views. The first is also rendered in a "
        "neighbouring view.",
        json_schema_extra={"unit": "windows"},
    )
    octaves: AtLeastOne = Field(8, description="How often to double the samples, starting from 1.")
    reference: AtLeastOne = Field(
        2048,
        description="Samples of the reference renders.",
        json_schema_extra={"unit": "paths"},
    )
    seeds: int = Field(
        2,
        ge=2,
        description="Renders of each method with different seeds, 2 or more. More of them separate "
        "bias from variance better.",
    )


class ErrorVsTime(CalibratedTrialStage[ErrorVsTimeSettings]):
    """Measures the error of renders against their time."""

    name = "error_vs_time"
    function = "lightfield.measurement.error_vs_time:make"
    version = 1
    by_hand = ErrorVsTimeSettings

    output: Path = writes("path without suffix of the .csv, .json, .md, .svg and .png to write")


class GpuCheckSettings(Settings):
    """The settings of scripts/gpu_check.py."""

    full: dict[str, FullSize] = Field(
        {},
        description="Sizes of the datasets at full size, whose hours are estimated, by their "
        "names.",
    )


class GpuCheck(CalibratedTrialStage[GpuCheckSettings]):
    """Checks that a GPU renders the same as the processor, and estimates full datasets' hours."""

    name = "gpu_check"
    function = "lightfield.measurement.gpu_check:make"

    settings: GpuCheckSettings = Field(default_factory=GpuCheckSettings)
    # These are no inputs: a later probe does not repeat the check.
    probe: list[tuple[str, Path]] = option(
        "probe of a dataset: its name, and the JSON that scripts/probe.py wrote, if there is one",
        [],
        metavar=("NAME", "JSON"),
    )
    finished: list[tuple[str, Path, Path]] = option(
        "views of a dataset that may be finished, also under other presets: its name, their "
        "lightfield.json, and the folder of their shards' receipts",
        [],
        metavar=("NAME", "LIGHTFIELD", "RECEIPTS"),
    )
    output: Path = writes("path without suffix of the .json and .md to write")


class SynthesisSettings(ReaderSettings):
    """The settings of scripts/synthesis_quality.py."""

    truth: list[str] = Field(
        [],
        description="Folders of the datasets with which synthesised views are compared. Without "
        "this key, they are compared with the dataset's own test views.",
    )
    views: AtLeastOne = Field(
        12,
        description="How many views of each of these datasets are compared.",
        json_schema_extra={"unit": "views"},
    )


class SynthesisQuality(Stage[SynthesisSettings]):
    """Measures how well held-out views are synthesised from a dataset."""

    name = "synthesis_quality"
    function = "lightfield.measurement.synthesis_quality:measure"
    by_hand = SynthesisSettings

    dataset: Path = reads("folder of a dataset with depth", positional=True)
    output: Path = writes("path without suffix of the files to write", metavar="STEM")


NAMED_COLOURS = {"black": "000000", "white": "ffffff"}


def _colour(text: str) -> str:
    """Return a colour as six hexadecimal digits."""
    code = NAMED_COLOURS.get(text, text.removeprefix("#"))
    if not re.fullmatch("[0-9a-fA-F]{6}", code):
        raise ValueError("must be black, white or rrggbb, two hexadecimal digits for each channel")
    return code


class EvaluationSettings(Settings):
    """The settings of scripts/evaluate.py."""

    source: str = Field(
        VIEWS, description=f"Name of a reprojection. {VIEWS}: the views as rendered."
    )
    suffix: Literal[".png", ".exr"] = Field(".exr", description="Suffix of the dataset's views.")
    exposure: Stops = Field(
        0.0,
        description="Exposure of EXR views in stops, as in the export.",
        json_schema_extra={"unit": "stops"},
    )
    reinhard: White = Field(
        1.0,
        description=f"Tone mapping of EXR views, as in the export: the {REINHARD}",
        json_schema_extra={"unit": "light"},
    )
    look: LookName = None
    background: Annotated[str, AfterValidator(_colour)] = Field(
        "black",
        validate_default=True,
        description="Colour behind transparent pixels: black, white or rrggbb.",
        json_schema_extra={"metavar": "COLOUR"},
    )

    @model_validator(mode="after")
    def _one_tone_curve(self) -> Self:
        blender_looks.check_beside(self.look, self.reinhard)
        return self


class Evaluate(Stage[EvaluationSettings]):
    """Compares renders of a dataset's test views with the truth."""

    name = "evaluate"
    function = "lightfield.report.evaluation_page:evaluate"
    by_hand = EvaluationSettings

    renders: Path = reads(
        "folder of the renders to evaluate, or PLY of a Gaussian splat",
        positional=True,
        metavar="RENDERS",
    )
    dataset: Path = reads("the dataset's folder")
    masks: Path | None = reads(
        "folder of masks, <view>.png; pixels that are 0 in them are not compared", None
    )
    lpips_weights: Path | None = reads(
        "NPZ with the state dict of LPIPS, of the network alex or vgg, to also compute LPIPS", None
    )
    output: Path = writes("folder to write")


_Positive = Annotated[float, Field(gt=0)]
# The keys that only one protocol reads.
_KEYS_OF_PROTOCOLS = {
    "spacing": "dtu",
    "most_distance": "dtu",
    "points": "nerf_synthetic",
    "tau": "tanks_and_temples",
}


class SurfaceSettings(Settings):
    """The settings of scripts/evaluate_surface.py."""

    protocol: Literal["dtu", "nerf_synthetic", "tanks_and_temples"] = Field(
        description="Benchmark whose definition of the metrics is used."
    )
    spacing: _Positive | None = Field(
        None,
        description="For dtu: distance between sampled points, in metres (default: 0.0002).",
        json_schema_extra={"unit": "m"},
    )
    most_distance: _Positive | None = Field(
        None,
        description="For dtu: distance in metres beyond which a point is ignored (default: 0.02).",
        json_schema_extra={"unit": "m"},
    )
    points: AtLeastOne | None = Field(
        None,
        description="For nerf_synthetic: number of points sampled on each surface (default: "
        "2500000).",
        json_schema_extra={"unit": "points"},
    )
    tau: _Positive | None = Field(
        None,
        description="For tanks_and_temples: distance in metres below which a point counts as "
        "correct.",
        json_schema_extra={"unit": "m"},
    )

    @model_validator(mode="after")
    def _keys_of_the_protocol(self) -> Self:
        for name, protocol in _KEYS_OF_PROTOCOLS.items():
            if getattr(self, name) is not None and protocol != self.protocol:
                raise ValueError(f"{name}: is only for --protocol {protocol}")
        if self.protocol == "tanks_and_temples" and self.tau is None:
            raise ValueError("tau: is missing; the benchmark has 0.003 to 0.025 m, by the scene")
        return self


class EvaluateSurface(Stage[SurfaceSettings]):
    """Compares a reconstructed surface with the true one, by the metrics of a benchmark."""

    name = "evaluate_surface"
    function = "lightfield.measurement.surface_accuracy:evaluate"
    by_hand = SurfaceSettings

    candidate: Path = reads("the reconstructed surface", positional=True, metavar="SURFACE")
    reference: Path = reads("the true surface")
    output: Path | None = writes("JSON to write", None)


class CalibrationFileSettings(Settings):
    """The settings of scripts/evaluate_calibration.py."""

    camera: str | None = Field(
        None, description="Name or number of the camera, for a file with several."
    )
    model: Literal["brown_conrady", "kannala_brandt"] | None = Field(
        None,
        description="Lens of four coefficients in OpenCV's file, which do not say it: the usual "
        "lens (brown_conrady), or the fisheye (kannala_brandt).",
    )


class EvaluateCalibration(Stage[CalibrationFileSettings]):
    """Compares a camera's calibration with the true lens."""

    name = "evaluate_calibration"
    function = "lightfield.measurement.calibration_error:evaluate"
    by_hand = CalibrationFileSettings

    lightfield: Path = reads(
        "lightfield.json of the dataset, or of a reprojection",
        positional=True,
        metavar="LIGHTFIELD",
    )
    calibration: Path = reads("file that the calibration's program wrote")
    output: Path | None = writes("folder to write figures and a map of the error to", None)
