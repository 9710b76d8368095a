"""Kernels: their machine code is kept for the next process, whatever others save meanwhile."""

import os
import subprocess

import forks
import pytest
from conftest import ROOT

# Doubles numbers of a type. Prints the result, and how often the machine code was found.
PROGRAM = """
import sys
import numpy as np
from lightfield.core.compiled import kernel

@kernel
def doubled(values):
    return values + values

sys.stdin.readline()
for name in sys.argv[1:]:
    print(doubled(np.ones(1, name))[0])
print(sum(doubled.stats.cache_hits.values()))
"""
TYPES = [f"{kind}{size}" for kind in ("int", "uint") for size in (8, 16, 32, 64)]
TYPES += ["float32", "float64", "complex64", "complex128"]


@pytest.mark.slow
def test_processes_that_compile_a_kernel_at_the_same_time_keep_it_for_all_types(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)

    def start(*types):
        return subprocess.Popen(
            [forks.python(), program, *types],
            env=os.environ | {"PYTHONPATH": str(ROOT / "scripts")},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    processes = [start(name) for name in TYPES]
    for process in processes:
        process.stdin.write("\n")
        process.stdin.flush()
    for process in processes:
        assert process.wait() == 0
    said, _ = start(*TYPES).communicate("\n")
    *results, hits = said.split()
    assert [complex(result) for result in results] == [2] * len(TYPES)
    assert int(hits) == len(TYPES)
