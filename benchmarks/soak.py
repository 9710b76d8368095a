"""Kill builds, damage their files, and leave them no room; count what is found, mended and lost.

Builds a small dataset of the test room in a folder of its own: once undisturbed; once with every
file limited in size and killed at random moments, until it is finished; then it spoils files of
every kind, lets `snakemake verify` find them and --mend set them aside, and builds on. In the end
all published bytes must be those of the undisturbed build. Prints a table, and fails if anything
was not found, not mended, lost, or made twice.
"""

import argparse
import hashlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))

from lightfield.core.files import write_json, write_text
from lightfield.core.progress import Progress
from lightfield.dataset.config import ROOT
from lightfield.imaging import images

SCENE = """
scene: {{builder: room}}
report: {{panorama: false}}
render: {{samples: 1}}
rigs:
  LFSoak:
    type: plane
    cameras: [{views}, 1]
    size: [1, 0, 1]
    center: [0, 0, 1.5]
    camera: {{lens: equidistant, fov: 180, resolution: [32, 32]}}
reprojections:
  perspective:
    camera: {{lens: rectilinear, fov: 60, resolution: [24, 24]}}
"""
DATASET, WORK = Path("results/soak/LFSoak"), Path("work/soak/LFSoak")
# Bytes that no file may exceed: from what Snakemake itself needs to less than the scene.
LIMITS = (32_000, 64_000, 128_000)


def flip(path: Path, rng: random.Random) -> None:
    content = bytearray(path.read_bytes())
    content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    path.write_bytes(content)


def truncate(path: Path, rng: random.Random) -> None:
    path.write_bytes(path.read_bytes()[: rng.randrange(1, path.stat().st_size)])


def empty(path: Path, rng: random.Random) -> None:
    path.write_bytes(b"")


def delete(path: Path, rng: random.Random) -> None:
    path.unlink()


def replace(path: Path, rng: random.Random) -> None:
    """Put another file there that can be read as well, where it is an image."""
    pixels = np.full((4, 4), rng.randrange(100, 200), np.uint8)
    if path.suffix == ".exr":
        images.write_exr(path, {"R": pixels.astype(np.float16)}, {images.KEY_ATTRIBUTE: "render"})
    elif path.suffix == ".png":
        images.write_png(path, pixels)
    else:
        path.write_bytes(path.read_bytes()[::-1] + b"\n")


def swap(path: Path, rng: random.Random) -> None:
    """Put the bytes of another file of its folder there, which is as good but not this one."""
    content = path.read_bytes()
    beside = sorted(other for other in path.parent.glob(f"*{path.suffix}") if other.is_file())
    others = [other for other in map(Path.read_bytes, beside) if other != content]
    if others:
        path.write_bytes(rng.choice(others))
    else:
        replace(path, rng)


def folder(path: Path, rng: random.Random) -> None:
    path.unlink()
    (path / "inside").mkdir(parents=True)


def unreadable(path: Path, rng: random.Random) -> None:
    """For root, too: a link to itself."""
    path.unlink()
    path.symlink_to(path.name)


KINDS: list[Callable[[Path, random.Random], None]] = [
    *(flip, truncate, empty, delete, replace, swap, folder, unreadable)
]


def spoil(path: Path, kind: Callable[[Path, random.Random], None], rng: random.Random) -> None:
    """Spoil a file and keep its time where it stays a file."""
    status = path.stat()
    kind(path, rng)
    if path.is_file():
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


