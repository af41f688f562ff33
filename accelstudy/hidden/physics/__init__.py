"""Campaigns with hidden effects, by physics of their own.

Nothing here comes from the effects, the approaches or the adjustment of the project, and the
diagnosis imports nothing from here. So the study judges the diagnosis by independent campaigns.
"""

from accelstudy.hidden.physics.atlas import invisible_effects, visible_effects
from accelstudy.hidden.physics.designs import APPROACHES, DESIGNS
from accelstudy.hidden.physics.effects import EFFECTS
from accelstudy.hidden.physics.generate import SETS, Case, HiddenEffect, Truth, generate
from accelstudy.hidden.physics.gross import GROSS, visible_gross
from accelstudy.hidden.physics.measuring import NOISES
from accelstudy.hidden.physics.oracle import visible_outside, visible_unforeseen
from accelstudy.hidden.physics.outside import OUTSIDE
from accelstudy.hidden.physics.unforeseen import UNFORESEEN

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
