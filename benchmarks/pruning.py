"""Measure what each pruning of a scene saves, at equal pixels.

Each scene is measured as its builder makes it, and as artists leave theirs. The latter has a hidden
dense object, motion blur, and passes that nobody reads. Every pruning that applies is measured
alone and with the others, and so are prunings that the workflow rejected. Each measurement is a
process of its own with one thread. Times are CPU seconds. The compared processes take turns and
render the same view one right after the other, so that other work on the machine slows both. A
saving is the median of these pairs' differences.

Writes pruning.csv and pruning.md to the output folder.
"""

import argparse
import hashlib
import math
import resource
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.cli import run
from lightfield.core.files import write_csv, write_text
from lightfield.dataset import scene_yaml
from lightfield.dataset.lightfield import LightField
from lightfield.geometry import lenses

# Prunings that the workflow rejected: a pruning must save something and keep every pixel.
NOT_KEPT = {
    "volume_bounces": ("volumes", "no bounces in volumes, where there are none"),
    "transmission_bounces": ("transmission", "no bounces through glass, where there is none"),
    "transparent_bounces": ("transparency", "no bounces through transparency, where there is none"),
    "light_tree": ("", "no tree of lights"),
}
# Prunings of every scene, whatever it contains.
ALWAYS = {
    "passes": "passes that the artist had on are not made",
    "depth": "no depth, where the scene YAML says none",
}


VIEWS = 6
# Another one than that at which the scenes are saved.
FRAME = 5


@dataclass(frozen=True)
class Task:
    """One process: a scene, what is left out of it, and what is on although nobody needs it."""

    blend: Path
    left_out: tuple[str, ...] = ()
    hidden: tuple[str, ...] = ()
    passes: bool = False
    depth: bool = True
    tweak: str = ""


@dataclass
class Figures:
    """What the processes of a task took: CPU seconds, MiB, and bytes of a view's EXR.

    ``start_ups`` has one entry a process: the time before its second view. ``views`` has one entry
    for each later view.
    """

    start_ups: list[float] = field(default_factory=list)
    views: list[float] = field(default_factory=list)
    peak: float = math.inf
    bytes: float = 0.0
    pixels: str = ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output-dir", required=True, type=Path, help="folder of the tables")
    parser.add_argument("--scenes", nargs="+", default=["garden", "lone_monk", "barbershop"])
    parser.add_argument("--detail", type=float, default=1.0, help="of the scenes (default: 1)")
    parser.add_argument("--repeats", type=int, default=3, help="of each measurement (default: 3)")
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for scene in arguments.scenes:
            for variant in ("as built", "as artists leave it"):
                blend = Path(folder, f"{scene} {variant}.blend")
                task = (scene, variant, arguments.detail, blend)
                scene_inventory, reasons = in_process(make_scene, task)
                for row in measured(blend, scene_inventory, reasons, arguments.repeats):
                    rows.append({"scene": scene, "variant": variant, **row})
                    print(rows[-1], flush=True)
    write(arguments.output_dir, rows)


def in_process(function: Any, argument: Any) -> Any:
    """Run a function in a fresh process, so that bpy starts anew and memory is its own.

    This process must not import bpy: bpy would then not find its modules in the new process.
    """
    with get_context("spawn").Pool(1) as pool:
        return pool.apply(function, (argument,))


def make_scene(task: tuple[str, str, float, Path]) -> tuple[dict[str, Any], dict[str, str]]:
    """Build and save a scene; return its inventory, and the reason for each of its prunings."""
    scene, variant, detail, path = task
    import importlib

    import bpy

    from lightfield.rendering import blend_file, inventory, pruning

    source = scene_yaml.load_scene(scene).scene
    blend_file.new_scene()
    builder = importlib.import_module(f"scenes.{source.builder}")
    builder.build({**source.parameters.model_dump(), "detail": detail})
    if variant == "as artists leave it":
        bpy.context.scene.render.use_motion_blur = True
        bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=9, location=(0, 0, -50))
        bpy.context.object.hide_render = True
    blend_file.save_scene(path)
    blend_file.open_scene(path)
    contents = inventory.inventory([FRAME])
    return contents, {name: pruning.REASONS[name] for name in pruning.left_out(contents)}


