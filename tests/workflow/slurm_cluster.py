"""A SLURM cluster of two nodes on this machine's loopback address, from a distribution's packages.

Each node has one core, so that it runs one job at a time. It is a slurmd in host-name, process and mount spaces of its
own: packaged slurmd programs are not built to run twice on one host, and a node that is killed takes its jobs with it.
"""

import ctypes
import os
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path

import psutil

PROGRAMS = {"munged": "munge", "slurmctld": "slurmctld", "slurmd": "slurmd", "sbatch": "slurm-client"}
NODES = ("node1", "node2")
PARTITION = "mines"
CONFIGURATION = Path("/etc/slurm")  # where SLURM's programs look: Snakemake's plugin drops SLURM_CONF from a job
NAMESPACES = ("unshare", "--uts", "--pid", "--mount", "--fork", "--mount-proc", "--kill-child")
PR_SET_PDEATHSIG = 1  # prctl(2): the signal a process gets when its parent ends
PATIENCE = 120.0  # s, for a slow machine; no result depends on it

SLURM_CONF = """\
ClusterName=loopback
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={port}
SlurmUser=root
AuthType=auth/munge
CredType=cred/munge
# A job of a dead node is run again only when its credentials have expired; 120 s by default.
AuthInfo=socket={folder}/munge.socket,cred_expire=10
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool_%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd_%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd_%n.log
# Without control groups: memory is what jobs ask for, not what they take.
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SchedulerParameters=sched_interval=5,batch_sched_delay=0,sched_min_interval=0
# Without accounting, only squeue knows how a job ended. It forgets the job after this time, s.
MinJobAge=86400
SlurmdTimeout=5
KillWait=5
ReturnToService=2
# A job of a dead node is run again only if it asked for that.
JobRequeue=0
"""


def reason_against() -> str:
    """Why no cluster can be started here; empty if one can."""
    if missing := sorted(package for program, package in PROGRAMS.items() if shutil.which(program) is None):
        return f"needs the packages {', '.join(missing)}"
    if os.geteuid() != 0:
        return "needs root, for nodes in spaces of their own"
    if not CONFIGURATION.is_dir():
        return f"needs {CONFIGURATION}, for the nodes' configuration"
    tried = subprocess.run([*NAMESPACES, "mount", "--bind", "/tmp", str(CONFIGURATION)], capture_output=True, text=True)
    return "" if tried.returncode == 0 else f"needs namespaces: {tried.stderr.strip()}"


def die_with_parent() -> None:
    """End with the test run: no daemon outlives it, however it ends."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


class Cluster:
    """The cluster, as a context manager. folder: a new one, of a short path (its socket's name has a limit)."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.environment = os.environ | {"SLURM_CONF": str(folder / "slurm.conf")}
        self.daemons: dict[str, subprocess.Popen] = {}

    def __enter__(self) -> "Cluster":
        (self.folder / "state").mkdir(parents=True)
        (self.folder / "slurm.conf").write_text(self._configuration())
        key = self.folder / "munge.key"
        key.touch(mode=0o600)
        key.write_bytes(os.urandom(128))
        self.folder.chmod(0o755)
        try:
            self._start_munge(key)
            self._start("slurmctld", "slurmctld", "-D", "-c", "-f", self.environment["SLURM_CONF"])
            for node in NODES:
                self.start_node(node)
            self.await_(lambda: self.states() == dict.fromkeys(NODES, "idle"), "two idle nodes")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        for node in NODES:
            self.kill_node(node)
        for daemon in reversed(self.daemons.values()):
            daemon.terminate()
            try:
                daemon.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                daemon.kill()

    def _configuration(self) -> str:
        with socket.socket() as one, socket.socket() as two, socket.socket() as three:
            sockets = [one, two, three]
            for free in sockets:
                free.bind(("127.0.0.1", 0))
            ports = [free.getsockname()[1] for free in sockets]
        memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") >> 20
        lines = [SLURM_CONF.format(host=socket.gethostname(), port=ports[0], folder=self.folder)]
        for node, port in zip(NODES, ports[1:], strict=True):
            lines.append(
                f"NodeName={node} NodeHostname={node} NodeAddr=127.0.0.1 Port={port} CPUs=1 "
                f"RealMemory={int(0.8 * memory)} State=UNKNOWN\n"
            )
        return "".join([*lines, f"PartitionName={PARTITION} Nodes=ALL MaxTime=INFINITE State=UP\n"])

    def _start(self, name: str, *command: str) -> None:
        with open(self.folder / f"{name}.out", "wb") as output:
            self.daemons[name] = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env=self.environment,
                start_new_session=True,
                preexec_fn=die_with_parent,
            )

    def _start_munge(self, key: Path) -> None:
        files = {"socket": "munge.socket", "pid-file": "munged.pid", "log-file": "munged.log", "seed-file": "seed"}
        options = [f"--{option}={self.folder / name}" for option, name in files.items()]
        self._start("munged", "munged", "--foreground", "--force", f"--key-file={key}", *options)
        self.await_((self.folder / "munge.socket").exists, "munged")

    def start_node(self, node: str) -> None:
        """Start a node, or a killed one again."""
        place = f"hostname {node}; mount --bind '{self.folder}' {CONFIGURATION}; exec slurmd -D"
        self._start(node, *NAMESPACES, "sh", "-c", place)

    def kill_node(self, node: str) -> None:
        """End a node and all that runs on it, at once."""
        if daemon := self.daemons.pop(node, None):
            for first in psutil.Process(daemon.pid).children():  # of the node's process space, which ends with it
                first.kill()
            daemon.wait()

    def ask(self, *command: str) -> str:
        """What a SLURM command prints; empty if it fails."""
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True)
        return done.stdout.strip() if done.returncode == 0 else ""

    def states(self) -> dict[str, str]:
        """The state of each node, by its name."""
        lines = self.ask("sinfo", "--Node", "--noheader", "--format=%N %t").splitlines()
        return dict(line.split() for line in lines)

    def jobs(self) -> list[dict[str, str]]:
        """All jobs in order, ended ones too: number, state, node, comment (Snakemake's rule and wildcards)."""
        lines = self.ask("squeue", "--states=all", "--noheader", "--sort=i", "--format=%i|%T|%N|%k").splitlines()
        names = ("number", "state", "node", "comment")
        return [dict(zip(names, line.split("|"), strict=True)) for line in lines]

    def await_(self, condition, what: str, patience: float = PATIENCE):
        """What `condition` gives, once it gives something."""
        until = time.monotonic() + patience
        while time.monotonic() < until:
            if found := condition():
                return found
            time.sleep(0.1)
        logs = "\n".join(path.read_text(errors="replace")[-2000:] for path in self.folder.glob("*.log"))
        raise AssertionError(f"waited in vain for {what}\n{self.states()}\n{self.jobs()}\n{logs}")
