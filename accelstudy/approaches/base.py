"""What an approach is, and the registry of approaches."""

from __future__ import annotations

from typing import Any, ClassVar, TypeVar

from accelstudy.effects.base import Number, Vector
from accelstudy.errors import UnknownNameError


class Approach:
    """Condition equations of one position.

    Attributes
    ----------
    name : str
    n_conditions : int
        Condition equations per position.
    uses_angles : bool
        Whether roll and pitch of the position are observed from outside.
    """

    name: ClassVar[str]
    n_conditions: ClassVar[int]
    uses_angles: ClassVar[bool]

    def conditions(
        self, f: Vector, angles: tuple[Number, Number], g: Number, xp: Any
    ) -> tuple[Number, ...]:
        """Return ψ for the specific force `f` in the body frame; zero when all is consistent."""
        raise NotImplementedError


_REGISTRY: dict[str, Approach] = {}
ApproachClass = TypeVar("ApproachClass", bound=type[Approach])


def register(approach: ApproachClass) -> ApproachClass:
    """Class decorator: enter an approach into the registry under its name."""
    _REGISTRY[approach.name] = approach()
    return approach


def get_approach(name: str) -> Approach:
    """Return the approach registered under `name`; raise `UnknownNameError` if there is none."""
    try:
        return _REGISTRY[name]
    except KeyError:
        raise UnknownNameError("approach", name, _REGISTRY) from None


def approach_names() -> tuple[str, ...]:
    """Names of all registered approaches."""
    return tuple(_REGISTRY)