class Build:
    """A build in a folder of its own."""

    def __init__(self, root: Path, views: int) -> None:
        self.root = root
        write_text(root / "configs/scenes/soak.yaml", SCENE.format(views=views))
        settings = {"scenes": ["soak"], "rigs": "all", "preset": "full", "device": "cpu"}
        write_json(root / "config.yaml", settings | {"views_per_shard": 2})

    def start(self, *words: str, limit: int | None = None) -> subprocess.Popen[str]:
        """Start Snakemake, in a process group that can be killed, with no file beyond a limit."""

        def limited() -> None:
            if limit:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

        snakemake = str(Path(sys.executable).with_name("snakemake"))
        command = [snakemake, "--snakefile", str(ROOT / "Snakefile")]
        return subprocess.Popen(
            [*command, "--cores", str(os.cpu_count() or 1), *words],
            cwd=self.root,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
            preexec_fn=limited,
        )

    def run(self, *words: str, limit: int | None = None) -> tuple[bool, str]:
        """Run Snakemake to its end; return whether it succeeded, and what it said."""
        process = self.start(*words, limit=limit)
        said, _ = process.communicate()
        return process.returncode == 0, said

    def finish(self) -> None:
        succeeded, said = self.run()
        if not succeeded:
            sys.exit(f"error: a build failed that nothing disturbed:\n{said}")

    def clear(self) -> None:
        """Remove all that was made."""
        for name in ("results", "work", ".snakemake"):
            shutil.rmtree(self.root / name)

    def call(self, *words: str) -> str:
        """Run a program in the build's folder; return what it printed."""
        result = subprocess.run(words, cwd=self.root, capture_output=True, text=True, check=False)
        return result.stdout

    def files(self) -> list[Path]:
        """Return the files of the dataset and of its scene that jobs made.

        Settings are none: each plan writes what is not as it should be.
        """
        return [
            path
            for part in (DATASET, WORK.parent)
            for path in sorted((self.root / part).rglob("*"))
            if path.is_file() and path.stat().st_size > 1 and "settings" not in path.parts
        ]

    def published(self) -> dict[str, str]:
        """Return the SHA-256 of each published file."""
        lines = (self.root / DATASET / "sha256sums.txt").read_text().splitlines()
        return {name: digest for digest, _, name in (line.partition("  ") for line in lines)}

    def finished(self) -> dict[Path, tuple[str, int]]:
        """Return SHA-256 and bytes of each view that is logged as finished."""
        found = {}
        for log in (self.root / WORK).glob("*/*.sums.jsonl"):
            for line in log.read_text(errors="replace").splitlines():
                try:
                    entry = json.loads(line)
                except ValueError:
                    continue  # a kill has cut it short
                found[self.root / DATASET / entry["file"]] = (entry["sha256"], entry["bytes"])
        return found

    def made(self) -> Counter[str]:
        """Return how often each view was rendered."""
        lines = [
            line
            for journal in (self.root / WORK).glob("render/*.journal.jsonl")
            for line in journal.read_text(errors="replace").splitlines()
        ]
        return Counter(json.loads(line)["view"] for line in lines if line.startswith('{"view"'))


def lost(before: dict[Path, tuple[str, int]]) -> int:
    """Return how many bytes of finished files are no longer there as they were."""
    return sum(
        size
        for path, (digest, size) in before.items()
        if not path.is_file() or hashlib.sha256(path.read_bytes()).hexdigest() != digest
    )


@dataclass
class Row:
    """Of the table: a fault, and what became of it."""

    fault: str
    injected: int = 0
    found: int = 0
    mended: int = 0
    bytes_lost: int = 0
    made_twice: int = 0

    def is_whole(self) -> bool:
        return self.injected == self.found == self.mended and not (
            self.bytes_lost + self.made_twice
        )


def limit_files(build: Build, count: int) -> Iterator[Row]:
    """Build with ever larger limits of a file's size: each is named, and leaves nothing half."""
    progress = Progress(count, "soak", "limits of files")
    for limit in LIMITS[:count]:
        before = build.finished()
        succeeded, said = build.run(limit=limit)
        named = any(word in said for word in ("cannot be written", "File too large", "SIGXFSZ"))
        half = [path for path in build.root.rglob(".*.tmp*") if ".snakemake" not in path.parts]
        whole = not half and "Traceback" not in said
        found = not succeeded and named
        yield Row(f"no file beyond {limit} B", 1, int(found), int(whole), lost(before))
        if not (found and whole):
            print(said, file=sys.stderr)
        progress.done()


