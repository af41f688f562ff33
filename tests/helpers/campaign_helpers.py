"""A campaign as a sensor of the nine parameters would give it."""

import numpy as np
from usual import NINE

from accelstudy.campaign.session import Campaign
from accelstudy.schemes import get_scheme
from accelstudy.simulation.sessions import Noise, session

_GOLDEN = (1 + 5**0.5) / 2
_AXES = np.array([[0, 1, _GOLDEN], [0, 1, -_GOLDEN], [1, _GOLDEN, 0], [1, -_GOLDEN, 0],
                  [_GOLDEN, 0, 1]])  # fmt: skip
FIVE_AXES = np.concatenate([_AXES, -_AXES[:4]]) / np.hypot(1, _GOLDEN)
"""Nine faces of a dodecahedron on five axes: five sums and three biases, so eight parameters."""


def simulated_campaign(values, scheme="mclaren-24", seed=1, noise=None, sigma=0.002):
    noise = noise or Noise(sigma_force=sigma)
    simulated = session(NINE, NINE.vector(values), get_scheme(scheme).directions)
    drawn = simulated.draw(noise, 1, np.random.default_rng(seed))
    n = len(simulated.forces)
    return Campaign(
        name="simulated",
        positions=np.arange(1, n + 1),
        forces=drawn.forces[0],
        gravity=simulated.gravity,
        sigma_force=sigma,
        angles=drawn.angles[0],
        sigma_angle=noise.sigma_angle,
    )
