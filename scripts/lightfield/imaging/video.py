"""Writes pictures as a video, with ffmpeg."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lightfield.imaging.ffmpeg import encoding
from lightfield.imaging.pictures import Array

# H.264 codes 2 × 2 pixels at once.
_EVEN = "pad=ceil(iw/2)*2:ceil(ih/2)*2"
# The matrix from R, G, B. Programs that ignore what the file says, as OpenCV does, expect BT.601's.
_MATRIX = "scale=out_color_matrix=smpte170m:out_range=limited,format=yuv420p"
# The tags that name the matrix in the file. Without them, players use BT.709's for a large picture.
_TAGS = "setparams=colorspace=smpte170m:range=limited:color_primaries=bt709:color_trc=iec61966-2-1"


@contextmanager
def video(
    path: Path,
    size: tuple[int, int],
    rate: float,
    rate_factor: int = 18,
    is_reproducible: bool = False,
) -> Iterator[Callable[[Array], None]]:
    """Yield a function that appends a picture to an MP4 (H.264) of ``size`` (w, h).

    Pictures are sRGB, (h, w, 3) uint8. ``rate_factor`` is H.264's constant rate factor: a smaller
    one loses less. The bytes depend on the number of processors, unless ``is_reproducible``. The
    file appears when the block ends without an error. Raises `UserError` if ffmpeg is missing, or
    cannot write the file.
    """
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", str(rate)]
    options = ["-vf", f"{_EVEN},{_MATRIX},{_TAGS}", "-c:v", "libx264", "-crf", str(rate_factor)]
    if is_reproducible:
        options += ["-threads", "1", "-bitexact"]
    with encoding(path, [*raw, "-i", "-", *options, "-f", "mp4"]) as add:
        yield lambda picture: add(picture.tobytes())
