"""Runs Snakemake's command line in forks of one process, so that tests import it only once.

Half of the time of a short run are Snakemake's imports and those of its plugins. Each fork reads
the Snakefile and the library of its checkout anew, as a process of its own does.
"""

import atexit
import importlib
import json
import os
import pkgutil
import subprocess
import sys
import tempfile
from pathlib import Path

PLUGINS = ("snakemake_executor_plugin_", "snakemake_logger_plugin_", "snakemake_storage_plugin_")
# The servers of this test process that have started, by the command that starts them.
STARTED = {}


def run(arguments, folder, env=None, merge_outputs=False, prefix=()):
    """Run ``snakemake`` with arguments in a folder. Return its CompletedProcess.

    ``env`` adds to the environment. ``merge_outputs`` writes stderr to stdout. ``prefix`` is a
    command that runs another, such as ``nice``.
    """
    server = _server(tuple(prefix))
    with tempfile.TemporaryFile() as stdout, tempfile.TemporaryFile() as stderr:
        files = [f"/proc/{os.getpid()}/fd/{file.fileno()}" for file in (stdout, stderr)]
        request = {
            "arguments": [str(argument) for argument in arguments],
            "folder": str(Path(folder).absolute()),
            "env": os.environ | (env or {}),
            "stdout": files[0],
            "stderr": None if merge_outputs else files[1],
        }
        server.stdin.write(f"{json.dumps(request)}\n")
        server.stdin.flush()
        returncode = int(server.stdout.readline())
        texts = [Path(file).read_text() for file in files]
    return subprocess.CompletedProcess(arguments, returncode, *texts)


def _server(prefix):
    """Return the process that forks. Starts it for the first run of a test process."""
    if prefix not in STARTED:
        process = subprocess.Popen(
            [*prefix, sys.executable, Path(__file__)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        STARTED[prefix] = process
        atexit.register(process.kill)
    return STARTED[prefix]


def serve():
    """Fork for each request on stdin. Write the exit status of each to stdout."""
    # The folder of this file is not on the path of Snakemake's own command.
    sys.path.remove(str(Path(__file__).parent))
    cli = importlib.import_module("snakemake.cli")
    for module in pkgutil.iter_modules():
        if module.name.startswith(PLUGINS):
            importlib.import_module(module.name)
    for line in iter(sys.stdin.readline, ""):
        child = os.fork()
        if not child:
            _become(json.loads(line))
            cli.main()
            return
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


def _become(request):
    """Turn a fork into the process of a request."""
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["env"])
    sys.path[:0] = filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))
    sys.argv = ["snakemake", *request["arguments"]]
    _redirect(0, os.open(os.devnull, os.O_RDONLY))
    _redirect(1, os.open(request["stdout"], os.O_WRONLY))
    if request["stderr"]:
        _redirect(2, os.open(request["stderr"], os.O_WRONLY))
    else:
        os.dup2(1, 2)


def _redirect(descriptor, other):
    """Let a descriptor be the file of another one, which is closed."""
    os.dup2(other, descriptor)
    os.close(other)


if __name__ == "__main__":
    serve()