def measured(
    blend: Path, contents: dict[str, Any], reasons: dict[str, str], repeats: int
) -> Iterator[dict[str, Any]]:
    """Yield a row for each pruning of a scene, alone, and for all together.

    ``contents`` is the scene's inventory, ``reasons`` has the prunings that apply.
    """
    artists = blend.stem.endswith("as artists leave it")
    original = Task(blend, hidden=tuple(contents["hidden"]), passes=artists)
    pruned = replace(original, left_out=tuple(reasons), passes=False)
    # The pruning, its reason, the task without it and the task with it.
    compared = [("nothing", "the scene as it is", original, original)]
    for name, reason in reasons.items():
        compared.append((name, reason, original, replace(original, left_out=(name,))))
    if artists:
        compared.append(("passes", ALWAYS["passes"], original, replace(original, passes=False)))
    compared.append(("all of these", "what the workflow does", original, pruned))
    compared.append(("depth", ALWAYS["depth"], pruned, replace(pruned, depth=False)))
    if not artists:
        for name, (feature, reason) in NOT_KEPT.items():
            if not contents.get(feature):
                without = replace(pruned, tweak=name)
                compared.append((f"({name})", f"not kept: {reason}", pruned, without))
    figures = all_figures([without for *_, without in compared], repeats)
    for name, reason, base, without in compared:
        yield row(name, reason, figures[base], figures[without])


def row(name: str, reason: str, base: Figures, without: Figures) -> dict[str, Any]:
    return {
        "left_out": name,
        "reason": reason,
        "start_up_seconds": round(statistics.median(without.start_ups), 3),
        "start_up_saved": round(saved(base.start_ups, without.start_ups), 3),
        "view_seconds": round(statistics.median(without.views), 4),
        "view_saved": round(saved(base.views, without.views), 4),
        "peak_mib": round(without.peak, 1),
        "peak_saved": round(base.peak - without.peak, 1),
        "view_bytes": round(without.bytes),
        "bytes_saved": round(base.bytes - without.bytes),
        "same_pixels": base.pixels == without.pixels,
    }


def saved(base: Sequence[float], without: Sequence[float]) -> float:
    """Return the median difference of times that were taken one right after the other."""
    return statistics.median(a - b for a, b in zip(base, without, strict=True))


def all_figures(tasks: Sequence[Task], repeats: int) -> dict[Task, Figures]:
    """Measure tasks side by side, each ``repeats`` times in a process of its own."""
    figures = {task: Figures() for task in tasks}
    for _ in range(repeats):
        with ExitStack() as stack:
            pools = {task: stack.enter_context(get_context("spawn").Pool(1)) for task in figures}
            for task, pool in pools.items():
                figures[task].start_ups.append(pool.apply(begin, (task,)))
            for number in range(1, VIEWS):
                for task, pool in pools.items():
                    figures[task].views.append(pool.apply(render, (number,)))
            for task, pool in pools.items():
                task_figures = figures[task]
                peak, task_figures.bytes, task_figures.pixels = pool.apply(finish)
                task_figures.peak = min(task_figures.peak, peak)
    return figures


