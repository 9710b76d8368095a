# What the shell of each job does before its program.
import shlex
import sys
from pathlib import Path

from lightfield.workflow.view_store import VARIABLE

# The rules call `python`: the one that runs Snakemake, or a container's own.
OWN_PYTHON = (
    ""
    if USES_CONTAINERS
    else f" export PATH={shlex.quote(str(Path(sys.executable).parent))}:$PATH;"
)
# This replaces Snakemake's own prefix, including its strict mode. It also writes the signal that
# ended a program into the job's log.
shell.prefix(
    f"set -euo pipefail; export {VARIABLE}={shlex.quote(STORE)};{OWN_PYTHON}"
    # numpy would start a thread for each core, also in jobs that have one core.
    " export OPENBLAS_NUM_THREADS=1;"
    # A signal to the whole group must not end the shell first.
    " trap : TERM;"
    ' python() {{ command python "$@" || {{ local status=$?; if ((status > 128)); then'
    ' echo "error: killed by SIG$(kill -l $status)" >&2; fi; return $status; }}; }}; '
)
