"""Runs a command against a Slurm cluster of one node, this machine, from Debian's packages.

python tests/slurm_node.py FOLDER COMMAND ...

Installs missing packages (as root, with apt), starts the daemons, runs the command, and stops the
daemons. These write into FOLDER and listen on the loopback address. The only files outside FOLDER
are slurm.conf and cgroup.conf in /etc/slurm, where a job's steps look for the cluster. They are
removed at the end. If this program is killed, the daemons end too, and the next run replaces the
files. If file systems can be mounted, the node's temporary files lie on a small disk of its own.
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
from waiting import wait_until

PACKAGES = {
    "slurmctld": "slurmctld",
    "slurmd": "slurmd",
    "sbatch": "slurm-client",
    "munged": "munge",
}
# Slurm's commands look here by default. The executor hides SLURM_CONF from a job's steps.
CONFIGURED = Path("/etc/slurm/slurm.conf")
# Later versions of Slurm do not start in a container without this. Earlier ones do not know it.
CGROUPS = CONFIGURED.with_name("cgroup.conf")
WITHOUT_CGROUPS = "CgroupPlugin=disabled\n"
FIRST_VERSION_WITHOUT_CGROUPS = (23, 2)
# Debian installs daemons where not every user's PATH leads.
PATH = f"{os.environ['PATH']}:/usr/sbin:/sbin"
# Mounts a disk that only the node's daemon and its jobs see.
DISK = 'mount -t tmpfs -o size=64m node "$0" && mount --bind "$0" /dev/shm && exec "$@"'

CLUSTER = "ClusterName=plenoforge\n"
CONFIGURATION = """SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller_port}
SlurmdPort={node_port}
SlurmUser=root
# A job that lost its node is submitted again after this many seconds.
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
    """Install missing packages. Exits with the command to run if that is not allowed."""
    missing = [name for program, name in PACKAGES.items() if not shutil.which(program, path=PATH)]
    if not missing:
        return
    command = ["apt-get", "--quiet=2", "install", "--yes", "--no-install-recommends", *missing]
    if os.geteuid() != 0:
        sys.exit(f"error: Slurm is missing; on Debian or Ubuntu: sudo {' '.join(command)}")
    environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
    for arguments in (["apt-get", "--quiet=2", "update"], command):
        subprocess.run(arguments, env=environment, check=True, stdout=subprocess.DEVNULL)


class Node:
    """One node and its controller. ``environment`` is for commands that use them.

    ``own_disk`` is a command prefix under which another command sees the node's disk. It is empty
    without such a disk.
    """

    def __init__(self, folder: Path, memory: int = 16000) -> None:
        """``memory`` is the node's memory in MB."""
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
            sys.exit(f"error: {CONFIGURED} exists: this machine already belongs to a cluster")
        CONFIGURED.write_text(content)
        if _version() >= FIRST_VERSION_WITHOUT_CGROUPS and not CGROUPS.exists():
            CGROUPS.write_text(WITHOUT_CGROUPS)
        self.environment = os.environ | {"PATH": PATH, "TMPDIR": f"{folder}/disk"}
        self.own_disk = ["unshare", "--mount", "sh", "-c", DISK, f"{folder}/disk"]
        if subprocess.run([*self.own_disk, "true"], capture_output=True, check=False).returncode:
            self.own_disk = []
        self.daemons: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> "Node":
        folder = self.folder
        munge = [f"--{name}-file={folder}/munge.{name}" for name in ("key", "pid", "log", "seed")]
        try:
            self.start("munged", "--force", f"--socket={folder}/munge.socket", *munge)
            self.start("slurmctld", "-D")
            self.start_node()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.run("scancel", "--state=RUNNING", "--full")
        for daemon in reversed(self.daemons.values()):
            daemon.terminate()
        for daemon in self.daemons.values():
            daemon.wait(30)
        CONFIGURED.unlink()
        if CGROUPS.exists() and CGROUPS.read_text() == WITHOUT_CGROUPS:
            CGROUPS.unlink()

    def start(self, daemon: str, *arguments: str) -> None:
        """Start a daemon in the foreground, as a child of this process."""
        command = [daemon, *arguments, *(["--foreground"] if daemon == "munged" else [])]
        # The daemons do not end with a killed parent, so the kernel must kill them.
        command = ["setpriv", "--pdeathsig", "KILL", *command]
        command = [*(self.own_disk if daemon == "slurmd" else []), *command]
        with (self.folder / f"{daemon}.out").open("ab") as output:
            self.daemons[daemon] = subprocess.Popen(
                command, env=self.environment, stdout=output, stderr=output
            )

    def start_node(self) -> None:
        """Start the node's own daemon, and wait until the controller knows it."""
        self.start("slurmd", "-D")
        up = ("idle", "mixed", "allocated")
        wait_until(lambda: self.state() in up, self.daemons["slurmd"], 60)

    def fill_disk(self) -> Path:
        """Fill the node's own disk to the last byte. Return the file that fills it."""
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

    def run(self, *arguments: str) -> str:
        """Run one of Slurm's commands. Return its output."""
        result = subprocess.run(
            arguments, env=self.environment, capture_output=True, text=True, check=False
        )
        return result.stdout.strip()

    def state(self) -> str:
        return self.run("sinfo", "--noheader", "--format=%T").rstrip("*")


def _is_left_behind(configuration: str) -> bool:
    """Return whether a killed run of this program left the file: it is ours, and no daemon runs."""
    running = any(
        process.info["name"] == "slurmctld" and process.info["status"] != psutil.STATUS_ZOMBIE
        for process in psutil.process_iter(["name", "status"])
    )
    return configuration.startswith(CLUSTER) and not running


def _version() -> tuple[int, ...]:
    """Return the year and the month of Slurm's version."""
    environment = os.environ | {"PATH": PATH}
    command = ["slurmd", "-V"]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    year, month = result.stdout.split()[-1].split(".")[:2]
    return int(year), int(month)


def _free_port() -> int:
    with socket.socket() as free_socket:
        free_socket.bind(("127.0.0.1", 0))
        return free_socket.getsockname()[1]


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
