"""A SLURM of its own on this machine: one node, on the loopback address, gone afterwards."""

import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import FrameType

NEEDED = ("munged", "slurmctld", "slurmd", "sbatch", "srun", "setpriv")
DAEMONS = "/usr/sbin:/sbin"
STARTED = 30.0
"""Seconds after which a daemon that does not answer has failed."""

# All of it listens on the loopback address only. Memory is counted, but nothing is confined, which
# would need control groups.
CONFIG = """\
ClusterName=one-machine
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/ctld
SlurmdSpoolDir={folder}/d
SlurmctldPidFile={folder}/ctld.pid
SlurmdPidFile={folder}/d.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SlurmdParameters=config_overrides
PropagateResourceLimits=NONE
ReturnToService=2
MinJobAge=3600
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} RealMemory={memory}
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE
"""


class NoSlurmError(Exception):
    """SLURM is not installed, or does not start; says what to do."""


@contextmanager
def one_machine_slurm(folder: Path) -> Iterator[dict[str, str]]:
    """Give the environment in which `sbatch` and all others speak to this SLURM.

    Config, state and logs are in `folder`, whose path must be short: sockets lie in it. The
    daemons end with the block, and with the process if it is killed.

    Raises
    ------
    NoSlurmError
        If a program is missing, or a daemon does not start.
    """
    path = f"{os.environ['PATH']}:{DAEMONS}"
    missing = [name for name in NEEDED if shutil.which(name, path=path) is None]
    srun = shutil.which("srun")
    if missing or srun is None:
        raise NoSlurmError(
            f"SLURM is not installed ({', '.join(missing)}): on Debian and Ubuntu, "
            "apt-get install slurm-wlm munge"
        )
    config = folder / "slurm.conf"
    # Snakemake's job steps drop the variables SLURM_* before they call srun, which elsewhere finds
    # its config in /etc.
    (folder / "bin").mkdir()
    wrapper = folder / "bin" / "srun"
    wrapper.write_text(f'#!/bin/sh\nSLURM_CONF={config} exec {srun} "$@"\n')
    wrapper.chmod(0o755)
    path = f"{wrapper.parent}:{path}"
    environment = {**os.environ, "PATH": path, "SLURM_CONF": str(config)}
    with ExitStack() as running:
        ports = [running.enter_context(_free_port()) for _ in range(2)]
        for name in ("ctld", "d", "munge"):
            (folder / name).mkdir(mode=0o755)
        config.write_text(
            CONFIG.format(
                host=socket.gethostname().partition(".")[0],
                ports=[each.getsockname()[1] for each in ports],
                user=subprocess.check_output(["id", "-un"], text=True).strip(),
                folder=folder,
                cpus=os.cpu_count(),
                memory=os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2**20,
            )
        )
    key = folder / "munge" / "key"
    key.touch(mode=0o600)
    key.write_bytes(os.urandom(128))
    places = {
        "key-file": key,
        "socket": folder / "munge.socket",
        "pid-file": folder / "munge" / "pid",
        "seed-file": folder / "munge" / "seed",
        "log-file": folder / "munge" / "log",
    }
    munged = ["munged", "--foreground", *(f"--{name}={path}" for name, path in places.items())]
    # munged would insist that nobody else can write to any folder above, as all can to /tmp.
    munged.append("--force")
    encode = ["munge", "-n", f"--socket={places['socket']}"]
    with _ended_by(signal.SIGTERM, signal.SIGHUP), ExitStack() as running:
        running.enter_context(_daemon("munged", munged, encode, folder, environment))
        running.enter_context(
            _daemon("slurmctld", ["slurmctld", "-D"], ["scontrol", "ping"], folder, environment)
        )
        idle = ["sinfo", "--noheader", "--states=idle", "--format=%n"]
        running.enter_context(_daemon("slurmd", ["slurmd", "-D"], idle, folder, environment))
        running.callback(_cancel_all, environment)
        yield environment


@contextmanager
def _free_port() -> Iterator[socket.socket]:
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        yield bound


@contextmanager
def _daemon(
    name: str, command: list[str], question: list[str], folder: Path, environment: dict[str, str]
) -> Iterator[None]:
    """Run a daemon that is up once the question has an answer."""
    log = folder / f"{name}.log"
    with log.open("wb") as stream:
        daemon = subprocess.Popen(
            # The kernel ends it if this process is killed and cannot.
            ["setpriv", "--pdeathsig", "TERM", *command],
            env=environment, stdin=subprocess.DEVNULL, stdout=stream, stderr=stream,
            start_new_session=True,
        )  # fmt: skip
    try:
        latest = time.monotonic() + STARTED
        while not _answer(question, environment):
            if daemon.poll() is not None or time.monotonic() > latest:
                raise NoSlurmError(f"{name} does not start:\n{log.read_text(errors='replace')}")
            time.sleep(0.2)
        yield
    finally:
        daemon.terminate()
        try:
            daemon.wait(timeout=STARTED)
        except subprocess.TimeoutExpired:
            daemon.kill()
            daemon.wait()


def _answer(question: list[str], environment: dict[str, str]) -> str:
    asked = subprocess.run(
        question, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    return asked.stdout.strip() if asked.returncode == 0 else ""


def _cancel_all(environment: dict[str, str]) -> None:
    """End all jobs; what runs them is no child of this process, and would go on."""
    nodes = ["squeue", "--noheader", "--format=%i"]
    latest = time.monotonic() + STARTED
    while (jobs := _answer(nodes, environment).split()) and time.monotonic() < latest:
        subprocess.run(["scancel", *jobs], env=environment, check=False)
        time.sleep(0.5)


@contextmanager
def _ended_by(*signals: signal.Signals) -> Iterator[None]:
    """Turn signals that would end the process at once into an exception."""

    def end(number: int, _: FrameType | None) -> None:
        raise SystemExit(128 + number)

    before = {each: signal.signal(each, end) for each in signals}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