def kill(
    build: Build, count: int, seconds: float, expected: dict[str, str], rng: random.Random
) -> Row:
    """Kill a build at random moments; the next one goes on, and the last one finishes.

    ``seconds`` is what a build takes, ``expected`` what it publishes. After one that finishes
    before it is killed another begins from nothing.
    """
    row = Row("killed at a random moment")
    killed = 0
    progress = Progress(count, "soak", "kills")
    while True:
        before = build.finished()
        process = build.start()
        try:
            process.communicate(
                timeout=rng.uniform(0.05, 0.7) * seconds if row.injected < count else None
            )
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
        row.bytes_lost += lost(before)
        if process.returncode == -signal.SIGKILL:
            killed += 1
            row.injected += 1
            row.found += 1
            progress.done()
            build.run("--unlock")
        elif process.returncode == 0:
            row.mended += killed if build.published() == expected else 0
            row.made_twice += build.made().total() - len(build.made())
            killed = 0
            if row.injected == count:
                return row
            build.clear()
        else:
            sys.exit("error: a build failed that was not killed")


def damage(build: Build, faults: int, rng: random.Random) -> Iterator[Row]:
    """Spoil files of every kind, find, mend, and build on; yield a row for each kind of fault."""
    rows = {kind: Row(f"{kind.__name__}: a file") for kind in KINDS}
    progress = Progress(faults, "soak", "faults")
    verify = [sys.executable, str(ROOT / "scripts/verify.py"), str(DATASET), "--work", "work"]
    while faults:
        files = build.files()
        chosen = rng.sample(files, min(faults, max(1, len(files) // 3)))
        kinds = {path: KINDS[(faults - number) % len(KINDS)] for number, path in enumerate(chosen)}
        faults -= len(chosen)
        sound = {path: sums for path, sums in build.finished().items() if path not in kinds}
        rendered = build.made()
        # Views whose own file, or log of checksums, is spoiled are to be made again.
        spoiled = {path.name.partition(".")[0] for path in kinds}
        for log in (path for path in kinds if path.name.endswith(".sums.jsonl")):
            lines = map(json.loads, log.read_text().splitlines())
            spoiled |= {Path(line["file"]).stem for line in lines}
        for path, kind in kinds.items():
            spoil(path, kind, rng)
        said = build.call(*verify, "--mend")
        build.finish()
        still = build.call(*verify)
        for path, kind in kinds.items():
            name = f"{path.relative_to(build.root)}: "
            rows[kind].injected += 1
            rows[kind].found += name in said
            rows[kind].mended += name not in still
        again = [view for view in build.made() - rendered if view not in spoiled]
        rows[KINDS[0]].made_twice += len(again)
        rows[KINDS[0]].bytes_lost += lost(sound)
        progress.done(len(chosen))
    yield from rows.values()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=12, help="of the dataset (default: 12)")
    parser.add_argument("--limits", type=int, default=len(LIMITS), help="of files' sizes to try")
    parser.add_argument("--kills", type=int, default=20, help="default: 20")
    parser.add_argument("--faults", type=int, default=300, help="default: 300")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        undisturbed, build = (Build(Path(name, part), arguments.views) for part in ("a", "b"))
        undisturbed.finish()
        expected = undisturbed.published()
        seconds = time.monotonic() - began
        rows = [*limit_files(build, arguments.limits)]
        rows.append(kill(build, arguments.kills, seconds, expected, rng))
        same = build.published() == expected
        rows += damage(build, arguments.faults, rng)
        same &= build.published() == expected
    print("| fault | injected | found | mended | bytes lost | views made twice |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for row in rows:
        print("|", " | ".join(map(str, astuple(row))), "|")
    minutes = (time.monotonic() - began) / 60
    print(
        f"\n{arguments.views} views, seed {arguments.seed}, {minutes:.0f} minutes; all published "
        f"bytes are {'' if same else 'NOT '}those of a build that nothing disturbed."
    )
    if not (same and all(row.is_whole() for row in rows)):
        sys.exit("error: something was not found, not mended, lost, or made twice")


if __name__ == "__main__":
    main()