class Renderer:
    """A scene set up in this process as its task says, with the sizes and digest of its views."""

    def __init__(self, task: Task) -> None:
        import bpy

        from lightfield.rendering import cycles

        lens = lenses.from_camera({"lens": "equidistant", "fov": 180, "resolution": [96, 96]})
        rig = {"type": "lattice", "cameras": [VIEWS, 1, 1], "size": 0.3, "center": [0, 0, 1.1]}
        settings = {"samples": 4, "adaptive_threshold": 0, "denoise": False}
        depth = "z" if task.depth else None
        lightfield = LightField.from_rig(rig, lens, depth=depth, frame=FRAME, render=settings)
        self.depth = task.depth
        self.poses = lightfield.matrices
        self.digest = hashlib.sha256()
        self.sizes: list[int] = []
        inventory = {"left_out": task.left_out, "hidden": task.hidden}
        cycles.set_up(task.blend, inventory, lightfield, "cpu", 1)
        scene = bpy.context.scene
        if task.passes:
            layer = scene.view_layers[0]
            for name in ("normal", "diffuse_color", "glossy_direct", "cryptomatte_object", "mist"):
                setattr(layer, f"use_pass_{name}", True)
        if task.tweak == "light_tree":
            scene.cycles.use_light_tree = False
        elif task.tweak == "transparent_bounces":
            scene.cycles.transparent_max_bounces = 0
        elif task.tweak:
            setattr(scene.cycles, task.tweak, 0)

    def render(self, number: int) -> float:
        """Render a view; return the CPU seconds that it took."""
        import numpy as np

        from lightfield.imaging import images
        from lightfield.rendering.colour_pass import render_colour
        from lightfield.rendering.geometry_pass import render_geometry

        began = time.process_time()
        pose = np.array(self.poses[number])
        depth = render_geometry(pose).depth if self.depth else None
        colour = render_colour(pose, 1).pixels
        seconds = time.process_time() - began
        self.digest.update(colour.tobytes())
        channels = {c: colour[:, :, i].astype(np.float16) for i, c in enumerate("RGB")}
        if depth is not None:
            channels["Z"] = depth
        with tempfile.TemporaryDirectory() as folder:
            images.write_exr(Path(folder, "view.exr"), channels)
            self.sizes.append(Path(folder, "view.exr").stat().st_size)
        return seconds


renderer: Renderer


def begin(task: Task) -> float:
    """Set this process up and render its first view; return the CPU seconds that it took."""
    global renderer
    from lightfield.rendering import inventory  # noqa: F401  (imports what the renderer does, before the clock starts)

    began = time.process_time()
    renderer = Renderer(task)
    return time.process_time() - began + renderer.render(0)


def render(number: int) -> float:
    return renderer.render(number)


def finish() -> tuple[float, float, str]:
    """Return peak memory in MiB, the mean size of a view's file, and the digest of all pixels."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return peak, statistics.mean(renderer.sizes), renderer.digest.hexdigest()


def write(folder: Path, rows: Sequence[dict[str, Any]]) -> None:
    write_csv(folder / "pruning.csv", rows)
    lines = [
        "# What pruning saves",
        "",
        "CPU seconds of one thread, MiB of peak memory, and KiB of a view's EXR, at 96² and 4 "
        "samples a pixel. In brackets: what is saved against the scene as it is. For depth and for "
        "what is not kept, it is what is saved against all prunings. A saved time is the median of "
        "pairs that were measured one right after the other. Start-up is everything before the "
        "second view.",
        "",
        "| scene | left out | start-up | a view | peak memory | a view's file | same pixels |",
        "| --- | --- | ---: | ---: | ---: | ---: | --- |",
    ]
    for row in rows:
        lines.append(
            f"| {row['scene']}, {row['variant']} | {row['left_out']}: {row['reason']} "
            f"| {row['start_up_seconds']:.2f} s ({row['start_up_saved']:+.2f}) "
            f"| {row['view_seconds']:.3f} s ({row['view_saved']:+.3f}) "
            f"| {row['peak_mib']:.0f} MiB ({row['peak_saved']:+.0f}) "
            f"| {row['view_bytes'] / 1024:.0f} KiB ({row['bytes_saved'] / 1024:+.0f}) "
            f"| {'yes' if row['same_pixels'] else 'no'} |"
        )
    write_text(folder / "pruning.md", "\n".join([*lines, ""]))


if __name__ == "__main__":
    run(main)
