"""Runs Snakemake and the programs in forks of processes that have imported what these need.

Most of the time of a short run are imports. A server imports the libraries. It starts a process for
each folder with the project's code, such as a test's checkout, which imports that code and forks.
Blender's library is loaded by the server, and counts the processors. Blender is imported in the
fork, because its import starts threads, which a fork lacks.
"""

import atexit
import ctypes
import gc
import importlib
import importlib.util
import marshal
import multiprocessing.process
import os
import resource
import runpy
import select
import shlex
import signal
import socket
import subprocess
import sys
import tempfile
import traceback
from contextlib import ExitStack, suppress
from pathlib import Path

LIBRARIES = (
    # What Snakemake imports when it reads a Snakefile.
    "snakemake.report",
    "snakemake.report.html_reporter",
    "snakemake.storage",
    "graphlib",
    "smart_open",
    # What the programs import.
    "numba",
    "numba.cpython.numbers",
    "numba.np.linalg",
    "OpenEXR",
    "OpenImageIO",
    "PIL.Image",
    "PIL.ImageOps",
    "pydantic.functional_serializers",
    "psutil",
    "statistics",
    "tomllib",
    "yaml",
    "scipy.ndimage",
    "scipy.optimize",
    "scipy.spatial",
    "scipy.stats",
    "skimage.exposure",
    "skimage.metrics",
    "skimage.util",
    "matplotlib.pyplot",
    "matplotlib.style",
    "matplotlib.backends.backend_svg",
)
# What Blender imports. Not every version needs, and brings, all of it.
BLENDER_LIBRARIES = ("cattrs.preconf.json", "requests")
# What many programs import of the project's code. None of it imports Blender.
CODE = (
    "lightfield.core.failures",
    "lightfield.core.leftovers",
    "lightfield.core.run_display",
    "lightfield.dataset.job_settings",
    "lightfield.dataset.loading",
    "lightfield.dataset.shard_files",
    "lightfield.export.instant_ngp",
    "lightfield.measurement.forecast",
    "lightfield.report.page",
    "lightfield.reprojection.job",
    "lightfield.validation.consistency",
)
# Tests use few folders at a time, and a process for each takes memory.
MOST_IMPORTERS = 12
# A request has the environment, which is the largest part of it.
MOST_BYTES = 200_000
# Stands for python. It starts forks for programs and Snakemake, and processes for all else.
PYTHON = """#!/bin/sh
case "$1" in
*.py) exec {python} -IS {client} {socket} "$@" ;;
-m) [ "$2" != snakemake ] || {{ shift 2 && exec {snakemake} "$@"; }} ;;
esac
exec {python} "$@"
"""
SNAKEMAKE = """#!/bin/sh
exec {python} -IS {client} {socket} snakemake.py "$@"
"""
# Names the python that runs the programs of Snakemake's jobs in processes of their own. They start
# faster than forks if they import no large library.
PYTHON_OF_JOBS = "PYTHON_OF_JOBS"
# The exit status of a fork, once its program has ended.
STATUS = []
# The states of the files with the project's code, when it was imported.
STATES = {}
# Names the folder of the server that all test processes share.
SHARED = "SERVER_OF_FORKS"
# The folders of the servers that this test process uses, by the command that starts them.
_FOLDERS = {}


def run_snakemake(arguments, folder, env=None, merge_outputs=False, prefix=()):
    """Run ``snakemake`` with arguments in a folder. Return its CompletedProcess.

    ``env`` adds to the environment. ``merge_outputs`` writes stderr to stdout. ``prefix`` is a
    command that runs another, such as ``nice``.
    """
    return subprocess.run(
        [python(prefix), "snakemake.py", *map(str, arguments)],
        cwd=Path(folder).absolute(),
        env=os.environ | (env or {}),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT if merge_outputs else subprocess.PIPE,
        text=True,
        check=False,
    )


def python(prefix=()):
    """Return the path of a ``python`` that runs programs in forks. Starts their server if need be.

    A ``snakemake`` is beside it.
    """
    prefix = tuple(map(str, prefix))
    if prefix not in _FOLDERS:
        shared = None if prefix else os.environ.get(SHARED)
        _FOLDERS[prefix] = Path(shared) if shared else start_server(prefix)
    return _FOLDERS[prefix] / "python"


def share_server():
    """Start a server for the test processes that this process will start."""
    os.environ[SHARED] = str(start_server())


