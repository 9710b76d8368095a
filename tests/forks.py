"""Runs Snakemake and the programs in forks of a process that has imported what these need.

Most of the time of a short run are imports. A server imports the libraries and the project's code.
A fork uses the code as its test's checkout's, if that has equal files. A second server also
imports Blender. It forks for the programs that use Blender.
"""

import atexit
import ctypes
import gc
import importlib
import importlib.util
import itertools
import marshal
import multiprocessing.process
import os
import pkgutil
import re
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
from contextlib import suppress
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
    "skimage.exposure",
    "skimage.metrics",
    "skimage.util",
    "matplotlib.pyplot",
    "matplotlib.style",
    "matplotlib.backends.backend_svg",
)
CHECKOUT = Path(__file__).resolve().parents[1]
SCRIPTS = CHECKOUT / "scripts"
# A request has the environment, which is the largest part of it.
MOST_BYTES = 200_000
# Stands for python. It starts forks for programs and Snakemake, and processes for all else.
PYTHON = """#!/bin/sh
case "$1" in
*.py) exec {python} -IS {client} {sockets} "$@" ;;
-m) [ "$2" != snakemake ] || {{ shift 2 && exec {snakemake} "$@"; }} ;;
esac
exec {python} "$@"
"""
SNAKEMAKE = """#!/bin/sh
exec {python} -IS {client} {sockets} snakemake.py "$@"
"""
# Names what runs the programs of Snakemake's jobs in processes of their own, in place of python. It
# is called python, too. A stand-in that imports no large library starts faster than a fork.
PYTHON_OF_JOBS = "PYTHON_OF_JOBS"
# The exit status of a fork, once its program has ended.
STATUS = []
# The times and sizes of the files with the project's code, when it was imported.
STATES = {}
# The variables of the project's modules that hold paths, as pairs of all variables and a name.
PLACES = []
# From Linux's prctl.h.
PR_SET_PDEATHSIG = 1
# Names the folder of the server that all test processes share.
SHARED = "SERVER_OF_FORKS"


def run_snakemake(arguments, folder, env=None, merge_outputs=False):
    """Run ``snakemake`` with arguments in a folder. Return its CompletedProcess.

    ``env`` adds to the environment. ``merge_outputs`` writes stderr to stdout.
    """
    return subprocess.run(
        [python(), "snakemake.py", *map(str, arguments)],
        cwd=Path(folder).absolute(),
        env=os.environ | (env or {}),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT if merge_outputs else subprocess.PIPE,
        text=True,
        check=False,
    )


def python():
    """Return the path of a ``python`` that runs programs in forks. Starts their server if need be.

    A ``snakemake`` is beside it.
    """
    if SHARED not in os.environ:
        share_server()
    return Path(os.environ[SHARED]) / "python"


def share_server():
    """Start a server for this process, and for the test processes that it will start."""
    os.environ[SHARED] = str(start_server())


def start_server():
    """Start a server. Return its folder."""
    home = tempfile.TemporaryDirectory(prefix="forks")
    atexit.register(home.cleanup)
    folder = Path(home.name)
    names = {"python": sys.executable, "client": Path(__file__).with_name("fork_client.py")}
    names |= {"sockets": folder, "snakemake": folder / "snakemake"}
    quoted = {name: shlex.quote(str(path)) for name, path in names.items()}
    for name, script in (("python", PYTHON), ("snakemake", SNAKEMAKE)):
        (folder / name).write_text(script.format(**quoted))
        (folder / name).chmod(0o755)
    # Clients can connect at once, and wait until the server has imported the libraries.
    listeners = [listen(folder / name) for name in ("plain", "blender")]
    numbers = [listener.fileno() for listener in listeners]
    isolation = importlib.import_module("lightfield.core.isolation")
    server = subprocess.Popen(
        [sys.executable, Path(__file__), folder, *map(str, numbers)],
        pass_fds=numbers,
        # The libraries choose kernels by it when they are imported.
        env=isolation.cleaned(os.environ) | isolation.own_variables(),
    )
    for listener in listeners:
        listener.close()
    atexit.register(server.kill)
    return folder


