"""Sessions of the nine-parameter model whose quality the tests look at."""

from dataclasses import fields, replace

import numpy as np
from usual import NINE, PAPER_TRUTH, G

from accelstudy.adjustment import calibrate
from accelstudy.adjustment.quality import solve
from accelstudy.basics.units import MGON
from accelstudy.schemes import get_scheme
from accelstudy.simulation.sessions import Noise, session

SIGMA = Noise().sigma_force
TRUTH = {
    **PAPER_TRUTH,
    **{"alpha_xz": 20 * MGON, "alpha_xy": -15 * MGON, "alpha_yx": 30 * MGON},
    **{"k2_x": 300e-6, "k2_y": -200e-6, "k2_z": 100e-6},
    **{"k3_x": -400e-6, "k3_y": 500e-6, "k3_z": 300e-6},
}
"""The sensor of the paper; effects that it does not have get what is typical of them."""


def ideal_session(scheme="mclaren-24", model=NINE, hold=None):
    directions = get_scheme(scheme).directions
    return session(model, model.vector(TRUTH), directions, G, hold)


def draw(seed, scheme="mclaren-24", model=NINE, noise=None, replicates=1):
    ideal = ideal_session(scheme, model)
    return ideal.draw(noise or Noise(), replicates, np.random.default_rng(seed))


def solutions(approach, observed):
    """All sessions, calibrated together and linearised one by one."""
    together = calibrate(NINE, approach, observed)
    arrays = [a.name for a in fields(together) if a.name != "redundancy"]
    for i in range(len(observed.forces)):
        one = slice(i, i + 1)
        part = replace(together, **{name: getattr(together, name)[one] for name in arrays})
        yield solve(NINE, approach, observed.sessions(one), part)
