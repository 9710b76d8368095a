"""Asks the server of forks.py for a fork that runs a program, and ends as the fork does.

The modules socket, signal and json import enum and re, and array imports collections. This takes
longer than all else here. So this program uses what lies behind them.
"""

import _signal
import _socket
import _struct
import marshal
import os
import resource
import sys

# A program with one of these words in its text imports Blender itself. Others leave it to processes
# that they start, to which they pass the path on which they found their modules.
BLENDER = b"bpy", b"lightfield.rendering"


def server_of(program):
    """Return the name of the server that forks for a program."""
    try:
        # The import of pathlib takes long.
        with open(program, "rb") as file:  # noqa: PTH123
            text = file.read()
    except OSError:
        # Snakemake is not a file. The fork says so of any other.
        return "plain"
    return "blender" if any(word in text for word in BLENDER) else "plain"


sockets, *arguments = sys.argv[1:]
connection = _socket.socket(_socket.AF_UNIX, _socket.SOCK_SEQPACKET)
connection.connect(f"{sockets}/{server_of(arguments[0])}")
folder = os.getcwd()  # noqa: PTH109
request = {"arguments": arguments, "folder": folder, "env": dict(os.environ)}
request["largest_file"] = resource.getrlimit(resource.RLIMIT_FSIZE)
descriptors = _struct.pack("3i", 0, 1, 2)
rights = (_socket.SOL_SOCKET, _socket.SCM_RIGHTS, descriptors)
connection.sendmsg([marshal.dumps(request)], [rights])
for number in (_signal.SIGINT, _signal.SIGTERM, _signal.SIGHUP):
    _signal.signal(number, lambda number, _: connection.send(str(number).encode()))
answer = connection.recv(16)
status = int(answer) if answer else 1
if status < 0:
    if -status != _signal.SIGKILL:
        _signal.signal(-status, _signal.SIG_DFL)
    os.kill(os.getpid(), -status)
sys.exit(status)
