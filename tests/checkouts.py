"""Copies of the repository, in which a test runs Snakemake on scene YAMLs of its own."""

import filecmp
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PARTS = ("Snakefile", "config.yaml", "configs", "envs", "profiles", "captions", "rules", "scripts")


def checkout(folder, **scenes):
    """Copy what Snakemake needs to ``folder``, with ``scenes``' YAML texts in configs/scenes/.

    What is compiled goes with it, but not what another process is about to write.
    """
    folder.mkdir(parents=True, exist_ok=True)
    on_the_way = shutil.ignore_patterns("*.pyc.*", "*.tmp.*")
    for name in PARTS:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=on_the_way)
        else:
            shutil.copy(source, folder / name)
    for name, text in scenes.items():
        (folder / "configs" / "scenes" / f"{name}.yaml").write_text(text)
    return folder


def with_consumers(folder):
    """Put an environment of the consumers into a checkout whose programs are stand-ins."""
    environment = folder / ".venv-consumers"
    (environment / "bin").mkdir(parents=True)
    (environment / "bin/python").symlink_to(sys.executable)
    (environment / "complete").touch()


def _words(arguments):
    return [Path(sys.executable).with_name("snakemake"), "--cores", "1", *arguments]


def start_snakemake(folder, *arguments, **options):
    """Start Snakemake in a checkout, in a session of its own; return the process."""
    return subprocess.Popen(
        _words(arguments),
        cwd=folder,
        start_new_session=True,
        **{"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL} | options,
    )


def snakemake(folder, *arguments):
    """Run Snakemake in a checkout; return its CompletedProcess."""
    # The logger plugin of tests/ comes after what a test itself has set.
    folders = [os.environ.get("PYTHONPATH"), str(Path(__file__).parent)]
    return subprocess.run(
        _words(arguments),
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, folders))},
    )


def wait_until(condition, process, seconds=600, log=None):
    """Wait until a condition holds while a process runs, whose ``log`` says why it does not."""
    end = time.monotonic() + seconds
    while not condition():
        assert process.poll() is None, log.read_text() if log else f"{process.args} has ended"
        if time.monotonic() > end:
            raise TimeoutError(f"{process.args}: what was waited for is not there yet")
        time.sleep(0.02)


def planned(folder, *arguments):
    """Return how many jobs of each rule a dry run plans."""
    result = snakemake(folder, *arguments, "--dry-run", "--quiet", "rules")
    assert result.returncode == 0, result.stdout + result.stderr
    table = (result.stdout + result.stderr).split("Job stats:")[1].split("total")[0]
    return {name: int(count) for name, count in re.findall(r"^(\w+)\s+(\d+)$", table, re.M)}


def jobs_on(stderr):
    """Return the jobs that a plan with ``--logger jobs`` has written."""
    jobs = [json.loads(line) for line in stderr.splitlines() if line.startswith("{")]
    for job in jobs:
        # Whether a page is there is all that `checksums` asks of it.
        if job["rule"] == "checksums":
            job["input"] = [name for name in job["input"] if not name.endswith(".html")]
    return jobs


def published(folder, dataset=""):
    """Return the files of all datasets, or of one, but for their reports, by relative path."""
    results = folder / "results"
    return {
        path.relative_to(results): path
        for path in sorted((results / dataset).rglob("*"))
        if path.is_file()
        and "report" not in path.relative_to(results).parts
        # The index of all reports.
        and path.parent != results
    }


def assert_same_bytes(one, other, dataset=""):
    first, second = published(one, dataset), published(other, dataset)
    assert list(first) == list(second)
    different = [n for n in first if not filecmp.cmp(first[n], second[n], shallow=False)]
    assert not different


def rendered(folder):
    """Return how often each view has been rendered, by journal and name."""
    counts = Counter()
    for journal in folder.glob("work/**/*.journal.jsonl"):
        lines = [json.loads(line) for line in journal.read_text().splitlines()]
        # Shards of other sizes have journals of their own for the same views.
        counts.update((journal.parent, line["view"]) for line in lines if "view" in line)
    return counts
