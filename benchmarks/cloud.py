"""Build with jobs that share no folder, against a local S3 server, kill them, and compare bytes.

Each job works in a folder of its own that holds the program alone. It fetches its inputs from the
storage and puts its outputs there. An undisturbed build on one disk gives the expected bytes.
Prints how often a job or the whole run was killed. Needs,
beside the environment:

    make .venv/complete-with-storage .venv-s3-server/complete
"""

import argparse
import contextlib
import importlib.util
import json
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections import Counter
from pathlib import Path

import psutil

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scripts"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.core.files import sha256, write_json
from lightfield.core.progress import Progress
from soak import DATASET, ROOT, SCENE, Build, count_renders, write_text

# The server's own environment, in the repository.
SERVER = ".venv-s3-server"
# How long to wait until the server answers.
SERVER_SECONDS = 60
# The packages that this program's environment needs.
STORAGE_PACKAGES = ("snakemake_storage_plugin_s3", "upath", "s3fs")
BUCKET = "plenoforge"
STORE = "s3://plenoforge"
# Like views, an export's files travel in a bundle.
EXPORTS = """
exports:
  instant_ngp: {sources: [views, perspective]}
  poses_csv: {sources: [views]}
"""
# The part of the repository that a cloud image contains.
PROGRAM = (
    "Snakefile",
    "config.yaml",
    "configs",
    "rules",
    "scripts",
    "envs",
    "captions",
    "profiles",
)
SUBMIT = """#!/bin/sh
# Run a job in a folder of its own, and print its number.
set -e
job=$(mktemp -d {jobs}/XXXXXX)
cd {root}
# Jobs only replace files of the program, so links are enough.
cp -Rpl program "$job"
cp -Rp --parents configs config.yaml {settings} "$job"
cd "$job"
setsid sh -c 'sh "$1" > terminal.log 2>&1; echo $? > status' sh "$1" > /dev/null 2>&1 &
echo $! > pid
basename "$job"
"""
STATUS = """#!/bin/sh
cd {jobs}/"$1"
if [ -e status ]; then
    [ "$(cat status)" = 0 ] && echo success || echo failed
elif kill -0 "$(cat pid)" 2> /dev/null; then
    echo running
else
    echo failed
fi
"""


class Disk(Build):
    """A build on one disk, with exports."""

    def __init__(self, root: Path, views: int) -> None:
        super().__init__(root, views)
        write_text(root / "configs/scenes/soak.yaml", SCENE.format(views=views) + EXPORTS)


class Cloud(Disk):
    """A build whose jobs share nothing but ``store``, a URL or folder.

    Each job has the scene YAMLs. ``settings`` are paths of further files that these name; they
    contain no blanks.
    """

    def __init__(self, root: Path, views: int, store: str, settings: tuple[str, ...] = ()) -> None:
        super().__init__(root, views)
        self.store = store
        config = json.loads((root / "config.yaml").read_text(encoding="utf-8"))
        write_json(root / "config.yaml", config | {"storage": store, "cluster_jobs": 2})
        self.jobs = root.with_name("jobs")
        self.jobs.mkdir()
        program = root / "program"
        program.mkdir()
        for name in PROGRAM:
            subprocess.run(["cp", "-Rp", ROOT / name, program], check=True)
        for name, text in (("submit", SUBMIT), ("status", STATUS)):
            script = root / f"{name}.sh"
            paths = " ".join(settings)
            write_text(script, text.format(jobs=self.jobs, root=root, settings=paths))
            script.chmod(0o755)

    def start(self, *arguments: str, limit: int | None = None) -> subprocess.Popen[str]:
        """Start the run."""
        command = [
            Path(sys.executable).with_name("snakemake"),
            "--snakefile",
            "program/Snakefile",
            "--executor",
            "cluster-generic",
            "--shared-fs-usage",
            "none",
            "--retries",
            "3",
            "--cluster-generic-submit-cmd",
            self.root / "submit.sh",
            "--cluster-generic-status-cmd",
            self.root / "status.sh",
            "--default-storage-provider",
            "s3" if "://" in self.store else "fs",
            "--default-storage-prefix",
            self.store,
            "--jobs",
            "2",
            "--cores",
            "1",
            "--seconds-between-status-checks",
            "1",
            "--latency-wait",
            "10",
            *arguments,
        ]
        return subprocess.Popen(
            command,
            cwd=self.root,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            start_new_session=True,
        )

    def running(self) -> list[int]:
        """Return the process groups of the jobs that are running."""
        groups = [int(path.read_text(encoding="utf-8")) for path in self.jobs.glob("*/pid")]
        return [group for group in groups if psutil.pid_exists(group)]

    def published(self) -> dict[str, str]:
        """Return the SHA-256 of each published file, computed from the bytes in the storage."""
        taken = self.root.with_name("taken")
        taken.mkdir()
        command = [sys.executable, ROOT / "scripts/take_dataset.py", "--store", self.store, DATASET]
        subprocess.run(command, cwd=taken, check=True)
        lines = (taken / DATASET / "sha256sums.txt").read_text(encoding="utf-8").splitlines()
        return {name: sha256(taken / DATASET / name) for _, _, name in map(split_line, lines)}

    def render_counts(self) -> Counter[str]:
        """Return how often each view was rendered, by the jobs that are running."""
        return count_renders(self.jobs.iterdir())


