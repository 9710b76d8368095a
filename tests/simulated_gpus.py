"""Simulates what NVIDIA's driver tells of a machine's GPUs."""

import sys

PROGRAM = """#!{python} -IS
import sys
rows = {rows}
(query,) = [word for word in sys.argv if word.startswith("--query-gpu=")]
for row in rows:
    print(", ".join(str(row[field]) for field in query.partition("=")[2].split(",")))
"""


def write_nvidia_smi(folder, rows):
    """Write a program nvidia-smi into ``folder``. Each row has the fields of a GPU."""
    program = folder / "nvidia-smi"
    program.unlink(missing_ok=True)
    program.write_text(PROGRAM.format(python=sys.executable, rows=rows))
    program.chmod(0o755)
