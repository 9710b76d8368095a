"""Compares the published files and the keys of five small builds with sums noted earlier.

    python tests/golden.py                 # build all five scenes, and name what differs
    python tests/golden.py smoke object    # only these scenes
    python tests/golden.py --write         # note the sums anew, in tests/golden/

tests/golden/ has a file for each scene and environment: Python, bpy, and the kind of machine. On
another kind of machine, last digits differ. Without sums for this kind, the program says so, and
compares only the names of the files and the keys of the views.
"""

import argparse
import hashlib
import os
import platform
import re
import shutil
import sys
import tempfile
import time
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "scripts"), str(ROOT / "tests")]

from checkouts import checkout, snakemake  # noqa: E402

from lightfield.imaging import images  # noqa: E402

FOLDER = ROOT / "tests/golden"
TINY = ("object", "garden", "lone_monk", "barbershop")
# Snakemake's arguments for each scene.
SCENES = {
    "smoke": ["smoke", "--config", "device=cpu"],
    **{
        scene: ["--config", f"scenes=[{scene}]", "rigs=all", "preset=tiny", "device=cpu"]
        for scene in TINY
    },
}
# What two equal builds do not share: the end of the path, the text to leave out, and the reason.
MEASURED = [
    ("report/costs.json", rb".*", "holds the time and the memory that jobs took"),
    ("report/index.html", rb'<section id="cost">.*?</section>', "shows costs.json"),
]


class Build:
    """The sums of a build, and what else may decide its bytes: the software and the machine.

    The sums are by what they are of. ``file <path>`` has the SHA-256 of a published file without
    what was measured. ``key <path>`` has the key of a view, whether rendered or reprojected.
    """

    def __init__(self, folder):
        python = ".".join(platform.python_version_tuple()[:2])
        self.software = f"Python {python} bpy {metadata.version('bpy')}"
        self.sums = {}
        for path in sorted((folder / "results").rglob("*")):
            if path.is_file():
                self.sums[f"file {path.relative_to(folder).as_posix()}"] = digest(path)
        machines = set()
        for path in sorted([*folder.rglob("*.exr"), *folder.rglob("*.png")]):
            header = images.read_header(path).attributes
            machines.add(header.get(images.MACHINE_ATTRIBUTE))
            # The key of a flow has the SHA-256 of its views.
            if images.KEY_ATTRIBUTE in header and "flow" not in path.parts:
                name = f"key {path.relative_to(folder).as_posix()}"
                self.sums[name] = header[images.KEY_ATTRIBUTE]
        self.machine = ", ".join(sorted(machines - {None}))


def digest(path):
    """Return the SHA-256 of a file without what was measured."""
    content = path.read_bytes()
    for end, measured, _ in MEASURED:
        if path.as_posix().endswith(end):
            content = re.sub(measured, b"", content, flags=re.DOTALL)
    return hashlib.sha256(content).hexdigest()


def noted_file(*words):
    """Return the file of noted sums for a scene, software and a machine."""
    return FOLDER / f"{re.sub(r'[^a-zA-Z0-9_.]+', '-', ' '.join(words))}.txt"


def read_sums(file):
    """Return the noted sums, by what they are of."""
    pairs = (line.split("  ", 1) for line in file.read_text().splitlines())
    return {name: value for value, name in pairs}


def write(scene, build):
    """Note the sums of a build. Return the file."""
    file = noted_file(scene, build.software, build.machine)
    file.parent.mkdir(exist_ok=True)
    file.write_text("".join(f"{value}  {name}\n" for name, value in build.sums.items()))
    return file


def compare(scene, build):
    """Compare a build with the noted sums. Return with which, and a line for each difference."""
    file = noted_file(scene, build.software, build.machine)
    if file.exists():
        return f"compared all sums with {file.name}", differences(read_sums(file), build.sums)
    others = sorted(FOLDER.glob(f"{noted_file(scene, build.software).stem}-*"))
    if not others:
        return f"no sums are noted for {build.software}", [f"missing: {file.name}"]
    said = (
        f"no sums are noted for this kind of machine, {build.machine}; compared only the names of "
        f"files, and the keys, with {others[0].name}"
    )
    return said, differences(without_bytes(read_sums(others[0])), without_bytes(build.sums))


def without_bytes(sums):
    """Return sums in which that of each file is empty."""
    return {name: "" if name.startswith("file ") else value for name, value in sums.items()}


def differences(noted, present):
    """Return a line for each sum that is missing, new, or has changed."""
    lines = [f"missing: {name}" for name in noted.keys() - present.keys()]
    lines += [f"new: {name}" for name in present.keys() - noted.keys()]
    common = noted.keys() & present.keys()
    lines += [f"changed: {name}" for name in common if noted[name] != present[name]]
    return sorted(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    names = ", ".join(SCENES)
    about = f"which of {names} (default: all)"
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=about)
    parser.add_argument("--write", action="store_true", help="note the sums anew")
    arguments = parser.parse_args()
    for scene in arguments.scenes:
        if scene not in SCENES:
            parser.error(f"SCENE: is {scene}; must be one of {names}")
    failed = False
    for scene in arguments.scenes or SCENES:
        folder = checkout(Path(tempfile.mkdtemp(prefix=f"golden_{scene}_")))
        cores = str(os.cpu_count())
        began = time.monotonic()
        result = snakemake(folder, "--cores", cores, *SCENES[scene])
        if result.returncode:
            sys.exit(f"error: {scene}: its build in {folder} failed:\n{result.stderr}")
        build = Build(folder)
        said, lines = compare(scene, build)
        print(f"{scene}: {len(build.sums)} sums in {time.monotonic() - began:.0f} s: {said}")
        print("".join(f"  {line}\n" for line in lines), end="", flush=True)
        if arguments.write:
            print(f"  written: {write(scene, build).relative_to(ROOT)}")
        elif lines:
            failed = True
            print(f"  the build is in {folder}", flush=True)
            continue
        shutil.rmtree(folder)
    sys.exit("error: the sums differ" if failed else 0)


if __name__ == "__main__":
    main()