def split_line(line: str) -> tuple[str, str, str]:
    """Return the SHA-256, two blanks and the name of a line of sha256sums.txt."""
    return line.partition("  ")


def check_environment() -> None:
    """Raise `UserError` that says what to set up, if the S3 server or a package is missing."""
    targets = []
    if any(importlib.util.find_spec(package) is None for package in STORAGE_PACKAGES):
        targets.append(".venv/complete-with-storage")
    if not (ROOT / SERVER / "complete").exists():
        targets.append(f"{SERVER}/complete")
    if targets:
        raise UserError(f"packages are missing: make {' '.join(targets)}")


def serve(folder: Path) -> tuple[subprocess.Popen[bytes], dict[str, str]]:
    """Start an S3 server with a bucket; return it and the environment variables of its clients.

    Raises `UserError` if the server does not answer.
    """
    with socket.socket() as free_socket:
        free_socket.bind(("127.0.0.1", 0))
        port = free_socket.getsockname()[1]
    url = f"http://127.0.0.1:{port}"
    log = folder / "server.log"
    with log.open("wb") as output:
        python = ROOT / SERVER / "bin/python"
        server = subprocess.Popen(
            [python, "-m", "moto.server", "-p", str(port)], stdout=output, stderr=output
        )
    bucket = urllib.request.Request(f"{url}/{BUCKET}", method="PUT")
    deadline = time.monotonic() + SERVER_SECONDS
    while True:
        with contextlib.suppress(OSError):
            urllib.request.urlopen(bucket)
            break
        if server.poll() is not None or time.monotonic() > deadline:
            server.kill()
            *_, last = log.read_text(encoding="utf-8").splitlines() or ["it said nothing"]
            raise UserError(f"the S3 server does not answer: {last}")
        time.sleep(0.5)
    keys = {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test"}
    return server, {"AWS_ENDPOINT_URL": url, "AWS_DEFAULT_REGION": "us-east-1", **keys}


def kill_group(group: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(group, signal.SIGKILL)


def kill(build: Cloud, count: int, seconds: float, rng: random.Random) -> Counter[str]:
    """Kill one job, or the run with all its jobs, at random moments; then let the build finish.

    A run fails if one of its jobs is killed at every attempt; the next run goes on from there. A
    run that fails although nothing was killed ends the program.
    """
    killed: Counter[str] = Counter()
    progress = Progress(count, "cloud", "kills")
    process = build.start()
    disturbed = False
    while killed.total() < count:
        progress.done(killed.total() - progress.count)
        time.sleep(rng.uniform(0.1, 1.0) * seconds)
        if process.poll() == 0:
            break
        if process.poll() is not None:
            output, _ = process.communicate()
            if not disturbed:
                sys.exit(f"error: an undisturbed build failed:\n{output}")
            process = build.start()
            disturbed = False
            continue
        kills_job = rng.random() < 0.5
        running = build.running()
        if kills_job and running:
            kill_group(rng.choice(running))
            killed["a job"] += 1
            disturbed = True
        else:
            for group in (process.pid, *running):
                kill_group(group)
            process.communicate()
            killed["the run and its jobs"] += 1
            build.run("--unlock")
            process = build.start()
            disturbed = False
    output, _ = process.communicate()
    if process.returncode:
        print(output, file=sys.stderr)
        build.finish()
    return killed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=6, help="views of the dataset (default: 6)")
    parser.add_argument("--kills", type=int, default=20, help="number of kills (default: 20)")
    parser.add_argument("--seed", type=int, default=1, help="of the random moments (default: 1)")
    parser.add_argument(
        "--folder", type=Path, help="folder to build in, kept (default: a temporary one)"
    )
    arguments = parser.parse_args()
    check_environment()
    with tempfile.TemporaryDirectory() as name:
        folder = (arguments.folder or Path(name)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        began = time.monotonic()
        undisturbed = Disk(folder / "disk", arguments.views)
        undisturbed.finish()
        seconds = (time.monotonic() - began) / 4
        server, environment = serve(folder)
        os.environ.update(environment)
        try:
            build = Cloud(folder / "cloud", arguments.views, STORE)
            killed = kill(build, arguments.kills, seconds, random.Random(arguments.seed))
            same = build.published() == undisturbed.published()
        finally:
            server.terminate()
            server.wait()
        jobs = len(list(build.jobs.iterdir()))
    for target, times in sorted(killed.items()):
        print(f"killed {target}: {times} times")
    print(f"{arguments.views} views in {jobs} jobs")
    if not same:
        sys.exit("error: the bytes differ from a build on one disk")
    print("all published bytes equal the bytes of a build on one disk")


if __name__ == "__main__":
    run(main)
