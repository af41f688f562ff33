"""What an approach is, and the registry of approaches."""

from __future__ import annotations

from typing import Any, ClassVar

from accelstudy.basics.errors import InputError
from accelstudy.basics.registry import Registry
from accelstudy.effects.components import Number, Vector
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.tracing import symbolic, symbols


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

    def force(self, angles: tuple[Number, Number], g: Number, xp: Any) -> Vector | None:
        """Return the specific force in the body frame, if the angles tell it."""
        return None

    def conditions(
        self, f: Vector, angles: tuple[Number, Number], g: Number, xp: Any
    ) -> tuple[Number, ...]:
        """Return ψ for the specific force `f` in the body frame; zero when all is consistent."""
        force = self.force(angles, g, xp)
        if force is None:
            raise NotImplementedError
        return tuple(a - b for a, b in zip(f, force, strict=True))


def _check(approach: Approach) -> None:
    """Check the conditions of a plug-in against what it says of them, as tests do with all others.

    Raises
    ------
    InputError
        If they are of another number, or depend on angles that are not observed.
    """
    angles, (g,) = symbols("roll", "pitch"), symbols("g")
    conditions = approach.conditions(symbols("x", "y", "z"), angles, g, symbolic)
    if len(conditions) != approach.n_conditions:
        raise InputError(f"has {len(conditions)} conditions, not {approach.n_conditions}")
    if not approach.uses_angles and sp.Matrix(conditions).free_symbols & {*angles}:
        raise InputError("has conditions on angles, but uses_angles is false")


_registry: Registry[Approach] = Registry("approach", "approaches", _check)
get_approach = _registry.get
approach_names = _registry.names
register = _registry.register
