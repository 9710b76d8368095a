"""The messages of failures: their cause, and what the user can do, in one line."""

import signal
import subprocess
import sys

import pytest
from conftest import SCRIPTS

from lightfield.core import files
from lightfield.core.cli import run
from lightfield.core.errors import UserError
from lightfield.geometry.rigs import from_settings
from lightfield.imaging import images
from lightfield.reprojection import lens_map
from lightfield.workflow.failures import cause, failure_report


def test_the_cause_is_the_last_error_or_else_the_last_line(tmp_path):
    log = tmp_path / "log"
    assert cause(log) is None
    log.write_text("\n \n")
    assert cause(log) is None
    log.write_text("render: 3 of 6 views\nMemoryError\n\n")
    assert cause(log) == "MemoryError"
    log.write_text("error: before a retry\nerror: no such scene\nBlender quit\n")
    assert cause(log) == "error: no such scene"
    log.write_bytes(b"tar: a: Cannot open: \xff\ntar: Exiting with failure status due to\n")
    assert cause(log) == "tar: a: Cannot open: �"


def test_a_crash_of_blender_names_the_file_that_it_was_reading(tmp_path):
    log = tmp_path / "log"
    crash = "terminate called\n  what():  too long\nerror: killed by SIGABRT\n"
    log.write_text(f"Blender reads chair.ply\n{crash}")
    said = cause(log)
    assert said.startswith("error: chair.ply: killed by SIGABRT: too long: Blender crashed")
    log.write_text(f"Blender reads chair.ply\nBlender has read chair.ply\n{crash}")
    assert "chair.ply" not in cause(log)


@pytest.mark.slow
def test_the_file_is_in_the_log_before_blender_crashes(tmp_path):
    """A line of a text that is longer than 64 kB crashes Blender 5.2."""
    path = tmp_path / "a.ply"
    corners = 20000
    head = f"ply\nformat ascii 1.0\nelement vertex {corners}\n"
    head += "property float x\nproperty float y\nproperty float z\nelement face 1\n"
    head += "property list int int vertex_indices\nend_header\n"
    places = "".join(f"{n} 0 0\n" for n in range(corners))
    path.write_text(f"{head}{places}{corners} {' '.join(map(str, range(corners)))}\n")
    program = [sys.executable, SCRIPTS / "import_model.py", "--model", path]
    program += ["--output", tmp_path / "a.blend", "--record", tmp_path / "a.json"]
    result = subprocess.run(program, capture_output=True, text=True, check=False)
    assert result.returncode == -signal.SIGABRT
    log = tmp_path / "log"
    log.write_text(f"{result.stdout}{result.stderr}error: killed by SIGABRT\n")
    assert cause(log).startswith(f"error: {path}: killed by SIGABRT: PLY text line did not fit")


@pytest.mark.parametrize(
    ("problem", "said"),
    [
        (MemoryError(), "error: out of memory: lower --cores"),
        (OSError(28, "No space left on device", "/tmp/a"), "error: /tmp/a: No space left on"),
        (OSError(27, "File too large"), "error: File too large; "),
        (FileNotFoundError(2, "No usable temporary directory"), "error: No usable temporary"),
    ],
)
def test_an_error_of_the_operating_system_is_one_line(problem, said):
    def main():
        raise problem

    with pytest.raises(SystemExit) as caught:
        run(main)
    assert str(caught.value).startswith(said)


@pytest.mark.parametrize(
    "name", ["view.exr", "view.png", "lens_map.npy", "record.json", "log.jsonl", "poses.csv"]
)
def test_a_file_without_read_permission_is_named_with_the_cause(name, nobody):
    path = nobody / name
    path.write_bytes(b"anything")
    path.chmod(0)
    readers = {".exr": images.read_image, ".png": images.read_header, ".npy": lens_map.load}
    readers |= {".json": files.read_json, ".jsonl": files.read_json_lines}
    readers[".csv"] = lambda path: from_settings({"type": "poses", "file": str(path)}).poses()
    with pytest.raises(UserError) as caught:
        readers[path.suffix](path)
    assert str(caught.value).startswith(f"{path}: cannot be read: you may not read it: change")


def test_a_cause_that_many_jobs_share_is_said_once(tmp_path):
    causes = {"a": "error: no GPU", "b": "error: no GPU", "c": "error: full"}
    jobs = [("render", why, tmp_path / name) for name, why in causes.items()]
    assert failure_report(jobs).splitlines() == [
        "render failed: error: no GPU",
        f"  log: {tmp_path / 'a'} (and 1 more with the same cause)",
        "render failed: error: full",
        f"  log: {tmp_path / 'c'}",
    ]


def test_a_very_long_message_keeps_its_beginning_and_its_end():
    message = str(UserError(f"a.json: name: is {'x' * 9000}; must be a text\n\x1b[2J"))
    assert message.startswith("a.json: name: is xxx")
    assert message.endswith(r"; must be a text\n\x1b[2J")
    assert len(message) < 2100
