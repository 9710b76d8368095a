# What the shell of each job does before its program.
import shlex
import sys
from pathlib import Path

from lightfield.core.bundles import VARIABLE

# The rules call `python`: the one that runs Snakemake, or a container's own.
OWN_PYTHON = (
    f" [[ -v APPTAINER_CONTAINER ]] ||"
    f" export PATH={shlex.quote(str(Path(sys.executable).parent))}:$PATH;"
)
# This replaces Snakemake's own prefix, including its strict mode. It also writes the signal that
# ended a program into the job's log. Programs get the paths of the rules: see use_copies().
shell.prefix(
    f"set -euo pipefail; export {VARIABLE}={shlex.quote(STORE)}; copies={COPIES};{OWN_PYTHON}"
    # Their messages are read as UTF-8, wherever the user is.
    " export PYTHONUTF8=1;"
    # numpy would start a thread for each core, also in jobs that have one core.
    " export OPENBLAS_NUM_THREADS=1;"
    # A signal to the whole group must not end the shell first.
    " trap : TERM INT;"
    ' python() {{ command python "${{@#"$copies"}}" || {{ local status=$?; if ((status > 128)); then'
    ' echo "error: killed by SIG$(kill -l $status)" >&2; fi; return $status; }}; }}; '
)
