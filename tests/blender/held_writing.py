"""Runs render_shard.py with another writer of images. The first argument is its kind.

- "waits": the first view is written once the second is being rendered. Else it fails.
- "fails": the second view cannot be written.
"""

import runpy
import sys
from pathlib import Path
from threading import Event

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))

from lightfield.imaging import images
from lightfield.rendering.views import colour_pass

KIND = sys.argv.pop(1)
render_colour = colour_pass.render_colour
write_exr = images.write_exr
rendered = []
written = []
second_renders = Event()


def counted_render(*arguments):
    rendered.append(arguments)
    if len(rendered) == 2:
        second_renders.set()
    return render_colour(*arguments)


def held_write(path, *arguments):
    written.append(path)
    if KIND == "waits" and len(written) == 1:
        assert second_renders.wait(timeout=60)
    if KIND == "fails" and len(written) == 2:
        raise OSError(f"{path}: no space")
    write_exr(path, *arguments)


colour_pass.render_colour = counted_render
images.write_exr = held_write
sys.argv[0] = "render_shard.py"
runpy.run_path(str(Path(__file__).parents[2] / "scripts" / sys.argv[0]), run_name="__main__")
