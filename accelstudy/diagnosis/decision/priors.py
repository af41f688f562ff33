"""Prior weights of everything that could be the case, and the thresholds of a decision.

The weights are relative to "one effect is missing", which weighs 1; the classes of effects and a
bumped position share it evenly. The probability that a given sigma is wrong is in `evidence.size`.
"""

TWO = 0.15
"""Two effects are missing: of the models that lack something one in eight lacks more. Likewise
another bumped position, where one was bumped."""
UNKNOWN = 0.06
"""Something is missing that is not in the catalogue, which has the usual effects."""
COLOUR = 0.06
"""Nothing is missing but the noise has some colour, as all real noise has."""
UNRECORDED = 0.15
"""Nothing of the catalogue is missing, but the sensor follows something that nobody recorded: a
temperature, most often. Where it has no column, it is the commonest cause of all."""
AXES = 0.03
"""Nothing is missing but the axes differ in noise."""
TAILS = 0.02
"""Nothing is missing but large errors are more frequent than in a normal distribution."""

SURE = 0.7
"""Posterior probability from which on one name is given: a wrong name costs 7, a name that is
withheld 3."""
MANY = 4
"""Explanations of a credible set that are still an answer."""
MORE_PROBABLE = 0.5
"""Probability from which on larger residuals without a pattern are called noise."""
