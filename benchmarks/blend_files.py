"""Render other people's .blends, and count how many views equal Blender's own picture.

Each .blend below the folders is rendered twice from its own camera, in a process of its own:

- by Plenoforge: an inventory, then one view of a rig of type `blend_camera` with `lens: file`;
- by Blender alone: the file is opened and rendered. Only what the view's settings say is set:
  Cycles, samples, seed, resolution, and no denoising.

If the pictures differ, Blender renders once more, with the settings that the dataset's note calls
ignored at the values that the note gives. The program prints a line a file, and how many views

- equal Blender's picture;
- equal it, but have a single colour, which shows little;
- are noted: they equal the second picture, so the note explains the difference;
- are refused;
- stop: Blender crashes, or takes too long;
- are wrong: no note explains the difference. The program fails if there are any.

Files without a camera are counted, but not rendered. Scripts are not run.
"""

import argparse
import contextlib
import io
import multiprocessing
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from multiprocessing.connection import Connection
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import write_json

# isort: split
import numpy as np

from model_files import files_below

Array = np.ndarray[Any, Any]

VERDICTS = ("equal", "one colour", "noted", "refused", "stopped", "wrong", "no camera")
SIDE = 48  # pixels
SAMPLES = 4
# The name of the view of the .blend's own camera at its own frame decides on the view's seed.
SEED = 0
# Views have half floats. Other last digits of a ray change the noise of some pixels.
TOLERANCE = 2e-3
MOST_DIFFERENT_PIXELS = 0.002
# The clip planes of the views' cameras, in metres. Paths begin at the near plane.
CLIP = (1e-4, 1e9)
# The near plane of a new camera in Blender, in metres.
BLENDERS_NEAR = 0.1


class Outcome(NamedTuple):
    """What became of a .blend: one of `VERDICTS`, and why.

    ``ratio`` divides the view's mean light by Blender's. ``largest`` is the largest difference of
    a pixel. ``differing`` is the share of pixels that differ. All are None without two pictures.
    """

    verdict: str
    reason: str = ""
    ratio: float | None = None
    largest: float | None = None
    differing: float | None = None

    def __str__(self) -> str:
        figures = (
            ""
            if self.differing is None
            else f"light × {self.ratio:.4f}, largest difference {self.largest:.3g}, "
            f"{self.differing:.2%} of the pixels differ"
        )
        return ": ".join(part for part in (self.verdict, figures, self.reason) if part)


def _clip(scene: Any) -> None:
    camera = scene.camera.data
    camera.clip_start, camera.clip_end = CLIP


def _hold(camera: Any) -> None:
    """Keep a camera where it is."""
    here = camera.matrix_world.copy()
    camera.animation_data_clear()
    camera.constraints.clear()
    camera.parent = None
    camera.matrix_world = here


def _square(render: Any) -> None:
    render.pixel_aspect_x = render.pixel_aspect_y = 1


def _cull_nothing(cycles: Any) -> None:
    cycles.use_camera_cull = cycles.use_distance_cull = False


def _use_layers(scene: Any, part: str) -> None:
    """Use the view layers that a part of a note names, as in ``view layer Main of 2``."""
    names = part.split(" of ")[0].removeprefix("view layers ").removeprefix("view layer ")
    for layer in scene.view_layers:
        layer.use = layer.name in names.split(" and ")


# The property and the value that follow from a part of a note that begins so.
VALUES: dict[str, tuple[str, Any]] = {
    "compositor ignored": ("render.use_compositing", False),
    "sequencer ignored": ("render.use_sequencer", False),
    "adaptive sampling off": ("cycles.use_adaptive_sampling", False),
    "depth of field off": ("camera.data.dof.use_dof", False),
    "shutter position": ("render.motion_blur_position", "CENTER"),
    "rolling shutter ignored": ("cycles.rolling_shutter_type", "NONE"),
    "film transparent on, ignored": ("render.film_transparent", False),
    "render border ignored": ("render.use_border", False),
    "stereoscopy ignored": ("render.use_multiview", False),
    "Freestyle lines ignored": ("render.use_freestyle", False),
}
# For what is more than one property, a function of the scene and the part.
FUNCTIONS: dict[str, Callable[[Any, str], None]] = {
    "view layer": _use_layers,
    "clip planes": lambda scene, _: _clip(scene),
    "movement of the camera": lambda scene, _: _hold(scene.camera),
    "pixel aspect": lambda scene, _: _square(scene.render),
    "culling ignored": lambda scene, _: _cull_nothing(scene.cycles),
}


