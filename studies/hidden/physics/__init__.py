"""Campaigns with hidden effects, by physics of their own.

Nothing here comes from the effects, the approaches or the adjustment of the project, and the
diagnosis imports nothing from here. So the study judges the diagnosis by independent campaigns.
"""

from studies.hidden.physics.atlas import invisible_effects, visible_effects
from studies.hidden.physics.designs import APPROACHES, DESIGNS
from studies.hidden.physics.effects import EFFECTS
from studies.hidden.physics.generate import SETS, Case, HiddenEffect, Truth, generate
from studies.hidden.physics.gross import GROSS, visible_gross
from studies.hidden.physics.measuring import NOISES
from studies.hidden.physics.oracle import visible_outside, visible_unforeseen
from studies.hidden.physics.outside import OUTSIDE
from studies.hidden.physics.unforeseen import UNFORESEEN

__all__ = [
    "APPROACHES",
    "DESIGNS",
    "EFFECTS",
    "GROSS",
    "NOISES",
    "OUTSIDE",
    "SETS",
    "UNFORESEEN",
    "Case",
    "HiddenEffect",
    "Truth",
    "generate",
    "invisible_effects",
    "visible_effects",
    "visible_gross",
    "visible_outside",
    "visible_unforeseen",
]
