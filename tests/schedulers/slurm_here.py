"""A SLURM cluster of one node: this machine. For root, with Debian's package slurm-wlm; it leaves nothing behind."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from random import SystemRandom

DEADLINE_S = 600.0

CONFIGURATION = """
ClusterName=here
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
AuthType=auth/none
CredType=cred/none
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
KillWait=5
SchedulerParameters=sched_interval=1,bf_interval=1,sched_min_interval=0,batch_sched_delay=0
NodeName={host} NodeAddr=127.0.0.1 CPUs={n_cpus} RealMemory=4000
PartitionName=main Nodes=ALL Default=YES
"""


def why_no_slurm() -> str:
    """Why no cluster can be started here; empty where one can."""
    missing = [name for name in ("slurmctld", "slurmd", "sbatch") if shutil.which(name) is None]
    if missing:
        return f"{', '.join(missing)} not found; apt-get install slurm-wlm brings them"
    return "" if os.geteuid() == 0 else "the daemons of SLURM need root"


class SlurmHere:
    """The cluster. Use `slurm_here`.

    Attributes:
        environment: In which the programs of SLURM find it.
    """

    def __init__(self, folder: Path) -> None:
        self.environment = os.environ | {"SLURM_CONF": str(folder / "slurm.conf")}

    def call(self, *command: str | Path) -> str:
        """Run a command to its end; gives its standard output."""
        done = subprocess.run(
            command, env=self.environment, check=True, capture_output=True, text=True, timeout=DEADLINE_S
        )
        return done.stdout

    def states(self) -> dict[str, str]:
        """State of every job and task, by names such as "1" and "2_3"."""
        return {
            f"{job['ArrayJobId']}_{job['ArrayTaskId']}" if "ArrayJobId" in job else job["JobId"]: job["JobState"]
            for job in self.jobs()
        }

    def wait(self, is_so: Callable[[], object], *, deadline_s: float = DEADLINE_S) -> None:
        """Until something is so; fails after a deadline. What SLURM would begin again in two minutes begins in two
        seconds; any sooner, it would still refuse the job as one that was ended."""
        until_s = time.monotonic() + deadline_s
        hurried: set[tuple[str, str]] = set()
        while not is_so():
            assert time.monotonic() < until_s, self.states()
            for job in self.jobs():
                start = (job["JobId"], job["Restarts"])
                if job["JobState"] == "PENDING" and job["Reason"] == "BeginTime" and start not in hurried:
                    self.call("scontrol", "update", f"JobId={job['JobId']}", "StartTime=now+2seconds")
                    hurried.add(start)
            time.sleep(0.2)

    def wait_for(self, states: Sequence[str], *, deadline_s: float = DEADLINE_S) -> None:
        """Until the states of all jobs are among these."""
        self.wait(lambda: set(self.states().values()) <= set(states), deadline_s=deadline_s)

    def jobs(self) -> list[dict[str, str]]:
        """What SLURM says of every job and task."""
        lines = self.call("scontrol", "--oneliner", "show", "jobs").splitlines()
        pairs = ([pair.partition("=") for pair in line.split()] for line in lines if line.startswith("JobId="))
        return [{name: value for name, _, value in job} for job in pairs]


@contextmanager
def slurm_here(folder: Path, *, n_cpus: int = 2) -> Iterator[SlurmHere]:
    """Start the daemons, wait until the node takes jobs, and end both in the end.

    Args:
        folder: An empty one.
        n_cpus: How many jobs of one core run at once, whatever the machine has.
    """
    ports = _free_ports(2)
    host = socket.gethostname().partition(".")[0]
    (folder / "slurm.conf").write_text(CONFIGURATION.format(host=host, ports=ports, folder=folder, n_cpus=n_cpus))
    for name in ("state", "spool"):
        (folder / name).mkdir()
    cluster = SlurmHere(folder)
    daemons: list[subprocess.Popen[bytes]] = []
    try:
        for name in ("slurmctld", "slurmd"):
            with (folder / f"{name}.out").open("wb") as out:
                daemons.append(
                    subprocess.Popen([name, "-D"], env=cluster.environment, stdout=out, stderr=subprocess.STDOUT)
                )
        _wait_for_node(cluster, folder)
        yield cluster
    finally:
        subprocess.run(["scancel", "--full", "--user=root"], env=cluster.environment, timeout=DEADLINE_S, check=False)
        for daemon in reversed(daemons):
            daemon.terminate()
        for daemon in daemons:
            try:
                daemon.wait(timeout=DEADLINE_S)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()


def _free_ports(n: int) -> list[int]:
    """Ports that nobody has, and that no system hands to whoever asks for any: they are still free a moment later."""
    found: list[int] = []
    for port in SystemRandom().sample(range(20_000, 30_000), 200):
        with socket.socket() as one, suppress(OSError):
            one.bind(("127.0.0.1", port))
            found.append(port)
    return found[:n]


def _wait_for_node(cluster: SlurmHere, folder: Path) -> None:
    until_s = time.monotonic() + DEADLINE_S
    while True:
        done = subprocess.run(
            ["sinfo", "--noheader", "--format=%T"], env=cluster.environment, capture_output=True, text=True, check=False
        )
        if done.stdout.strip() == "idle":
            return
        said = "\n".join(path.read_text(errors="replace")[-2000:] for path in folder.glob("*.log"))
        assert time.monotonic() < until_s, f"{done.stdout}{done.stderr}\n{said}"
        time.sleep(0.2)
