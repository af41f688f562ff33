"""Compare roll and pitch of use.csv with the truth, before the calibration and after it."""

import numpy as np
import pandas as pd

table, truth = pd.read_csv("leveled.csv"), np.loadtxt("truth.csv", delimiter=",")
hold = (table["t"] // 18).astype(int)  # 15 s at rest, 3 s of turning
at_rest = table[table["t"] % 18 < 15].groupby(hold)

force = at_rest[["ax", "ay", "az"]].mean().to_numpy()
x, y, z = force.T
raw = np.column_stack([np.arctan2(-y, -z), np.arctan2(x, np.hypot(y, z))]) * 200 / np.pi
leveled = at_rest[["roll_gon", "pitch_gon"]].mean().to_numpy()
for name, angles in (("raw", raw), ("calibrated", leveled)):
    roll, pitch = 1000 * np.sqrt(np.mean((angles - truth) ** 2, axis=0))
    print(f"{name:>10}: roll is wrong by {roll:.1f} mgon (rms), pitch by {pitch:.1f} mgon")
