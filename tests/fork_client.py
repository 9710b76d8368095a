"""Asks the server of forks.py for a fork that runs a program, and ends as the fork does."""

import json
import os
import resource
import signal
import socket
import sys

path, *arguments = sys.argv[1:]
connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
connection.connect(path)
# The import of pathlib takes as long as all of this.
folder = os.getcwd()  # noqa: PTH109
request = {"arguments": arguments, "folder": folder, "env": dict(os.environ)}
request["largest_file"] = resource.getrlimit(resource.RLIMIT_FSIZE)
socket.send_fds(connection, [json.dumps(request).encode()], [0, 1, 2])
for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    signal.signal(number, lambda number, _: connection.send(str(number).encode()))
answer = connection.recv(16)
status = int(answer) if answer else 1
if status < 0:
    if -status != signal.SIGKILL:
        signal.signal(-status, signal.SIG_DFL)
    os.kill(os.getpid(), -status)
sys.exit(status)
