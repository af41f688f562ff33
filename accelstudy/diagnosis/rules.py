"""The rules by which a diagnosis decides: each prior, level and threshold, with its reason.

Prior weights are relative to "one effect is missing", which weighs 1; the classes of effects and a
outlier position share it evenly. Each diagnosis.json quotes the rules that it was made by.
"""

from dataclasses import dataclass

from accelstudy.basics.levels import REFUTATION_LEVEL


@dataclass(frozen=True)
class Rules:
    """Priors, levels and thresholds of a diagnosis."""

    # --- prior weights of everything that could be the case -------------------------------------

    prior_two: float = 0.15
    """Two effects are missing: of the models that lack something one in eight lacks more. Likewise
    another outlier position, where there is one."""
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

    prior_sigma_wrong: float = 0.15
    """A sigma that is given is wrong."""
    prior_more_than_within: float = 0.5
    """Means scatter more than white noise within the holds explains, where the holds alone say how
    large the noise is."""

    # --- how well the noise is known before, by degrees of freedom or a standard deviation --------

    freedom_given: float = 200.0
    """Degrees of freedom of a sigma that is right: people know it to 5 %."""
    freedom_doubted: float = 3.0
    """Degrees of freedom of a sigma that is wrong: anything from half to twice is usual then."""
    freedom_not_given: float = 1e-3
    """Degrees of freedom of a sigma that is not given: its size says nothing."""
    spread_axes: float = 0.7
    """Prior sd of log κ about equal axes, with κ the ratios of the variances of the axes: a factor
    of two is usual."""
    spread_within: float = 0.35
    """Prior sd of log κ about the ratios within the holds."""
    beyond_white: float = 5.0
    """Ratio of variances up to which white noise within the holds may explain the scatter of
    means."""

    # --- levels of tests, which make 5 % false alarms together ----------------------------------

    level_effects: float = 0.04
    """Level of the test for anything that is missing; where sigma is given, the test of its size
    takes a part."""
    level_noise: float = 0.01
    """Family-wise level of all tests of the noise but that of its size."""
    level_sigma: float = REFUTATION_LEVEL
    """Level of the test of the size of the noise, and of any fit that is accepted."""
    z_component: float = 3.5
    """Largest value of a learned function, over its sigma, from which on it shows in an axis."""
    z_confirmed: float = 3.0
    """Size from which on a correction of held-out positions, over its sigma, confirms what was
    found. Where a name was given to noise, after looking at these positions too, about one in 20
    has that."""

    # --- posterior probabilities from which on something is said --------------------------------

    named: float = 0.8
    """One name is given: a wrong name costs four times as much as one that is withheld."""
    sure: float = 0.7
    """All else is said, such as that it is the noise, or one of a few effects."""
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

    # --- what can be seen, and what is the same --------------------------------------------------

    rival: float = 0.5
    """Canonical cosine from which on an effect may stand in the place of another."""
    imitates: float = 0.9995
    """Canonical cosine from which on two signatures are the same in what is confirmed."""
    alike: float = 0.9999
    """Canonical cosine above which two signatures are the same."""
    visible: float = 3e-3
    """Share of its signature that the model must leave, or an effect or a function is invisible."""
    absorbed: float = 1e-2
    """A direction counts as absorbed by the model if less than this share of it is left."""
    same_attitude: float = 0.05
    """Positions closer than this (chord of unit vectors) repeat each other, as those do that a
    person turns back to by eye. What the model says of them may differ; of what it lacks, such as a
    square or a cube of the force, they differ by some percent of it, which the test of lack of fit
    can bear."""
    same_fit: float = 0.5
    """Difference of Ω within which two fits are equally good."""
    same_evidence: float = 0.25
    """Log evidence within which two effects are equally good."""
    collinear: float = 0.05
    """Two effects are tried together only if this share of the second is left beside the first."""

    # --- how far is searched ---------------------------------------------------------------------

    simulations: int = 1000
    """Sets of noise that are simulated for the p-value of anything that is missing."""
    enough: int = 10
    """Simulated values beyond the observed one that are enough to take their share as its
    p-value."""
    held_out: float = 1 / 3
    """Share of the positions that is held out."""
    held_out_least: int = 3
    """Least number of positions to predict."""
    held_out_rivals: int = 3
    """Other explanations with which a name is compared on held-out positions."""
    splits: int = 300
    """Random splits of the positions, of which the best balanced one is taken."""
    refinements: int = 3
    """How often shapes are added about the best one."""
    refined_shapes: int = 5
    """Shapes that are added between its neighbours."""
    refined_within: float = 12.0
    """An effect whose log evidence is this far below the strongest needs no further shapes."""
    undecided: float = 2.0
    """Log evidence by which a shape may fall short of the best and still be the true one."""
    set_members: int = 3
    """Effects that are missing together, at most."""
    sets_started: int = 6
    """Candidates to which every other one is added."""
    sets_extended: int = 40
    """Sets to which every candidate is added, at most."""
    sets_within: float = 7.0
    """Log evidence by which a set may be weaker than the strongest one and still be extended."""
    negligible: float = 20.0
    """Log evidence by which a set may be weaker than the strongest one and still be weighed."""
    bounds_within: float = 8.0
    """Log evidence by which a set may be weaker than the strongest one and still get the bounds of
    each effect beside the others."""
    unknown_beside: int = 3
    """Effects, and pairs of effects, beside which something unknown is looked for."""
    refitted_sets: int = 5
    """Sets that are refitted where the best explanation leaves a misfit."""

    def level(self, sigma_known: bool) -> float:
        """Level of the test for anything that is missing."""
        return self.level_effects - self.level_sigma if sigma_known else self.level_effects


RULES = Rules()
