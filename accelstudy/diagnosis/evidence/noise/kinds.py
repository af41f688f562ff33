"""The ways in which noise may be wrong, and what a test says of one of them."""

from __future__ import annotations

from dataclasses import dataclass

LEVEL, AXES, COLOUR, TAILS = "noise_level", "axis_noise", "coloured_noise", "heavy_tails"
STEPS = "quantisation"
NOISES = {
    LEVEL: "the residuals are larger than sigma says, and have no pattern",
    AXES: "the axes differ in noise",
    COLOUR: "the noise lasts longer than a hold, or differs from hold to hold",
    TAILS: "large residuals are more frequent than in a normal distribution",
    STEPS: "the readings are coarse",
}
"""The reason that is given for each kind of wrong noise."""


@dataclass(frozen=True)
class NoiseTest:
    """One test of the stochastic model.

    Attributes
    ----------
    name : str, the noise effect that it looks for
    statistic : float
    p_value : float
    estimate : tuple of float, what the data say of it: variance factor, variance factors of the
        axes, correlation of successive holds, kurtosis, resolution in m/s²
    remark : str
    by_holds : bool, whether it is measured by the noise within the holds
    """

    name: str
    statistic: float
    p_value: float
    estimate: tuple[float, ...]
    remark: str
    by_holds: bool = False
