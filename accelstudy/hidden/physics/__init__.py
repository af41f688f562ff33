"""Campaigns with hidden effects, by physics of their own.

Nothing here comes from the effects, the approaches or the adjustment of the project, and the
diagnosis imports nothing from here. So the study judges the diagnosis by independent campaigns.
"""

from accelstudy.hidden.physics.case import SETS, Case, HiddenEffect, Truth
from accelstudy.hidden.physics.forward.designs import APPROACHES, DESIGNS
from accelstudy.hidden.physics.forward.effects import EFFECTS
from accelstudy.hidden.physics.forward.noise import NOISES
from accelstudy.hidden.physics.forward.outside import OUTSIDE
from accelstudy.hidden.physics.generate import generate
from accelstudy.hidden.physics.gross import GROSS, visible_gross
from accelstudy.hidden.physics.seen.atlas import invisible_effects, visible_effects
from accelstudy.hidden.physics.seen.oracle import visible_outside

__all__ = [
    "APPROACHES",
    "DESIGNS",
    "EFFECTS",
    "GROSS",
    "NOISES",
    "OUTSIDE",
    "SETS",
    "Case",
    "HiddenEffect",
    "Truth",
    "generate",
    "invisible_effects",
    "visible_effects",
    "visible_gross",
    "visible_outside",
]
