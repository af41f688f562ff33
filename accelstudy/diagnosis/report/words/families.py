"""The families of the catalogue, such as drifts and jumps of the bias."""

from __future__ import annotations

from accelstudy.campaign.gross_errors import get_gross_error, gross_error_names
from accelstudy.effects import effect_names, get_effect
from accelstudy.noise_effects import get_noise_effect, noise_effect_names


def family_of(*names: str) -> str:
    """Return the family that effects, noise effects or gross errors have in common, or nothing.

    Names that stand for none of these, such as "unknown", belong to no family.
    """
    families = {_family(name) for name in names}
    return families.pop() if len(families) == 1 else ""


def _family(name: str) -> str:
    """Family of a name of the catalogue; empty if it is none."""
    if name in effect_names():
        return get_effect(name).family
    if name in noise_effect_names():
        return get_noise_effect(name).family
    return get_gross_error(name).family if name in gross_error_names() else ""
