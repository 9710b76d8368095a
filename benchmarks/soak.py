"""Kill builds, damage their files, limit their size. Count what is found, mended and lost.

Builds a small dataset of the test room twice, each time in a folder of its own. Nothing disturbs
the first build. The second one may write no large files at first. Then it is killed at random
moments, and finishes at last. After that the program spoils its files in every way.
`snakemake verify --mend` must find them and set them aside, and the next build makes them again. In
the end all published bytes must equal the undisturbed build's. Prints a table. Fails if a fault was
not found or not mended, or if anything was lost or made twice.
"""

import argparse
import hashlib
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
from collections.abc import Callable, Iterable, Iterator
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import bookkeeping

from lightfield.core.files import write_json, write_text
from lightfield.core.names import ROOT
from lightfield.core.progress import Progress
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
NAME = "soak/LFSoak"
DATASET = Path("results", NAME)
WORK = Path("work", NAME)
# No file may exceed this many bytes: from what Snakemake itself needs to less than the scene.
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
    """Write another file in its place; an image stays readable."""
    pixels = np.full((4, 4), rng.randrange(100, 200), np.uint8)
    if path.suffix == ".exr":
        images.write_exr(path, {"R": pixels.astype(np.float16)}, {images.KEY_ATTRIBUTE: "render"})
    elif path.suffix == ".png":
        images.write_png(path, pixels)
    else:
        path.write_bytes(path.read_bytes()[::-1] + b"\n")


def swap(path: Path, rng: random.Random) -> None:
    """Write the bytes of another file of its folder, of the same kind, in its place."""
    content = path.read_bytes()
    siblings = sorted(file for file in path.parent.glob(f"*{path.suffix}") if file.is_file())
    contents = [file.read_bytes() for file in siblings]
    different = [sibling for sibling in contents if sibling != content]
    if different:
        path.write_bytes(rng.choice(different))
    else:
        replace(path, rng)


def folder(path: Path, rng: random.Random) -> None:
    path.unlink()
    (path / "inside").mkdir(parents=True)


def unreadable(path: Path, rng: random.Random) -> None:
    """Make the file a link to itself, which root cannot read either."""
    path.unlink()
    path.symlink_to(path.name)


KINDS: list[Callable[[Path, random.Random], None]] = [
    flip,
    truncate,
    empty,
    delete,
    replace,
    swap,
    folder,
    unreadable,
]


def spoil(path: Path, kind: Callable[[Path, random.Random], None], rng: random.Random) -> None:
    """Spoil a file; keep its time if it stays a file."""
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

    def start(self, *arguments: str, limit: int | None = None) -> subprocess.Popen[str]:
        """Start Snakemake in a process group of its own; ``limit`` is the largest file's bytes."""

        def limit_file_size() -> None:
            if limit:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

        snakemake = str(Path(sys.executable).with_name("snakemake"))
        command = [snakemake, "--snakefile", str(ROOT / "Snakefile")]
        return subprocess.Popen(
            [*command, "--cores", str(os.cpu_count() or 1), *arguments],
            cwd=self.root,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            start_new_session=True,
            preexec_fn=limit_file_size,
        )

    def run(self, *arguments: str, limit: int | None = None) -> tuple[bool, str]:
        """Run Snakemake to its end; return whether it succeeded, and its output."""
        process = self.start(*arguments, limit=limit)
        output, _ = process.communicate()
        return process.returncode == 0, output

    def finish(self) -> None:
        succeeded, output = self.run()
        if not succeeded:
            sys.exit(f"error: an undisturbed build failed:\n{output}")

    def clear(self) -> None:
        """Remove all that the build wrote."""
        for name in ("results", "work", ".snakemake"):
            shutil.rmtree(self.root / name)

    def call(self, *command: str) -> str:
        """Run a program in the build's folder; return what it printed."""
        result = subprocess.run(
            command, cwd=self.root, capture_output=True, encoding="utf-8", check=False
        )
        return result.stdout

    def files(self) -> list[Path]:
        """Return the files of the dataset and of its scene that jobs wrote.

        Settings are left out: each plan rewrites those that are wrong.
        """
        paths = []
        for part in (DATASET, WORK.parent):
            paths += sorted((self.root / part).rglob("*"))
        return [
            path
            for path in paths
            if path.is_file() and path.stat().st_size > 1 and "settings" not in path.parts
        ]

    def published(self) -> dict[str, str]:
        """Return the SHA-256 of each published file."""
        digests = {}
        for line in (
            (self.root / DATASET / "sha256sums.txt").read_text(encoding="utf-8").splitlines()
        ):
            digest, _, name = line.partition("  ")
            digests[name] = digest
        return digests

    def finished(self) -> dict[Path, tuple[str, int]]:
        """Return the SHA-256 and the size in bytes of each view that is logged as finished."""
        return bookkeeping.finished_files(self.root, NAME)

    def render_counts(self) -> Counter[str]:
        """Return how often each view was rendered."""
        return count_renders([self.root])


def count_renders(roots: Iterable[Path]) -> Counter[str]:
    """Return how often each view was rendered in builds in these folders."""
    counts: Counter[str] = Counter()
    for root in roots:
        for (shard, view), times in bookkeeping.rendered(root).items():
            if shard.name == "render":
                counts[view] += times
    return counts


