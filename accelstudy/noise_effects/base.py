"""What a noise effect is, and the registry of noise effects.

Without noise effects, the noise of the position means is white, Gaussian and of one sigma on all
axes. A noise effect changes that noise, or makes the readings coarser. Several act one after the
other. Everything is in m/s², of R sessions of n holds with three axes.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.plugins import cached_lookup
from accelstudy.basics.registry import RegistryWithSettings, WithSettings
from accelstudy.effects import HoldConditions


class NoiseEffect(WithSettings):
    """One departure from white Gaussian noise of a known sigma; subclasses override what they do.

    Attributes
    ----------
    equation : str, the changed noise v or readings f, for people
    typical : (float, float), usual range of the first setting, SI
    """

    kind = "noise effect"
    family = "noise"
    equation: ClassVar[str]
    typical: ClassVar[tuple[float, float]]

    def disturb(
        self, noise: Array, sigma: float, hold: HoldConditions, rng: np.random.Generator
    ) -> Array:
        """Return the changed noise.

        Parameters
        ----------
        noise : (R, n, 3) array, m/s²
        sigma : float, m/s², nominal sd of a position mean
        hold : HoldConditions
        rng : Generator, for what the effect itself draws
        """
        return noise

    def read(self, forces: Array) -> Array:
        """Return the readings that are recorded for forces (R, n, 3) with noise."""
        return forces

    @property
    def within_hold(self) -> Array:
        """Factors on the sd of the samples within a hold, (3,)."""
        return np.ones(3)


def _check(effect: NoiseEffect) -> None:
    """Check that what a plug-in makes of noise or readings has their shape.

    Raises
    ------
    InputError
        If it has another.
    """
    zeros = np.zeros((2, 5, 3))
    columns: dict[str, Any] = dict.fromkeys(HoldConditions.columns(), np.arange(5.0))
    hold = HoldConditions(**columns)
    disturbed = effect.disturb(zeros, 1.0, hold, np.random.default_rng(1))
    for name, array in (("disturb", disturbed), ("read", effect.read(zeros))):
        if np.shape(array) != zeros.shape:
            raise InputError(
                f"{name} returns an array of shape {np.shape(array)} for one of {zeros.shape}"
            )


_registry: RegistryWithSettings[NoiseEffect] = RegistryWithSettings(
    NoiseEffect.kind, "noise_effects", _check
)
noise_effect_names = _registry.names
register = _registry.register


@cached_lookup
def get_noise_effect(spec: str) -> NoiseEffect:
    """Return a noise effect by its name, with settings or not: ``heavy_tails(nu=3)``."""
    return _registry.get(spec)