def _apply(part: str, scene: Any) -> None:
    """Change the open file as a part of a note says, if it says that a setting is ignored."""
    for beginning, (name, value) in VALUES.items():
        if part.startswith(beginning):
            owner, _, attribute = name.rpartition(".")
            setattr(attrgetter(owner)(scene), attribute, value)
    for beginning, change in FUNCTIONS.items():
        if part.startswith(beginning):
            change(scene, part)


def of_plenoforge(path: Path, folder: Path) -> tuple[Array, list[str], str]:
    """Return the view (height, width, 3) of a .blend's camera, the parts of its note, and its name.

    Raises `UserError` if the file is refused.
    """
    from lightfield.configuration.config_file import Preset
    from lightfield.configuration.scene_yaml import Scene
    from lightfield.core.files import sha256
    from lightfield.imaging import images
    from lightfield.planning.loading import datasets_of
    from lightfield.rendering.inspection import inventory_file
    from lightfield.rendering.views import lightfield_file
    from lightfield.stages.views import RenderShard
    from lightfield.workflow import job_settings

    camera = {"lens": "file", "resolution": [SIDE, SIDE]}
    scene = Scene.model_validate(
        {
            "scene": {
                "blend": str(path),
                "url": "https://example.org/a.blend",
                "sha256": sha256(path),
                "frame": "file",
                # Blender, too, renders what is missing in magenta.
                "allow_missing": True,
            },
            "render": {"samples": SAMPLES, "seed": SEED},
            "rigs": {"views": {"type": "blend_camera", "camera": camera}},
        }
    )
    (dataset,) = datasets_of("tried", scene, "full", Preset(), {})
    inventory = folder / "inventory.json"
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(io.StringIO()):
        settings = job_settings.inventory(dataset)
        inventory_file.write(path, settings, [dataset], inventory, False)
        views = lightfield_file.from_settings(job_settings.lightfield(dataset), inventory)
        lightfield = folder / "lightfield.json"
        views.write(lightfield)
        RenderShard(
            blend=path,
            lightfield=lightfield,
            inventory=inventory,
            output=folder / "exr",
            device="cpu",
            threads=1,
        ).run()
    note = next(line for line in said.getvalue().splitlines() if line.startswith("note: "))
    name = views.views[0].name
    image = images.read_image(folder / "exr" / f"{name}.exr", "RGB")
    parts = note.removeprefix(f"note: {path}: ").split(" · ")
    return _pixels(image), parts, name


def of_blender(path: Path, folder: Path, seed: int, note: list[str]) -> Array:
    """Return the picture (height, width, 3) that Blender alone makes of a .blend.

    ``note`` has the parts of a note. The settings that it calls ignored get the note's values.
    """
    import bpy

    from lightfield.imaging import images
    from lightfield.rendering.scenes.quiet import quiet

    with quiet():
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
        scene = bpy.context.scene
        _set_up(scene, seed)
        camera = scene.camera.data
        # A last digit of a path's beginning changes the noise.
        if camera.clip_start <= BLENDERS_NEAR:
            camera.clip_start = CLIP[0]
        for part in note:
            _apply(part, scene)
        scene.render.filepath = str(folder / "of_blender.exr")
        bpy.ops.render.render(write_still=True)
    file = max(folder.glob("of_blender*.exr"), key=lambda file: file.stat().st_mtime_ns)
    return _pixels(images.read_image(file, "RGB"))


def _set_up(scene: Any, seed: int) -> None:
    """Give a scene the settings that both pictures share. All else stays as in the file."""
    render = scene.render
    render.engine = "CYCLES"
    render.threads_mode, render.threads = "FIXED", 1
    render.resolution_x = render.resolution_y = SIDE
    render.resolution_percentage = 100
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = SAMPLES
    cycles.use_layer_samples = "IGNORE"
    cycles.time_limit = 0
    cycles.seed = seed
    cycles.use_animated_seed = False
    cycles.use_denoising = False
    output = render.image_settings
    output.media_type = "IMAGE"
    output.file_format = "OPEN_EXR"
    output.color_mode = "RGB"
    output.color_depth = "32"


