"""A campaign as a sensor of the nine parameters would give it."""

from dataclasses import replace

import numpy as np
from usual import NINE

from accelstudy.basics.units import MGON, STANDARD_GRAVITY
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
    angles = {"angles": drawn.angles[0], "sigma_angle": noise.sigma_angle}
    return made(drawn.forces[0], simulated.gravity, sigma, name="simulated", **angles)


def made(forces, gravity=STANDARD_GRAVITY, sigma=None, sigma_angle=None, header=(), name="made",
         **arrays):  # fmt: skip
    """A campaign of forces and of other arrays in SI, with other keys of the header."""
    content = {
        "name": name,
        "gravity": {"value_mps2": gravity},
        "sensor_noise": None if sigma is None else {"sigma_mps2": sigma},
        "robot": None if sigma_angle is None else {"angle_sigma_mgon": sigma_angle / MGON},
    }
    return Campaign.of({**content, **dict(header)}, forces=forces, **arrays)


def with_keys(calibration, **keys):
    """The calibration of a sensor with other keys of its document."""
    return replace(calibration, document=calibration.document.model_copy(update=keys))


def unaided(campaign):
    """The campaign without its robot."""
    return campaign.with_header(robot=None).with_arrays(angles=None, yaw=None)
