"""A Slurm of one node on this machine: munged, slurmctld and slurmd, without accounting."""

import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue")
CONFIGURATION = """
ClusterName=dapple
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
StateSaveLocation={folder}/controller
SlurmdSpoolDir={folder}/node
SlurmctldPidFile={folder}/controller.pid
SlurmdPidFile={folder}/node.pid
SlurmctldLogFile={folder}/controller.log
SlurmdLogFile={folder}/node.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/{gather}
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
MinJobAge=3600
MpiDefault=none
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} RealMemory={memory_mb} State=UNKNOWN
PartitionName=debug Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def lacking() -> str:
    """Why no Slurm can be started here, or ""."""
    if os.geteuid() != 0:
        return "Slurm is started by root alone"
    absent = [name for name in PROGRAMS if shutil.which(name) is None]
    return f"no {', '.join(absent)}: apt-get install slurm-wlm munge" if absent else ""


LIMITED = """
JobAcctGatherFrequency=task=1
JobAcctGatherParams=OverMemoryKill
"""
"""Jobs that take more memory than they asked for are killed."""


USUAL_PLACE = Path("/etc/slurm/slurm.conf")


@contextmanager
def _found_by_steps(configuration: Path) -> Iterator[None]:
    """The configuration in the usual place, unless one stands there.

    The executor starts the steps of a job without `SLURM_CONF`, and their `srun` looks there.
    """
    if USUAL_PLACE.exists():
        yield
        return
    USUAL_PLACE.parent.mkdir(exist_ok=True)
    USUAL_PLACE.unlink(missing_ok=True)
    USUAL_PLACE.symlink_to(configuration)
    try:
        yield
    finally:
        USUAL_PLACE.unlink()


@contextmanager
def cluster(folder: Path, *, is_limited: bool = False) -> Iterator[dict[str, str]]:
    """A running Slurm; gives the environment in which its programs find it.

    Where it is limited, it kills jobs that take more memory than they asked for.
    """
    for name in ("controller", "node"):
        (folder / name).mkdir(parents=True)
    memory_mb = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") * 9 // 10 // 2**20
    configuration = folder / "slurm.conf"
    text = CONFIGURATION.format(
        host=socket.gethostname(),
        folder=folder,
        cores=os.cpu_count(),
        memory_mb=memory_mb,
        gather="linux" if is_limited else "none",
    )
    configuration.write_text(text + LIMITED * is_limited)
    environment = os.environ | {"SLURM_CONF": str(configuration)}
    _munge()
    try:
        with _found_by_steps(configuration):
            for program in ("slurmctld", "slurmd"):
                subprocess.run([program, "-f", configuration], check=True, env=environment)
            _wait_until_idle(environment)
            yield environment
    finally:
        for name in ("node", "controller"):
            if (pid := folder / f"{name}.pid").is_file():
                os.kill(int(pid.read_text()), 15)


def _munge() -> None:
    """The service that signs requests, with a key of this machine."""
    if subprocess.run(["pgrep", "-x", "munged"], capture_output=True).returncode == 0:
        return
    for path in ("/run/munge", "/var/log/munge", "/var/lib/munge"):
        Path(path).mkdir(parents=True, exist_ok=True)
        shutil.chown(path, "munge", "munge")
    key = Path("/etc/munge/munge.key")
    if not key.exists():
        key.write_bytes(os.urandom(1024))
        shutil.chown(key, "munge", "munge")
        key.chmod(0o400)
    subprocess.run(["runuser", "-u", "munge", "--", "munged"], check=True)


def _wait_until_idle(environment: dict[str, str]) -> None:
    for _ in range(60):
        said = subprocess.run(["sinfo", "-h", "-o", "%T"], env=environment, capture_output=True)
        if said.stdout.strip() == b"idle":
            return
        time.sleep(1)
    raise RuntimeError(f"the node did not become idle: {said.stdout!r} {said.stderr!r}")
