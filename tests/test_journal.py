"""What follows from journals: machines to avoid, views that hang, and views that are suspect."""

import signal
import subprocess
import sys

import pytest
from conftest import SCRIPTS

from lightfield.dataset.journal import Run, avoided, is_suspect


def runs(*hosts):
    """Return a shard's runs; a host with ! has failed. Later ones in the list began later."""
    return [
        Run(
            {"started": float(number), "host": host.rstrip("!")},
            end=None if host.endswith("!") else {"ended": number + 0.5},
        )
        for number, host in enumerate(hosts)
    ]


@pytest.mark.parametrize(
    ("shard", "others", "expected"),
    [
        # A first submission, and nobody has failed.
        ([], [], []),
        ([], [["a"], ["b"]], []),
        # Once elsewhere after a failure.
        (["a!"], [["a"], ["b"]], ["a"]),
        # There may be no other machine.
        (["a!"], [["a"]], []),
        (["a!", "a!", "a!"], [], []),
        # Thrice, by other shards, of which the last run may still be at work.
        ([], [["a!", "a!", "a!", "b"]], ["a"]),
        ([], [["a!", "a!", "b"], ["a!"]], []),
        # Not one after the other.
        ([], [["a!", "a!", "a", "a!", "b"]], []),
        (["c!"], [["a!", "a!", "a!", "b"]], ["a", "c"]),
    ],
)
def test_a_machine_is_avoided_that_fails_while_others_do_not(shard, others, expected):
    assert avoided(runs(*shard), [runs(*hosts) for hosts in others]) == expected


def test_a_view_is_suspect_that_took_nearly_no_time_beside_the_others():
    assert is_suspect(0.01, [1.0, 1.1, 0.9])
    assert not is_suspect(0.1, [1.0, 1.1, 0.9])
    assert not is_suspect(0.01, [1.0, 1.1])


HANG = """
import sys, time, types
from pathlib import Path
def hang(*_): time.sleep(60)
for name, said in (("colour_pass", "render_colour"), ("geometry_pass", "render_geometry")):
    sys.modules[f"lightfield.rendering.{name}"] = types.SimpleNamespace(**{said: hang})
from lightfield.core.progress import Progress
from lightfield.dataset.journal import Journal
from lightfield.dataset.lightfield import LightField
from lightfield.dataset.records import ShardRecord
from lightfield.rendering import shard
lightfield = LightField.read(Path(sys.argv[1]))
record, journal = ShardRecord(None, Path("exr")), Journal(None)
views = lightfield.views
shard._render_views(views, lightfield, Path("exr"), record, journal, Progress(1, "render"), 1)
"""


def test_a_view_that_hangs_ends_its_process(run_program, tmp_path):
    words = ("--scene", "smoke", "--rig", "LFCuboid_1x1x1")
    run_program("make_lightfield.py", *words, "--output", tmp_path / "lightfield.json")
    run = subprocess.run(
        [sys.executable, "-c", HANG, tmp_path / "lightfield.json"],
        env={"PYTHONPATH": str(SCRIPTS)},
        check=False,
    )
    assert run.returncode == -signal.SIGALRM
