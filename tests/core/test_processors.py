"""A library sees fewer processors during its import. Later the process uses all of its own."""

import os
import threading
from pathlib import Path

import pytest

from lightfield.core import processors


def test_every_thread_may_use_all_processors_again():
    allowed = os.sched_getaffinity(0)
    done = threading.Event()
    with processors.only(1):
        assert processors.available() == 1
        thread = threading.Thread(target=done.wait)
        thread.start()
    processors_of_threads = [
        os.sched_getaffinity(int(task.name)) for task in Path("/proc/self/task").iterdir()
    ]
    done.set()
    thread.join()
    assert all(affinity == allowed for affinity in processors_of_threads)
    assert processors.available() == len(allowed)


def test_more_processors_than_exist_means_all():
    allowed = os.sched_getaffinity(0)
    with processors.only(10**6):
        assert os.sched_getaffinity(0) == allowed


def test_an_error_changes_nothing():
    allowed = os.sched_getaffinity(0)
    with pytest.raises(ImportError), processors.only(1):
        raise ImportError
    assert os.sched_getaffinity(0) == allowed


WITHOUT_AFFINITY = """
import os
del os.sched_getaffinity, os.sched_setaffinity
from lightfield.core import processors
with processors.only(1):
    print(processors.available())
"""


def test_a_system_without_processor_affinity_uses_all(run_program, tmp_path):
    program = tmp_path / "program.py"
    program.write_text(WITHOUT_AFFINITY)
    # A fork has imported the module already, with the system's own affinity.
    assert int(run_program(program, in_fork=False).stdout) == os.cpu_count()


PROGRAM = """
import sys
from pathlib import Path
from lightfield.core import processors
with processors.only(int(sys.argv[1])):
    from lightfield.rendering.scenes import blend_file
blend_file.open_scene(Path(sys.argv[2]))
print(len(list(Path("/proc/self/task").iterdir())))
"""


def test_blender_starts_fewer_threads_for_fewer_processors(tmp_path, run_program, room):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    started = []
    for count in (1, 2):
        result = run_program(program, count, room, in_fork=False)
        started.append(int(result.stdout.split()[-1]))
    assert (started[0] < started[1]) == (processors.available() > 1)
