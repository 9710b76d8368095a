"""A Slurm cluster of one node, this machine, from Debian's packages: start it, use it, stop it.

    python tests/slurm_node.py FOLDER COMMAND ...

installs what is missing (as root, by apt), starts the daemons with all that they write in FOLDER,
runs the command against them, and stops them. Everything listens on the loopback address. The one
file outside FOLDER is /etc/slurm/slurm.conf, where a job's steps find the cluster; it goes again.
If this program is killed, its daemons go with it, and the next one takes the file's place.
Where file systems may be mounted, the node's temporary files lie on a small disk of its own.
"""

import argparse
import os
import secrets
import shutil
import socket
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import psutil
from checkouts import wait_until

PACKAGES = {
    "slurmctld": "slurmctld",
    "slurmd": "slurmd",
    "sbatch": "slurm-client",
    "munged": "munge",
}
# Where Slurm's commands look by themselves: the executor hides SLURM_CONF from a job's steps.
CONFIGURED = Path("/etc/slurm/slurm.conf")
# Debian puts daemons where not every user looks.
PATH = f"{os.environ['PATH']}:/usr/sbin:/sbin"
# Mounted for the node's daemon and its jobs alone.
DISK = 'mount -t tmpfs -o size=64m node "$0" && mount --bind "$0" /dev/shm && exec "$@"'

CLUSTER = "ClusterName=plenoforge\n"
CONFIGURATION = """SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller_port}
SlurmdPort={node_port}
SlurmUser=root
# A job that lost its node is submitted anew after so many seconds.
AuthInfo=socket={folder}/munge.socket,cred_expire=20
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
# A job that takes more memory than it asked for is killed within a second.
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=1
JobAcctGatherParams=OverMemoryKill
# A node that does not answer is down soon, and up again when it does.
SlurmdTimeout=10
ReturnToService=2
KillWait=2
MinJobAge=600
SchedulerParameters=sched_interval=2,batch_sched_delay=1
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} RealMemory={memory} State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def install() -> None:
    """Install the packages that are not there; exits with the line to run if that cannot be."""
    missing = [name for program, name in PACKAGES.items() if not shutil.which(program, path=PATH)]
    if not missing:
        return
    command = ["apt-get", "--quiet=2", "install", "--yes", "--no-install-recommends", *missing]
    if os.geteuid() != 0:
        sys.exit(f"error: Slurm is missing; on Debian or Ubuntu: sudo {' '.join(command)}")
    environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
    for words in (["apt-get", "--quiet=2", "update"], command):
        subprocess.run(words, env=environment, check=True, stdout=subprocess.DEVNULL)


class Node:
    """One node and its controller; ``environment`` is what a command needs to use them.

    ``own_disk`` is the command that gives another one the node's disk; empty where there is none.
    """

    def __init__(self, folder: Path, memory: int = 16000) -> None:
        """``memory`` is how many MB the node says it has."""
        self.folder = folder
        for name in ("state", "spool", "disk"):
            (folder / name).mkdir(parents=True, exist_ok=True)
        (folder / "munge.key").write_bytes(secrets.token_bytes(1024))
        (folder / "munge.key").chmod(0o400)
        self.host = socket.gethostname().split(".")[0]
        content = CLUSTER + CONFIGURATION.format(
            host=self.host,
            folder=folder,
            memory=memory,
            cpus=os.cpu_count(),
            controller_port=_free_port(),
            node_port=_free_port(),
        )
        if CONFIGURED.exists() and not _is_left_behind(CONFIGURED.read_text()):
            sys.exit(f"error: {CONFIGURED} is there: this machine belongs to a cluster already")
        CONFIGURED.write_text(content)
        self.environment = os.environ | {"PATH": PATH, "TMPDIR": f"{folder}/disk"}
        self.own_disk = ["unshare", "--mount", "sh", "-c", DISK, f"{folder}/disk"]
        if subprocess.run([*self.own_disk, "true"], capture_output=True, check=False).returncode:
            self.own_disk = []
        self.daemons: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> "Node":
        folder = self.folder
        munge = [f"--{name}-file={folder}/munge.{name}" for name in ("key", "pid", "log", "seed")]
        self.start("munged", "--force", f"--socket={folder}/munge.socket", *munge)
        self.start("slurmctld", "-D")
        self.start_node()
        return self

    def __exit__(self, *_: object) -> None:
        self.run("scancel", "--state=RUNNING", "--full")
        for daemon in reversed(self.daemons.values()):
            daemon.terminate()
        for daemon in self.daemons.values():
            daemon.wait(30)
        CONFIGURED.unlink()

    def start(self, daemon: str, *arguments: str) -> None:
        """Start a daemon in the foreground, as a child of this process."""
        words = [daemon, *arguments, *(["--foreground"] if daemon == "munged" else [])]
        # A killed process ends no child: this lets the kernel do it.
        words = ["setpriv", "--pdeathsig", "KILL", *words]
        words = [*(self.own_disk if daemon == "slurmd" else []), *words]
        with (self.folder / f"{daemon}.out").open("ab") as output:
            self.daemons[daemon] = subprocess.Popen(
                words, env=self.environment, stdout=output, stderr=output
            )

    def start_node(self) -> None:
        """Start the node's own daemon, and wait until the controller knows it."""
        self.start("slurmd", "-D")
        up = ("idle", "mixed", "allocated")
        wait_until(lambda: self.state() in up, self.daemons["slurmd"], 60)

    def fill_disk(self) -> Path:
        """Leave no byte on the node's own disk; return the file that takes them all."""
        filler = Path(f"/proc/{self.daemons['slurmd'].pid}/root{self.folder}/disk/filler")
        with filler.open("wb", buffering=0) as file, suppress(OSError):
            while True:
                file.write(bytes(4096))
        return filler

    def kill_node(self) -> None:
        """Kill the node's daemon and its jobs, as a power cut does."""
        subprocess.run(["pkill", "--signal=KILL", "--full", "slurmstepd:"], check=False)
        self.daemons["slurmd"].kill()
        self.daemons["slurmd"].wait()

    def run(self, *words: str) -> str:
        """Run one of Slurm's commands; returns what it prints."""
        done = subprocess.run(
            words, env=self.environment, capture_output=True, text=True, check=False
        )
        return done.stdout.strip()

    def state(self) -> str:
        return self.run("sinfo", "--noheader", "--format=%T").rstrip("*")


def _is_left_behind(configuration: str) -> bool:
    """Return whether a killed program of these has written it: its daemons are gone."""
    running = any(
        process.info["name"] == "slurmctld" and process.info["status"] != psutil.STATUS_ZOMBIE
        for process in psutil.process_iter(["name", "status"])
    )
    return configuration.startswith(CLUSTER) and not running


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="for all that the daemons write")
    parser.add_argument("command", nargs=argparse.REMAINDER, help="what to run against them")
    arguments = parser.parse_args()
    install()
    with Node(arguments.folder.resolve()) as node:
        sys.exit(subprocess.run(arguments.command, env=node.environment, check=False).returncode)


if __name__ == "__main__":
    main()