def start_server(prefix=()):
    """Start a server, with ``prefix`` before its command. Return its folder."""
    home = tempfile.TemporaryDirectory(prefix="forks")
    atexit.register(home.cleanup)
    folder = Path(home.name)
    names = {"python": sys.executable, "client": Path(__file__).with_name("fork_client.py")}
    names |= {"socket": folder / "socket", "snakemake": folder / "snakemake"}
    quoted = {name: shlex.quote(str(path)) for name, path in names.items()}
    for name, script in (("python", PYTHON), ("snakemake", SNAKEMAKE)):
        (folder / name).write_text(script.format(**quoted))
        (folder / name).chmod(0o755)
    # Clients can connect at once, and wait until the server has imported the libraries.
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(str(names["socket"]))
        listener.listen(64)
        server = subprocess.Popen(
            [*prefix, sys.executable, Path(__file__), folder, str(listener.fileno())],
            pass_fds=[listener.fileno()],
        )
    atexit.register(server.kill)
    return folder


class Server:
    """Passes requests to processes that fork.

    ``folder`` holds the python that starts forks. Clients connect to the socket ``listener``.
    ``importers`` are the connections to the processes that fork, by the folder of the code that
    each has imported. The last one is the one that was used last.
    """

    def __init__(self, folder, listener):
        self.folder = folder
        self.listener = listener
        self.importers = {}
        self.requested = set()

    def pass_request(self):
        """Wait for a request, and pass it on."""
        with ExitStack() as opened:
            client, _ = self.listener.accept()
            opened.enter_context(client)
            message, descriptors, _, _ = socket.recv_fds(client, MOST_BYTES, 3)
            for descriptor in descriptors:
                opened.callback(os.close, descriptor)
            # A client that was killed sends nothing.
            if message:
                code = find_code(marshal.loads(message))
                # An import pays only if another program needs it, too.
                importer = self.importer_of(code if code in self.requested else None, opened)
                self.requested.add(code)
                socket.send_fds(importer, [message], [*descriptors, client.fileno()])

    def importer_of(self, code, opened):
        """Return the connection to the process that has imported the code in a folder.

        Starts this process if need be, without the files in ``opened``.
        """
        if code in self.importers:
            self.importers[code] = self.importers.pop(code)
            return self.importers[code]
        connection, requests = socket.socketpair(type=socket.SOCK_SEQPACKET)
        if not os.fork():
            opened.close()
            for inherited in (self.listener, connection, *self.importers.values()):
                inherited.close()
            import_code(code)
            fork_for(requests, self.folder)
            sys.exit()
        requests.close()
        self.importers[code] = connection
        if len(self.importers) > MOST_IMPORTERS:
            self.importers.pop(next(iter(self.importers))).close()
        return connection


def serve(folder, listener):
    """Serve requests on a socket, for ever."""
    # The first function that is registered is called last.
    atexit.register(leave)
    import_libraries()
    server = Server(folder, listener)
    while True:
        server.pass_request()


def import_libraries():
    """Import what Snakemake and many programs import."""
    for name in ("snakemake.cli", *LIBRARIES):
        importlib.import_module(name)
    # Finds and imports the plugins, also that of this folder. Snakemake searches once in a process.
    sys.modules["snakemake.cli"].get_argument_parser()
    # The folder of this file is not on the path of other programs.
    sys.path.remove(str(Path(__file__).parent))
    for name in BLENDER_LIBRARIES:
        with suppress(ModuleNotFoundError):
            importlib.import_module(name)
    # These libraries import most of themselves at the first model and at the first image.
    pydantic = sys.modules["pydantic"]
    pydantic.TypeAdapter(pydantic.create_model("First", value=int)).json_schema()
    sys.modules["PIL.Image"].init()
    # Numba would compile its runtime for the first kernel.
    target = sys.modules["numba.core.registry"].cpu_target
    sys.modules["numba.core.runtime"].rtsys.initialize(target.target_context)
    ctypes.CDLL(importlib.util.find_spec("bpy").origin)
    # The collector would copy the memory of each fork. The forks end before they need it.
    gc.freeze()
    gc.disable()


def find_code(request):
    """Return the folder from which a request would import the project's code, or None."""
    program = request["arguments"][0]
    # The Snakefile and a program import from the folder of the programs first.
    own_folder = "scripts" if program == "snakemake.py" else Path(program).parent
    for name in (own_folder, *request["env"].get("PYTHONPATH", "").split(os.pathsep)):
        folder = Path(request["folder"], name)
        if (folder / "lightfield").is_dir():
            return folder
    return None


def import_code(folder):
    """Import what many programs import of the project's code in a folder, if there is one."""
    if folder is None:
        return
    sys.path.insert(0, str(folder))
    for name in CODE:
        # A test may have broken the code. Its program then fails by itself.
        with suppress(Exception):
            importlib.import_module(name)
    sys.path.remove(str(folder))
    # Pydantic would build a model's validator for the first value that it checks.
    for model in subclasses(sys.modules["pydantic"].BaseModel):
        if model.__module__.startswith("lightfield."):
            with suppress(Exception):
                model.model_rebuild()
    for name in own_names():
        file = Path(sys.modules[name].__file__)
        STATES[file] = state_of(file)
    gc.freeze()


