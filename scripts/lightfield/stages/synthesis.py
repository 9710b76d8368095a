"""The stage that synthesises views between a dataset's cameras."""

from pathlib import Path

from lightfield.engine.stage import PlainStage, option, reads, writes
from lightfield.imaging.blender_looks import LOOK_FLAG, LookName
from lightfield.settings.types import AtLeastOne, Stops

# A picture is made of this many views.
BEST = 6


class Synthesize(PlainStage):
    """Synthesises views from anywhere in a dataset."""

    name = "synthesize"
    function = "lightfield.synthesis.job:run"

    dataset: Path = reads("folder of a dataset with depth", positional=True)
    reprojection: str = option(
        "name of an EXR reprojection to use (default: the views as rendered)", ""
    )
    poses: Path | None = reads(
        "cameras to synthesise: a lightfield.json, or a YAML with a rig and its camera (default: "
        "the test views of the dataset's split, from its other views)",
        None,
    )
    best: AtLeastOne = option("views a picture is made of", BEST, metavar="K")
    exposure: Stops | None = option(
        "exposure of the PNGs, in stops (default: chosen from the first picture; 0 with --look)",
        None,
    )
    look: LookName = option(LOOK_FLAG, None)
    video: bool = option("also write the video walk.mp4, with ffmpeg", False)
    rate: AtLeastOne = option("pictures per second of the video", 25)
    output: Path = writes("folder to write", metavar="FOLDER")
