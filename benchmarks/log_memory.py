"""How much memory and time a log takes: `accelstudy import` and `accelstudy apply` on CSV.

    python benchmarks/log_memory.py [MILLIONS OF ROWS ...]

Generates logs of as many rows (4 and 16 millions if none is given; a row has 28 bytes) in a folder
that is removed afterwards, runs both commands on each as processes of their own, and prints the
time of their processor, their largest resident memory, and what of this each row takes more than in
the log before. `apply` writes four times what it reads, so the folder of temporary files (TMPDIR
says which) needs six times the largest size.
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


def main(millions):
    """Print a row for each command and size."""
    session = lines()
    a_row = len(session) / session.count(b"\n")
    before = {"import": (0.0, 0.0), "apply": (0.0, 0.0)}
    print(f"{'command':8}{'rows / 1e6':>12}{'cpu / s':>10}{'peak / MB':>11}{'B per row':>11}")
    for million in millions:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            log, out = folder / "log.csv", folder / "campaign"
            write_log(log, session, 1e6 * million * a_row)
            calibration = folder / "calibrated" / "calibration.json"
            commands = {
                "import": (log, "--out", out, "--rate", RATE),
                "apply": (calibration, log, "--out", folder / "leveled.csv"),
            }
            for command, arguments in commands.items():
                _, cpu, peak = took(*ACCELSTUDY, command, *arguments)
                rows, less = before[command]
                before[command] = log.stat().st_size / 1e6 / a_row, peak
                each = (peak - less) / (before[command][0] - rows)
                print(f"{command:8}{million:12g}{cpu:10.1f}{peak:11.0f}{each:11.0f}", flush=True)
                if command == "import":
                    took(*ACCELSTUDY, "calibrate", out, "--out", calibration.parent)


if __name__ == "__main__":
    main([float(text) for text in sys.argv[1:]] or [4.0, 16.0])
