"""What follows from the history of jobs: views that hang, and suspect views."""

import json
import signal
import subprocess
import sys

import pytest
from conftest import SCRIPTS, largest_file

from lightfield.core.errors import UserError
from lightfield.engine import receipts
from lightfield.workflow.history import is_suspect, read


def test_a_view_that_took_far_less_time_than_others_is_suspect():
    assert is_suspect(0.01, [1.0, 1.1, 0.9])
    assert not is_suspect(0.1, [1.0, 1.1, 0.9])
    assert not is_suspect(0.01, [1.0, 1.1])


def test_lines_before_the_first_start_belong_to_no_run(tmp_path):
    """A history whose first line was damaged can still be read."""
    path = tmp_path / "0-2.part"
    view = {"finished": 12.0, "wall_seconds": 2.0, "cpu_seconds": 2.0, "render_seconds": 1.0}
    lines = [
        {"start_up_seconds": 1.0, "device": "CPU", "threads": 1},
        {"view": "view_0000f"} | view,
        {"ended": 13.0, "cpu_seconds": 5.0, "peak_memory_bytes": 100},
        {"started": 20.0, "host": "there", "pid": 1},
        {"view": "view_0001f"} | view,
    ]
    path.write_text("".join(f"{json.dumps(line)}\n" for line in lines))
    (run,) = read(path.with_suffix(".jsonl"))
    assert run.start["started"] == 20.0 and run.end is None
    assert [line["view"] for line in run.views] == ["view_0001f"]


def test_a_history_continues_after_a_truncated_line(tmp_path):
    path = tmp_path / "receipts/0-2.jsonl"
    with receipts.opened(path, {}, []) as receipt:
        receipt.log({"view": "first"})
        size = path.with_suffix(".part").stat().st_size
        with (
            largest_file(size + 5),
            pytest.raises(UserError, match=r"0-2\.part: cannot be written: File too large"),
        ):
            receipt.log({"view": "lost"})
        receipt.log({"view": "kept"})
    lines = receipts.history(path)
    assert [line["view"] for line in lines] == ["first", "kept"]


HANG = """
import sys, time
from pathlib import Path
from lightfield.rendering.views import colour_pass, geometry_pass
from lightfield.stages.views import RenderShard
def hang(*_, **__): time.sleep(60)
colour_pass.render_colour = geometry_pass.render_geometry = hang
lightfield, blend = map(Path, sys.argv[1:])
folder = lightfield.with_name("exr")
RenderShard(lightfield=lightfield, blend=blend, output=folder, device="cpu", stall=1).run()
"""


def test_a_view_that_hangs_ends_its_process(run_program, room, tmp_path):
    arguments = ("--scene", "smoke", "--rig", "LFCuboid_1x1x1")
    run_program("make_lightfield.py", *arguments, "--output", tmp_path / "lightfield.json")
    run = subprocess.run(
        [sys.executable, "-c", HANG, tmp_path / "lightfield.json", room],
        env={"PYTHONPATH": str(SCRIPTS)},
        check=False,
    )
    assert run.returncode == -signal.SIGALRM
