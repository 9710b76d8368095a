"""Build many seeds of each family of configs/scenes, kill the build, and check what comes out.

The families have small views and little detail here. The build is killed some times, each time
after a part of the members, and then finishes. A second build of some members in another folder is
not disturbed. Prints a table, and what `snakemake status` says after each kill.

The program fails if a member has failed, or if it differs between the builds. It fails if a kill
lost more than the members at hand, or if a byte is not as the sums over a corpus say.
"""

import argparse
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from family_build import FamilyBuild
from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import read_json
from lightfield.core.progress import Progress
from lightfield.dataset.names import ROOT
from lightfield.validation.corpus_integrity import corpus_faults

NAMES = ("garden", "lone_monk", "barbershop", "rooms", "object")
# The cameras of the rigs that these families have, by the type of rig.
FOUR_VIEWS: dict[str, dict[str, Any]] = {
    "lattice": {"cameras": [2, 2, 1]},
    "hemisphere": {"count": 4},
}


def scene(name: str, arguments: argparse.Namespace, seeds: str) -> str:
    """Return the scene YAML of a family with four small views, and with these seeds."""
    content = yaml.safe_load((ROOT / f"configs/scenes/{name}.yaml").read_text("utf-8"))
    content["scene"]["parameters"]["detail"] = arguments.detail
    content["render"]["samples"] = arguments.samples
    for rig in content["rigs"].values():
        rig.update(FOUR_VIEWS[rig["type"]])
        rig["camera"]["resolution"] = [arguments.resolution] * 2
    content["family"] = {"seeds": seeds, "batch": arguments.batch}
    return json.dumps(content)


def built(root: Path, arguments: argparse.Namespace, seeds: str) -> FamilyBuild:
    """Return a build of all families with these seeds."""
    names = [f"{name}_family" for name in NAMES]
    scenes = {name: scene(name, arguments, seeds) for name in names}
    return FamilyBuild(root, scenes, arguments.cores)


def problems(build: FamilyBuild, kills: int) -> Iterator[str]:
    """Yield what is wrong with the finished corpora."""
    for name in NAMES:
        folder = build.root / f"results/{name}_family"
        for member in read_json(folder / "corpus.json")["members"]:
            if member["state"] != "valid":
                yield f"{folder}: {member['name']} is {member['state']}"
        for fault in corpus_faults(folder):
            yield str(fault)
    repeated = [f"{family}/{name}" for (family, name), n in build.begun().items() if n > 1]
    if len(repeated) > kills * build.cores:
        yield f"built more than once: {', '.join(repeated)}"


def differences(first: FamilyBuild, second: FamilyBuild) -> Iterator[str]:
    """Yield the lists of checksums in which the members of the second build differ."""
    for path in sorted(second.root.glob("results/*/*/*/sha256sums.txt")):
        sums = path.relative_to(second.root)
        if path.read_bytes() != (first.root / sums).read_bytes():
            yield f"{sums} differs from that of the undisturbed build"


def table(build: FamilyBuild) -> Iterator[str]:
    """Yield the lines of a table: the members of each family, and their CPU seconds."""
    yield "| family | valid | failed | begun twice | CPU seconds a member |"
    yield "| --- | ---: | ---: | ---: | ---: |"
    begun = build.begun()
    for name in NAMES:
        family = f"{name}_family"
        members = read_json(build.root / f"results/{family}/corpus.json")["members"]
        states = [member["state"] for member in members]
        again = sum(n > 1 for (other, _), n in begun.items() if other == family)
        times = build.root.glob(f"work/{family}/*/cpu_seconds.json")
        seconds = sum(sum(read_json(path).values()) for path in times) / len(members)
        counts = f"{states.count('valid')} | {states.count('failed')} | {again}"
        yield f"| `{name}` | {counts} | {seconds:.1f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("--output", type=Path, required=True, help="folder to build in; it is kept")
    add("--seeds", type=int, default=100, help="members of each family (default: 100)")
    add("--batch", type=int, default=32, help="members of a job (default: 32)")
    add("--resolution", type=int, default=64, help="pixels of a view's side (default: 64)")
    add("--samples", type=int, default=4, help="samples of a pixel (default: 4)")
    add("--detail", type=float, default=0.05, help="the builders' detail (default: 0.05)")
    add("--kills", type=int, default=2, help="how often the build is killed (default: 2)")
    add("--cores", type=int, default=os.cpu_count() or 1, help="cores (default: all)")
    arguments = parser.parse_args()
    last = arguments.seeds - 1
    build = built(arguments.output / "killed", arguments, f"0-{last}")
    progress = Progress(arguments.kills + 2, "families", "runs")
    for number in range(1, arguments.kills + 1):
        build.kill_after(arguments.seeds * len(NAMES) * number // (arguments.kills + 1))
        print(build.status(), flush=True)
        progress.done()
    print("\n".join(build.finish()), flush=True)
    progress.done()
    undisturbed = built(arguments.output / "undisturbed", arguments, f"{max(0, last - 1)}-{last}")
    undisturbed.finish()
    progress.done()
    print("\n".join(table(build)))
    if wrong := [*problems(build, arguments.kills), *differences(build, undisturbed)]:
        raise UserError("\n".join(wrong))
    print("all members are valid, and every byte as the sums and the undisturbed build say")


if __name__ == "__main__":
    run(main)
