"""Work in processes of its own."""

import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from time import perf_counter
from typing import NamedTuple

ACCELSTUDY = (sys.executable, "-m", "accelstudy")
"""The command of this package."""


def fresh(function, *arguments):
    """What a function returns in a new process."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()


class Took(NamedTuple):
    """Seconds by the clock and of processor time, and the largest resident memory, MB."""

    wall: float
    cpu: float
    peak: float


LAUNCH = """\
import os, sys
to_errors = [(os.POSIX_SPAWN_DUP2, 2, 1)]
pid = os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ, file_actions=to_errors)
_, status, usage = os.wait4(pid, 0)
print(usage.ru_utime + usage.ru_stime, usage.ru_maxrss)
sys.exit(os.waitstatus_to_exitcode(status) != 0)
"""
"""A small process starts the command, as the memory of what starts it counts as that of its own."""


def took(*command):
    """What a command takes as a process of its own; it speaks only if it fails."""
    command = [*map(str, command)]
    with tempfile.TemporaryFile() as said:
        start = perf_counter()
        launched = [sys.executable, "-I", "-S", "-c", LAUNCH, *command]
        ran = subprocess.run(launched, stdout=subprocess.PIPE, stderr=said, check=False)
        wall = perf_counter() - start
        if ran.returncode:
            said.seek(0)
            raise SystemExit(f"{' '.join(command)} failed:\n{said.read().decode()}")
    cpu, peak = map(float, ran.stdout.split())
    # ru_maxrss is in kB, but in bytes on macOS.
    return Took(wall, cpu, peak * (1 if sys.platform == "darwin" else 1024) / 1e6)
