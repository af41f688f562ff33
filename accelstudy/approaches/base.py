"""What an approach is, and the registry of approaches."""

from __future__ import annotations

from typing import Any, ClassVar

from accelstudy.basics.registry import Registry
from accelstudy.effects.components import Number, Vector


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


_registry: Registry[Approach] = Registry("approach", "approaches")
get_approach = _registry.get
approach_names = _registry.names
register = _registry.register
