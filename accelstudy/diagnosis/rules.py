"""The rules by which a diagnosis decides: each prior, level and threshold, with its reason.

Prior weights are relative to "one effect is missing", which weighs 1; the classes of effects and a
bumped position share it evenly. The probability that a given sigma is wrong is in `evidence.size`.
Each diagnosis.json quotes the rules that it was made by.
"""

from dataclasses import dataclass

from accelstudy.basics.levels import REFUTED


@dataclass(frozen=True)
class Rules:
    """Priors, levels and thresholds of a diagnosis."""

    # --- prior weights of everything that could be the case -------------------------------------

    prior_two: float = 0.15
    """Two effects are missing: of the models that lack something one in eight lacks more. Likewise
    another bumped position, where one was bumped."""
    prior_unknown: float = 0.06
    """Something is missing that is not in the catalogue, which has the usual effects."""
    prior_coloured: float = 0.06
    """Nothing is missing but the noise has some colour, as all real noise has."""
    prior_unrecorded: float = 0.15
    """Nothing of the catalogue is missing, but the sensor follows something that nobody recorded: a
    temperature, most often. Where it has no column, it is the commonest cause of all."""
    prior_axes: float = 0.03
    """Nothing is missing but the axes differ in noise."""
    prior_tails: float = 0.02
    """Nothing is missing but large errors are more frequent than in a normal distribution."""
    prior_imitated: float = 0.5
    """An effect beside something unknown only imitates a part of that; in simulations without any
    such effect as many seem certain as in those with one."""

    # --- levels of tests, which make 5 % false alarms together ----------------------------------

    level_effects: float = 0.04
    """Of the test for anything that is missing; where sigma is given, its test takes a part."""
    level_noise: float = 0.01
    """Family-wise, of all tests of the noise but that of its level."""
    level_sigma: float = REFUTED
    """Of the test of the noise level, and of any fit that is accepted."""

    # --- posterior probabilities from which on something is said --------------------------------

    sure: float = 0.7
    """One name is given: a wrong name costs 7, a name that is withheld 3."""
    credible: float = 0.9
    """Explanations are a credible set together; what they have in common is certain."""
    many: int = 4
    """Explanations of a credible set that are still an answer."""
    more_probable: float = 0.5
    """Larger residuals without a pattern are called noise."""
    nearly_all: float = 0.9
    """Share of the disagreement that something outside of the catalogue hardly ever has in common
    with one effect of it: an effect that takes less away may only imitate that."""

    # --- what is large ---------------------------------------------------------------------------

    large: float = 300.0
    """Noncentrality beyond which first order is not enough, and a refit judges an effect."""
    larger_tilt: float = 1.02
    """Ratio of tilt errors from which on one counts as larger."""
    rival: float = 0.5
    """Canonical cosine from which on an effect is listed as a rival."""

    def level(self, sigma_known: bool) -> float:
        """Level of the test for anything that is missing."""
        return self.level_effects - self.level_sigma if sigma_known else self.level_effects


RULES = Rules()
