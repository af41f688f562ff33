"""Campaigns with hidden effects, by physics of their own.

Nothing here comes from the effects, the approaches or the adjustment of the project, and the
diagnosis imports nothing from here: what the study finds, it finds in campaigns of somebody else.
"""

from accelstudy.hidden.physics.atlas import invisible_effects, visible_effects
from accelstudy.hidden.physics.case import SETS, Case, HiddenEffect, Truth
from accelstudy.hidden.physics.designs import APPROACHES, DESIGNS
from accelstudy.hidden.physics.effects import EFFECTS
from accelstudy.hidden.physics.generate import generate
from accelstudy.hidden.physics.gross import GROSS, visible_gross
from accelstudy.hidden.physics.noise import NOISES
from accelstudy.hidden.physics.oracle import visible_outside
from accelstudy.hidden.physics.outside import OUTSIDE

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