def _pixels(image: Any) -> Array:
    return np.stack([image.channels[name] for name in "RGB"], axis=-1).astype(float)


def differing(view: Array, picture: Array) -> float:
    """Return the share of pixels that differ by more than half floats do."""
    if view.shape != picture.shape:
        return 1.0
    is_close = np.isclose(view, picture, rtol=TOLERANCE, atol=TOLERANCE, equal_nan=True)
    return float(1 - is_close.all(axis=-1).mean())


def compared(verdict: str, view: Array, picture: Array, note: str = "") -> Outcome:
    """Return an outcome with the figures of two pictures."""
    share = differing(view, picture)
    if view.shape != picture.shape:
        return Outcome(verdict, f"Blender's picture has the shape {picture.shape}; {note}")
    mean = picture.mean()
    ratio = float(view.mean() / mean) if mean else float("nan")
    return Outcome(verdict, note, ratio, float(np.abs(view - picture).max()), share)


def outcome(path: Path) -> Outcome:
    """Render a .blend both ways, and compare the pictures."""
    from lightfield.configuration.keys import view_seed

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            view, note, view_name = of_plenoforge(path, folder)
        except UserError as error:
            has_no_camera = "has no camera" in str(error)
            return Outcome("no camera" if has_no_camera else "refused", str(error))
        seed = view_seed(SEED, view_name)
        picture = of_blender(path, folder, seed, [])
        if differing(view, picture) <= MOST_DIFFERENT_PIXELS:
            is_plain = np.ptp(picture, axis=(0, 1)).max() <= TOLERANCE
            return compared("one colour" if is_plain else "equal", view, picture)
        explained = of_blender(path, folder, seed, note)
        is_explained = differing(view, explained) <= MOST_DIFFERENT_PIXELS
        return compared(
            "noted" if is_explained else "wrong",
            view,
            picture if is_explained else explained,
            " · ".join(note),
        )


def _send_outcome(path: Path, connection: Connection) -> None:
    try:
        connection.send(outcome(path))
    except Exception as error:
        # Whatever is no `UserError` would be a traceback in front of the user.
        connection.send(Outcome("wrong", f"{type(error).__name__}: {error}"))


def outcome_of_process(path: Path, seconds: float) -> Outcome:
    """Return the outcome of a .blend, from a fork that may crash and has some seconds."""
    # Blender does not survive a fork, so only the fork imports it.
    fork = multiprocessing.get_context("fork")
    receiver, sender = fork.Pipe(duplex=False)
    process = fork.Process(target=_send_outcome, args=(path, sender))
    process.start()
    sender.close()
    try:
        if receiver.poll(seconds):
            return receiver.recv()
        return Outcome("stopped", f"took more than {seconds:g} s")
    except EOFError:
        return Outcome("stopped", "Blender crashed")
    finally:
        process.kill()
        process.join()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--seconds", type=float, default=30, help="for a file (default: 30)")
    parser.add_argument("--list", type=Path, help="JSON to write: what became of each file")
    options = parser.parse_args()
    results: dict[Path, dict[Path, Outcome]] = {}
    for path, folder in files_below(options.folders, [".blend"]):
        result = outcome_of_process(path, options.seconds)
        results.setdefault(folder, {})[path] = result
        print(f"{path}: {result}", flush=True)
    if options.list:
        every = {path: result for own in results.values() for path, result in own.items()}
        write_json(options.list, {str(path): result._asdict() for path, result in every.items()})
    print(f"| set | files | {' | '.join(VERDICTS)} |")
    for folder, own in results.items():
        counts = Counter(result.verdict for result in own.values())
        numbers = " | ".join(str(counts[verdict]) for verdict in VERDICTS)
        print(f"| {folder.name} | {len(own)} | {numbers} |")
    wrong = sum(result.verdict == "wrong" for own in results.values() for result in own.values())
    if wrong:
        raise UserError(f"{wrong} .blends are shown wrongly")


if __name__ == "__main__":
    run(main)
