"""Make logs of one simulated accelerometer: calibration.csv and, of its later use, use.csv.

Nothing here knows of accelstudy; a logger would have written the like. The sensor has a bias, wrong
scales, axes that are not perpendicular, and noise.
"""

from itertools import pairwise, product

import numpy as np

G = 9.80665  # m/s²
RATE, HOLD, TURN = 50, 15, 3  # Hz, s, s
BIAS = np.array([0.05, -0.03, 0.08])  # m/s²
SCALE = np.array([1.002, 0.998, 1.001])
SKEW = np.array([[1, 0.0008, -0.0005], [0, 1, 0.0004], [0, 0, 1]])
NOISE = 0.01  # m/s², of one sample

rng = np.random.default_rng(3)


def write_log(path, down):
    """Write time and readings in g while the sensor rests in some attitudes and turns in between.

    `down` has the direction of gravity in the sensor's axes, a row for each attitude.
    """
    way = np.linspace(0, 1, TURN * RATE)[:, None]
    rows = [np.tile(down[0], (HOLD * RATE, 1))]
    for before, after in pairwise(down):
        aside = np.cross(before, after) + 0.1  # opposite attitudes have no shortest way
        turn = (1 - way) ** 2 * before + 2 * way * (1 - way) * aside + way**2 * after
        rows += [turn, np.tile(after, (HOLD * RATE, 1))]
    force = np.concatenate(rows)
    force *= -G / np.linalg.norm(force, axis=1, keepdims=True)
    reading = SCALE * (force @ SKEW.T) + BIAS + NOISE * rng.standard_normal(force.shape)
    time = np.arange(len(force)) / RATE
    table = np.column_stack([time, reading / G])
    np.savetxt(path, table, "%.6f", ",", header="t,ax,ay,az", comments="")


# A box on its faces, edges and corners, as a hand places it: to within some degrees.
box = np.array([d for d in product((-1, 0, 1), repeat=3) if any(d)], dtype=float)
box /= np.linalg.norm(box, axis=1, keepdims=True)
box += 0.05 * rng.standard_normal(box.shape)
write_log("calibration.csv", rng.permutation(box / np.linalg.norm(box, axis=1, keepdims=True)))

# The same sensor in use. What its roll and pitch are in truth, nobody knows but this file.
roll, pitch = np.radians([[0, 10, -20, 5, 25], [0, 5, 10, -20, -15]])
down = np.stack([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)], -1)
write_log("use.csv", down)
np.savetxt("truth.csv", np.degrees([roll, pitch]).T / 0.9, "%.4f", ",", header="roll,pitch")
