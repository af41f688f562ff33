"""What all ways solve: simulated calibrations of one sensor, the same for all of them."""

import numpy as np

from accelstudy.basics.units import MGON
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import BLOCK, Noise, session

APPROACHES = ("gravity", "robot")

MODEL = get_model("bias-scale-nonorthogonality")
SCHEME = "mclaren-24"
NOISE = Noise()
TRUTH = {
    **{"b_x": 0.05, "b_y": 0.01, "b_z": 0.03, "s_x": 200e-6, "s_y": 200e-6, "s_z": 200e-6},
    **{"alpha_yz": 12 * MGON, "alpha_zy": 12 * MGON, "alpha_zx": 44 * MGON},
}
"""SI. Parameters of larger models that are not here are zero."""


def ideal_session(model=MODEL, scheme=SCHEME):
    """The session before noise."""
    names = model.parameter_names
    truth = model.vector({name: value for name, value in TRUTH.items() if name in names})
    return session(model, truth, get_scheme(scheme).directions)


def drawn(ideal, approach, number=0):
    """Observations of the block of that number, with what the approach needs."""
    rng = np.random.default_rng([1, number])
    return ideal.draw(NOISE, BLOCK, rng, angles=approach.uses_angles)