def subclasses(base):
    """Return all classes below a class."""
    children = base.__subclasses__()
    return [*children, *(below for child in children for below in subclasses(child))]


def own_names():
    """Return the names of the project's modules that are imported."""
    return [name for name in sys.modules if name.partition(".")[0] == "lightfield"]


def state_of(file):
    """Return what changes if a file is written. None if the file is missing.

    The project has such a function, but a fork must import it from the folder of its program.
    """
    with suppress(FileNotFoundError):
        status = file.stat()
        return status.st_mtime_ns, status.st_size
    return None


def forget_changed_code():
    """Let a fork import the project's code anew, if a test has changed it since its import."""
    if any(state_of(file) != state for file, state in STATES.items()):
        for name in own_names():
            del sys.modules[name]


def fork_for(requests, folder):
    """Fork for each request on a connection, until it is closed and all forks have ended."""
    forks = []
    is_open = True
    while is_open or forks:
        watched = [fork.ended for fork in forks] + [fork.client for fork in forks]
        ready, _, _ = select.select([requests, *watched] if is_open else watched, [], [])
        for fork in [*forks]:
            if fork.ended in ready:
                fork.pass_status()
                forks.remove(fork)
            elif fork.client in ready:
                fork.pass_signal()
        if requests not in ready:
            continue
        message, descriptors, _, _ = socket.recv_fds(requests, MOST_BYTES, 4)
        if not message:
            is_open = False
            continue
        *standard, client = descriptors
        process = os.fork()
        if not process:
            requests.close()
            os.close(client)
            for fork in forks:
                fork.close()
            run(marshal.loads(message), standard, folder)
            sys.exit()
        for descriptor in standard:
            os.close(descriptor)
        os.setpgid(process, process)
        forks.append(Fork(process, socket.socket(fileno=client)))


class Fork:
    """A fork, and the connection of the client that it runs for."""

    def __init__(self, process, client):
        self.process = process
        self.client = client
        self.ended = os.pidfd_open(process)

    def close(self):
        os.close(self.ended)
        self.client.close()

    def pass_signal(self):
        """Send the fork a signal that its client got.

        If the client was killed, kill the fork with all processes that it started.
        """
        number = self.client.recv(16)
        if number:
            os.kill(self.process, int(number))
        else:
            os.killpg(self.process, signal.SIGKILL)

    def pass_status(self):
        """Send the client the exit status of the fork, which has ended."""
        _, status = os.waitpid(self.process, 0)
        with suppress(OSError):
            self.client.send(str(os.waitstatus_to_exitcode(status)).encode())
        self.close()


def run(request, descriptors, folder):
    """Turn a fork into the process of a request, and run its program until it ends."""
    try:
        forget_changed_code()
        become(request, descriptors)
        run_program(folder)
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
            end.code = 1
        STATUS.append(end.code or 0)
    except BaseException:
        traceback.print_exc()
        STATUS.append(1)


def leave():
    """End a fork at once. Python would first free all libraries, which takes 0.4 s."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(*STATUS or [0])


def become(request, descriptors):
    """Turn a fork into the process of a request."""
    os.chdir(request["folder"])
    # New processes look there for a program at a relative path.
    multiprocessing.process.ORIGINAL_DIR = request["folder"]
    os.environ.clear()
    os.environ.update(request["env"])
    resource.setrlimit(resource.RLIMIT_FSIZE, request["largest_file"])
    for target, descriptor in enumerate(descriptors):
        os.dup2(descriptor, target)
        os.close(descriptor)
    sys.path[:0] = filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))
    sys.argv = request["arguments"]


def run_program(folder):
    """Run the program of the command line, which may be Snakemake."""
    program = sys.argv[0]
    # The programs that it starts run in forks, too.
    sys.executable = os.environ.get(PYTHON_OF_JOBS, f"{folder}/python")
    if program == "snakemake.py":
        sys.argv[0] = "snakemake"
        importlib.import_module("snakemake.cli").main()
        return
    # As a program does itself, to be isolated from the user's environment.
    os.environ["BLENDER_USER_RESOURCES"] = str(folder)
    sys.path.insert(0, str(Path(program).resolve().parent))
    runpy.run_path(program, run_name="__main__")


if __name__ == "__main__":
    serve(Path(sys.argv[1]), socket.socket(fileno=int(sys.argv[2])))
