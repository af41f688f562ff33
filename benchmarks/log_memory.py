"""How much memory and time a log takes: `accelstudy import` and `accelstudy apply` on CSV.

    python benchmarks/log_memory.py [MB ...]

Generates logs of these sizes (100 and 1000 MB if none is given) in a folder that is removed
afterwards, runs both commands on each as processes of their own, and prints their wall time and
their largest resident memory. `apply` writes four times what it reads, so the folder of
temporary files (TMPDIR says which) needs six times the largest size.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from accelstudy.schemes import get_scheme
from processes import ACCELSTUDY, took

RATE = 1000
HOLD, MOTION = 30, 4
"""Seconds."""
SIGMA = 0.02


def lines(seed=1):
    """Text of a session of 24 holds with motion between them; the log repeats it."""
    rng = np.random.default_rng(seed)
    parts = []
    for direction in get_scheme("mclaren-24").directions:
        parts.append(np.tile(9.81 * direction, (HOLD * RATE, 1)))
        phase = np.arange(MOTION * RATE)[:, None] / RATE * rng.uniform(3, 20, 3)
        parts.append(9.81 * direction + 4 * np.sin(phase))
    forces = np.concatenate(parts)
    forces += SIGMA * rng.standard_normal(forces.shape)
    return "".join(f"{x:.6f},{y:.6f},{z:.6f}\n" for x, y, z in forces.tolist()).encode()


def write_log(path, session, size):
    """Write sessions until the log has `size` bytes or more."""
    with path.open("wb") as file:
        file.write(b"fx,fy,fz\n")
        while file.tell() < size:
            file.write(session)


def main(sizes):
    """Print a row for each command and size."""
    session = lines()
    print(f"{'command':8}{'log / MB':>10}{'wall / s':>10}{'MB/s':>8}{'peak / MB':>11}")
    for size in sizes:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            log, out = folder / "log.csv", folder / "campaign"
            write_log(log, session, 1e6 * size)
            calibration = folder / "calibrated" / "calibration.json"
            commands = {
                "import": (log, "--out", out, "--rate", RATE),
                "apply": (calibration, log, "--out", folder / "leveled.csv"),
            }
            for command, arguments in commands.items():
                wall, _, peak = took(*ACCELSTUDY, command, *arguments)
                speed = log.stat().st_size / 1e6 / wall
                print(f"{command:8}{size:10.0f}{wall:10.0f}{speed:8.1f}{peak:11.0f}", flush=True)
                if command == "import":
                    took(*ACCELSTUDY, "calibrate", out, "--out", calibration.parent)


if __name__ == "__main__":
    main([float(text) for text in sys.argv[1:]] or [100.0, 1000.0])