def listen(path):
    """Return a socket at a path to which clients can connect."""
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    listener.bind(str(path))
    listener.listen(64)
    return listener


def start(folder, plain, blender):
    """Import what programs need, and serve the two sockets, one of them for Blender's programs."""
    # The first function that is registered is called last.
    atexit.register(leave)
    import_libraries()
    # Makes the import of Blender an error.
    sys.modules["bpy"] = None
    import_code()
    del sys.modules["bpy"]
    first = os.getpid()
    if os.fork():
        blender.close()
        serve(folder, plain)
    plain.close()
    end_with(first)
    import_blender(folder)
    import_code()
    serve(folder, blender)


def end_with(parent):
    """Let this process be killed when its parent process ends."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        # The parent had ended before.
        sys.exit()


def serve(folder, listener):
    """Fork for each request on a socket, for ever.

    ``folder`` holds the python that starts forks.
    """
    # The collector would copy the memory of each fork. The forks end before they need it.
    gc.freeze()
    gc.disable()
    forks = []
    while True:
        watched = [fork.ended for fork in forks] + [fork.client for fork in forks]
        ready, _, _ = select.select([listener, *watched], [], [])
        for fork in [*forks]:
            if fork.ended in ready:
                fork.pass_status()
                forks.remove(fork)
            elif fork.client in ready:
                fork.pass_signal()
        if listener not in ready:
            continue
        client, _ = listener.accept()
        message, standard, _, _ = socket.recv_fds(client, MOST_BYTES, 3)
        if not message:
            # The client was killed.
            client.close()
            continue
        process = os.fork()
        if not process:
            for inherited in (listener, client, *forks):
                inherited.close()
            run(marshal.loads(message), standard, folder)
            sys.exit()
        for descriptor in standard:
            os.close(descriptor)
        os.setpgid(process, process)
        forks.append(Fork(process, client))


def import_libraries():
    """Import what Snakemake and many programs import."""
    for name in ("snakemake.cli", *LIBRARIES):
        importlib.import_module(name)
    # Finds and imports the plugins, also that of this folder. Snakemake searches once in a process.
    # The checkout's own plugin comes before its copy in the environment, which may be older.
    sys.path.insert(0, str(CHECKOUT / "envs"))
    sys.modules["snakemake.cli"].get_argument_parser()
    sys.path.remove(str(CHECKOUT / "envs"))
    # The folder of this file is not on the path of other programs.
    sys.path.remove(str(Path(__file__).parent))
    # These libraries import most of themselves at the first model and at the first image.
    pydantic = sys.modules["pydantic"]
    pydantic.TypeAdapter(pydantic.create_model("First", value=int)).json_schema()
    sys.modules["PIL.Image"].init()
    # Numba would compile its runtime for the first kernel.
    target = sys.modules["numba.core.registry"].cpu_target
    sys.modules["numba.core.runtime"].rtsys.initialize(target.target_context)


def import_blender(folder):
    """Import Blender without threads, because a fork would lack them.

    Blender takes the user's settings from ``folder``, which has none.
    """
    os.environ["BLENDER_USER_RESOURCES"] = str(folder)
    # The import starts a thread for each processor except the first.
    with sys.modules["lightfield.core.processors"].only(1):
        bpy = importlib.import_module("bpy")
    # Each fork makes its own.
    Path(bpy.app.tempdir).rmdir()
    # OpenEXR's threads remain. Without them, the process that writes a file compresses it.
    maps = Path("/proc/self/maps").read_text().splitlines()
    path = next(line.split()[-1] for line in maps if "/bpy/" in line and "libOpenEXR.so" in line)
    # C++ adds its version's namespace to the name.
    name = re.search(rb"_ZN7Imf_\d_\d20setGlobalThreadCountEi", Path(path).read_bytes())[0]
    ctypes.CDLL(path)[name.decode()](0)
    assert len([*Path("/proc/self/task").iterdir()]) == 1


def import_code():
    """Import the project's code, except for modules that cannot be imported."""
    sys.path.insert(0, str(SCRIPTS))
    for module in pkgutil.walk_packages([SCRIPTS / "lightfield"], "lightfield."):
        with suppress(ImportError):
            importlib.import_module(module.name)
    sys.path.remove(str(SCRIPTS))
    # Pydantic would build a model's validator for the first value that it checks.
    for model in subclasses(sys.modules["pydantic"].BaseModel):
        if model.__module__.startswith("lightfield."):
            model.model_rebuild()
    # So would jinja compile each template.
    environment = sys.modules["lightfield.report.page"].environment()
    for name in environment.list_templates(extensions="j2"):
        environment.get_template(name)
    STATES.update(states(SCRIPTS))
    PLACES.clear()
    for name in own_names():
        variables = vars(sys.modules[name])
        PLACES.extend((variables, key) for key, value in variables.items() if is_place(value))