def lost_bytes(before: dict[Path, tuple[str, int]]) -> int:
    """Return how many bytes of finished files are missing or changed."""
    return sum(
        size
        for path, (digest, size) in before.items()
        if not path.is_file() or hashlib.sha256(path.read_bytes()).hexdigest() != digest
    )


@dataclass
class Row:
    """A row of the table: a kind of fault, and how many were found and mended."""

    fault: str
    injected: int = 0
    found: int = 0
    mended: int = 0
    bytes_lost: int = 0
    made_twice: int = 0

    def passes(self) -> bool:
        """Return whether each fault was found and mended, and nothing was lost or made twice."""
        mended = self.injected == self.found == self.mended
        return mended and self.bytes_lost == 0 and self.made_twice == 0


def limit_files(build: Build, count: int) -> Iterator[Row]:
    """Build with ever larger limits of file size: each build says so and leaves no half file."""
    progress = Progress(count, "soak", "limits of files")
    for limit in LIMITS[:count]:
        before = build.finished()
        succeeded, output = build.run(limit=limit)
        causes = ("cannot be written", "File too large", "SIGXFSZ")
        names_cause = any(cause in output for cause in causes)
        half = [path for path in build.root.rglob(".*.tmp*") if ".snakemake" not in path.parts]
        clean = not half and "Traceback" not in output
        reported = not succeeded and names_cause
        yield Row(f"no file beyond {limit} B", 1, int(reported), int(clean), lost_bytes(before))
        if not (reported and clean):
            print(output, file=sys.stderr)
        progress.done()


def kill(
    build: Build, count: int, seconds: float, expected: dict[str, str], rng: random.Random
) -> Row:
    """Kill a build at random moments; the next one goes on, and the last one finishes.

    ``seconds`` is a build's duration, ``expected`` the checksums of the files that it publishes.
    If a build finishes before it is killed, another one begins from nothing.
    """
    row = Row("killed at a random moment")
    killed = 0
    progress = Progress(count, "soak", "kills")
    while True:
        before = build.finished()
        process = build.start()
        timeout = rng.uniform(0.05, 0.7) * seconds if row.injected < count else None
        try:
            process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
        row.bytes_lost += lost_bytes(before)
        if process.returncode == -signal.SIGKILL:
            killed += 1
            row.injected += 1
            row.found += 1
            progress.done()
            build.run("--unlock")
        elif process.returncode == 0:
            if build.published() == expected:
                row.mended += killed
            renders = build.render_counts()
            row.made_twice += renders.total() - len(renders)
            killed = 0
            if row.injected == count:
                return row
            build.clear()
        else:
            sys.exit("error: a build failed although nothing killed it")


def damage(build: Build, faults: int, rng: random.Random) -> Iterator[Row]:
    """Spoil files, let them be found and mended, and build again; yield a row for each fault."""
    rows = {kind: Row(f"{kind.__name__}: a file") for kind in KINDS}
    progress = Progress(faults, "soak", "faults")
    verify = [sys.executable, str(ROOT / "scripts/verify.py"), str(DATASET), "--work", "work"]
    while faults:
        files = build.files()
        chosen = rng.sample(files, min(faults, max(1, len(files) // 3)))
        kinds = {path: KINDS[(faults - number) % len(KINDS)] for number, path in enumerate(chosen)}
        faults -= len(chosen)
        sound = {path: sums for path, sums in build.finished().items() if path not in kinds}
        rendered = build.render_counts()
        spoiled = views_to_render_again(kinds)
        for path, kind in kinds.items():
            spoil(path, kind, rng)
        report = build.call(*verify, "--mend")
        build.finish()
        later_report = build.call(*verify)
        for path, kind in kinds.items():
            name = f"{path.relative_to(build.root)}: "
            rows[kind].injected += 1
            rows[kind].found += name in report
            rows[kind].mended += name not in later_report
        repeated = [view for view in build.render_counts() - rendered if view not in spoiled]
        rows[KINDS[0]].made_twice += len(repeated)
        rows[KINDS[0]].bytes_lost += lost_bytes(sound)
        progress.done(len(chosen))
    yield from rows.values()


def views_to_render_again(paths: Iterable[Path]) -> set[str]:
    """Return the views whose own file, or note of what is finished, is among ``paths``."""
    return set().union(*map(bookkeeping.views_of, paths))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add("--views", type=int, default=12, help="views of the dataset (default: 12)")
    add("--limits", type=int, default=len(LIMITS), help="how many limits of file size to try")
    add("--kills", type=int, default=20, help="number of kills (default: 20)")
    add("--faults", type=int, default=300, help="number of spoiled files (default: 300)")
    add("--seed", type=int, default=1, help="of the random choices (default: 1)")
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        undisturbed = Build(Path(name, "a"), arguments.views)
        build = Build(Path(name, "b"), arguments.views)
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
        f"bytes {'equal' if same else 'DIFFER FROM'} the undisturbed build's."
    )
    if not (same and all(row.passes() for row in rows)):
        sys.exit("error: something was not found, not mended, lost, or made twice")


if __name__ == "__main__":
    main()
