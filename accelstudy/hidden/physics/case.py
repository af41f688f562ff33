"""What is to be simulated, and the truth about what was."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

SETS = ("null", "noise", "one", "two", "removed", "outside", "gross", "invisible")


@dataclass(frozen=True)
class Case:
    """One kind of campaign.

    Attributes
    ----------
    set : str, of `SETS`
    design : str
    approach : str, "gravity" or "robot"
    sigma_known : bool, whether the campaign states its sigma
    effect : tuple of str, what is hidden
    lam : tuple of float, the noncentralities that they shall have; empty for effects that cannot be
        seen, which have usual sizes
    noise : str, kind of wrong noise; None where it is right
    gross : str, gross error; None for none
    """

    set: str
    design: str
    approach: str
    sigma_known: bool
    effect: tuple[str, ...] = ()
    lam: tuple[float, ...] = ()
    noise: str | None = None
    gross: str | None = None


@dataclass(frozen=True)
class HiddenEffect:
    """An effect in a campaign: with which settings and parameters, and how much of it shows."""

    name: str
    settings: dict[str, float]
    parameters: tuple[float, ...]
    lam: float


@dataclass(frozen=True)
class Truth:
    """All that is true of a campaign.

    Attributes
    ----------
    set, design, approach, sigma_known : as in the case
    seed : tuple of int, entropy and spawn key
    effects : tuple of HiddenEffect
    classes : tuple of tuple of str, for each effect the names that mean the same in this campaign
    noise : dict with kind, name (in the catalogue) and settings
    gross : dict with name (empty for none) and settings
    sensor : dict with the parameters of the sensor
    oracle : dict with detected, best, told and alternatives
    left : tuple of float, for the set "outside": how much of the noncentrality the best effect of
        the catalogue leaves, and the best two
    """

    set: str
    design: str
    approach: str
    sigma_known: bool
    seed: tuple[int, ...]
    effects: tuple[HiddenEffect, ...]
    classes: tuple[tuple[str, ...], ...]
    noise: dict[str, Any]
    gross: dict[str, Any]
    sensor: dict[str, Any]
    oracle: dict[str, Any]
    left: tuple[float, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """As plain values."""
        return plain(asdict(self))


def plain(value: Any) -> Any:
    """Turn tuples into lists, all the way down."""
    if isinstance(value, dict):
        return {key: plain(part) for key, part in value.items()}
    return [plain(part) for part in value] if isinstance(value, (list, tuple)) else value