def subclasses(base):
    """Return all classes below a class."""
    children = base.__subclasses__()
    return [*children, *(below for child in children for below in subclasses(child))]


def is_place(value):
    """Return whether a module's variable is a path in the checkout, or a package's list of them.

    The environment may lie in the checkout. All checkouts share it, so that its paths stay.
    """
    if isinstance(value, list):
        return bool(value) and all(map(is_place, value))
    if not isinstance(value, str | Path) or Path(value).is_relative_to(sys.prefix):
        return False
    return Path(value).is_relative_to(CHECKOUT)


def own_names():
    """Return the names of the project's modules that are imported."""
    return [name for name in sys.modules if name.partition(".")[0] == "lightfield"]


def states(folder):
    """Return the time and the size of each file of the project's code in a folder."""
    times_and_sizes = {}
    for parent, folders, names in os.walk(folder / "lightfield"):
        folders[:] = [name for name in folders if name != "__pycache__"]
        for name in names:
            status = os.stat(f"{parent}/{name}")  # noqa: PTH116 (pathlib takes five times as long)
            path = f"{parent}/{name}".removeprefix(str(folder))
            times_and_sizes[path] = status.st_mtime_ns, status.st_size
    return times_and_sizes


def find_code(request):
    """Return the folder from which a request would import the project's code, or None."""
    program, *arguments = request["arguments"]
    own_folder = Path(program).parent
    if program == "snakemake.py":
        options = dict(itertools.pairwise(arguments))
        own_folder = Path(options.get("--snakefile", "Snakefile")).with_name("scripts")
    # The Snakefile and a program import from the folder of the programs first.
    for name in (own_folder, *request["env"].get("PYTHONPATH", "").split(os.pathsep)):
        folder = Path(request["folder"], name)
        if (folder / "lightfield").is_dir():
            return folder.resolve()
    return None


def take_code(folder):
    """Let a fork use the imported code as the code in a folder, which is a copy of it.

    If a test has changed the files there, the fork imports them itself.
    """
    if folder is None or states(folder) != STATES:
        for name in own_names():
            del sys.modules[name]
    elif folder != SCRIPTS:
        for variables, name in PLACES:
            variables[name] = moved(variables[name], folder.parent)


def moved(place, checkout):
    """Return a path, or a package's list of paths, as it is in another checkout."""
    if isinstance(place, list):
        return [moved(path, checkout) for path in place]
    return type(place)(f"{checkout}{str(place).removeprefix(str(CHECKOUT))}")


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
        take_code(find_code(request))
        become(request, descriptors)
        if "bpy" in sys.modules:
            make_temporary_folder()
        run_program(folder)
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
            end.code = 1
        STATUS.append(end.code or 0)
    except BaseException:
        traceback.print_exc()
        STATUS.append(1)


def make_temporary_folder():
    """Give a fork a folder of its own for Blender's temporary files."""
    paths = sys.modules["bpy"].context.preferences.filepaths
    # Blender makes the folder when the path of its parent is set.
    paths.temporary_directory = paths.temporary_directory


def leave():
    """End a fork at once. Python would first free all libraries, which takes 0.4 s."""
    if "bpy" in sys.modules:
        # Blender would remove its empty folder of temporary files. It may share that of the system.
        with suppress(OSError):
            Path(sys.modules["bpy"].app.tempdir).rmdir()
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
    start(Path(sys.argv[1]), *(socket.socket(fileno=int(number)) for number in sys.argv[2:]))
