"""Logs as tests write and read them."""

from itertools import product

import numpy as np
import pandas as pd

import accelstudy as acs
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing import holds as detector
from accelstudy.campaign.importing import log as logs
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.files.validation import validate

# --- a log of which the holds are known ----------------------------------------------------------

RATE = 100.0
G = 9.81


def session(seed=1, holds=8, sigma=0.02, still=400, moving=200, forces=None):
    """A log (n, 3), and the first and the end sample of each hold.

    The holds have the given forces (m, 3) or, without these, random ones, `holds` of them; `still`
    is the number of samples of a hold, or those of several, which take turns.
    """
    rng = np.random.default_rng(seed)
    pieces, edges, n = [], [], 0
    for i, rest in enumerate(np.resize(still, holds if forces is None else len(forces))):
        if forces is None:
            force = rng.standard_normal(3)
            force *= G / np.linalg.norm(force)
        else:
            force = forces[i]
        shake = 4 * np.sin(np.arange(moving)[:, None] * rng.uniform(0.05, 0.2, 3))
        pieces += [force + shake, np.tile(force, (rest, 1))]
        edges.append((n + moving, n + moving + rest))
        n += moving + rest
    pieces.append(pieces[0])
    log = np.concatenate(pieces)
    return log + sigma * rng.standard_normal(log.shape), np.array(edges)


def table(forces, **more):
    return pd.DataFrame(forces, columns=["fx", "fy", "fz"]).assign(**more)


def write(folder, forces, time=None):
    """Parquet, as it is fast and keeps every digit."""
    path = folder / "log.parquet"
    table(forces, **({} if time is None else {"time": time})).to_parquet(path)
    return path


def open_log(path, **layout):
    """Open a log as keys of its layout say."""
    given = validate(LogLayout, layout, "layout").model_dump(exclude_unset=True, exclude_none=True)
    return logs.join([logs.read_log(path, given)])


def opened(folder, forces, time=None, **options):
    rate = RATE if time is None else None
    return open_log(write(folder, forces, time), rate=rate, **options)


def find_holds(log, **options):
    return detector.find_holds(log, ImportSettings(**options))


# --- 50 numbered rows ----------------------------------------------------------------------------

N = 50
TIME = 0.25 * np.arange(N)
FORCES = np.round(np.random.default_rng(1).normal(0, 5, (N, 3)), 3)
TABLE = np.column_stack([TIME, FORCES])


def lines(separator=",", decimal=".", before=()):
    """Text of TABLE."""
    rows = [separator.join(f"{value:.3f}".replace(".", decimal) for value in row) for row in TABLE]
    return "\n".join([*before, *rows]) + "\n"


def changed(row, place, value):
    """Text of TABLE with another cell."""
    rows = lines().splitlines()
    cells = rows[row].split(",")
    cells[place] = value
    rows[row] = ",".join(cells)
    return "\n".join(rows) + "\n"


# --- a sensor that is turned by hand into the faces and corners of a cube -------------------------

BIAS = np.array([0.120, -0.080, 0.200])  # m/s²
SCALE = np.array([0.004, -0.003, 0.006])
HAND_RATE, HOLD, MOVE = 50, 3.0, 1.0
HOLDS = 14


def by_hand():
    """Times and readings."""
    rng, rows = np.random.default_rng(7), []
    corners = np.array([*product((-1, 1), repeat=3)]) / np.sqrt(3)
    for direction in np.concatenate([np.eye(3), -np.eye(3), corners]):
        force = (1 + SCALE) * STANDARD_GRAVITY * direction + BIAS
        rows.append(force + rng.normal(0, 3.0, (int(MOVE * HAND_RATE), 3)))
        rows.append(force + rng.normal(0, 0.02, (int(HOLD * HAND_RATE), 3)))
    forces = np.concatenate(rows).round(4)
    return np.arange(len(forces)) / HAND_RATE, forces


def found(log, turn=(1, 1, 1), **settings):
    """Campaign of a log that has all positions, and the parameters of the sensor.

    `turn` are the signs of the axes of the campaign in those of the sensor.
    """
    campaign = acs.find_holds(log, gravity=STANDARD_GRAVITY, **settings)
    assert campaign.n_positions == HOLDS
    value = acs.calibrate(campaign, model="bias-scale").parameters["value"]
    # The mean of some 100 samples is known to 2 mm/s².
    np.testing.assert_allclose([value[f"b_{axis}"] for axis in "xyz"], turn * BIAS, atol=0.004)
    np.testing.assert_allclose([value[f"s_{axis}"] for axis in "xyz"], SCALE, atol=6e-4)
    return campaign
