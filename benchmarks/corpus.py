"""Build a family of 200 models, broken ones among them, kill the build, and check what comes out.

The models come from benchmarks/models.py. The program kills the build some times, each time after a
part of the members, and then lets it finish. It prints a table, and the CPU seconds of each stage a
member.

The program fails if a model that can be rendered has failed, or if a broken one has not. It fails
if a kill lost more than the members at hand, or if a byte is not as the sums over the corpus say.
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from family_build import FamilyBuild
from lightfield.configuration.corpus import MEMBERS
from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import read_json, read_json_lines
from lightfield.core.progress import Progress
from lightfield.validation import verification

# Angle of view, distance and elevation are as in allenai/objaverse-rendering, and so are bounces,
# adaptive sampling and the denoiser.
SCENE = """
scene: {{unit: box}}
render:
  samples: {samples}
  adaptive_threshold: 0.01
  max_bounces: 1
  denoise: {denoise}
  denoise_prefilter: {prefilter}
  transparent: true
rigs:
  ring:
    type: ring
    count: {views}
    size: 3
    elevation: 30
    camera: {{lens: rectilinear, fov: 49.1, resolution: [{resolution}, {resolution}]}}
family:
  models: models/*.*
  corpus: {{shards: true, shard_gigabytes: 0.05}}
"""
RESULTS = Path("results/chairs")


def built(root: Path, models: Path, cores: int, scene: str) -> FamilyBuild:
    """Return a build of the family of some models."""
    build = FamilyBuild(root, {"chairs": scene}, cores)
    link = root / "models"
    if not link.exists():
        link.symlink_to(models.resolve(), target_is_directory=True)
    return build


def problems(build: FamilyBuild, expected: dict[str, Any], kills: int) -> list[str]:
    """Return what is wrong with a finished corpus."""
    content = read_json(build.root / RESULTS / "corpus.json")
    states = {Path(member["model"]).name: member["state"] for member in content["members"]}
    faults = [
        f"{name}: is {states.get(name, 'missing')}, but it is {entry['kind']}"
        for name, entry in expected.items()
        if states.get(name) != ("valid" if entry["renders"] else "failed")
    ]
    valid = {member["name"] for member in content["members"] if member["state"] == "valid"}
    # Failed members are tried again with their batch. They cost little.
    begun = build.begun()
    repeated = [name for (_, name), times in begun.items() if times > 1 and name in valid]
    if len(repeated) > kills * build.cores:
        faults.append(f"built more than once: {', '.join(repeated)}")
    found = verification.faults(build.root / RESULTS)
    return faults + [f"{path}: {problem}" for path, problem in found.items()]


def stage_seconds(build: FamilyBuild) -> dict[str, float]:
    """Return the mean CPU seconds of each stage of the valid members."""
    members = read_json_lines(build.root / RESULTS / MEMBERS)
    times = [member["stage_cpu_seconds"] for member in members if member["state"] == "valid"]
    stages = dict.fromkeys(stage for entry in times for stage in entry)
    return {stage: statistics.fmean(entry.get(stage, 0.0) for entry in times) for stage in stages}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("--output", type=Path, required=True, help="folder to build in; it is kept")
    add("--models", type=Path, help="folder of models.py (default: make them in --output)")
    add("--views", type=int, default=12, help="views of each model (default: 12)")
    add("--resolution", type=int, default=64, help="pixels of a view's side (default: 64)")
    add("--samples", type=int, default=4, help="samples of a pixel (default: 4)")
    add("--denoise", action="store_true", help="denoise the views")
    add("--prefilter", default="accurate", help="denoise_prefilter (default: accurate)")
    add("--kills", type=int, default=2, help="how often the build is killed (default: 2)")
    add("--cores", type=int, default=os.cpu_count() or 1, help="cores (default: all)")
    arguments = parser.parse_args()
    models = arguments.models or arguments.output / "made"
    if not (models / "models.json").is_file():
        program = Path(__file__).with_name("models.py")
        subprocess.run([sys.executable, program, "--output", models], check=True)
    expected = read_json(models / "models.json")
    scene = SCENE.format(
        samples=arguments.samples,
        views=arguments.views,
        resolution=arguments.resolution,
        denoise=json.dumps(arguments.denoise),
        prefilter=arguments.prefilter,
    )
    build = built(arguments.output, models, arguments.cores, scene)
    progress = Progress(arguments.kills + 1, "corpus", "runs")
    for number in range(1, arguments.kills + 1):
        build.kill_after(len(expected) * number // (arguments.kills + 1))
        progress.done()
    last_line = build.finish()[-1]
    progress.done()
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(last_line)
    print("| stage | CPU seconds a member |\n| --- | ---: |")
    for stage, seconds in stage_seconds(build).items():
        print(f"| {stage} | {seconds:.3f} |")
    print(f"\nall runs: {used.ru_utime + used.ru_stime:.0f} CPU seconds, with the killed ones")
    if wrong := problems(build, expected, arguments.kills):
        raise UserError("\n".join(wrong))
    print("all members are as expected, and every byte as the sums say")


if __name__ == "__main__":
    run(main)
