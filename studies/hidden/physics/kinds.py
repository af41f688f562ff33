"""What a kind of physics is: a function, what it changes, what it needs, and how it is drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from studies.hidden.physics.designs import Array, Session

Place = tuple[str, str]
"""Coordinate and target of a function."""

OUTPUTS = ("output", "clipping")
"""Targets of the sensor: what its output gains, by the force along its axes or by the output."""
RIG: Mapping[str, Array | float] = {
    "gravity": 0.0,
    "tilt": np.zeros(3),
    "skew": 0.0,
    "deflection": 0.0,
    "mounting": np.zeros(3),
    "reading": 0.0,
}
"""Targets of the rig, as in an ideal one: gravity less the stated one, m/s²; rotation of the base
(B, n, 3); turn of the roll axis against the pitch axis (B, n); attitude of the flange less that of
the joints (B, n, 2); rotation of the sensor on it (B, n, 3); errors of the encoders (B, n, 2)."""
OF_ROBOT = ("angle", "yaw", "move")
"""Coordinates that a campaign without the robot's angles does not have."""
COUNTS = {"output": 3, "clipping": 3, "gravity": 1, "tilt": 2, "skew": 1, "deflection": 2,
          "mounting": 3, "reading": 2}  # fmt: skip
"""Target -> its number of parameters, where a kind has no other."""


@dataclass(frozen=True)
class Settings:
    """Settings of a kind: a random draw, and a grid that covers all there may be."""

    draw: Callable[[Session, np.random.Generator], dict[str, float]] = lambda x, rng: {}
    grid: Callable[[Session], list[dict[str, float]]] = lambda x: [{}]


@dataclass(frozen=True)
class Kind:
    """One kind of physics.

    Attributes
    ----------
    name : str, canonical, if the catalogue has it
    target : str, of `OUTPUTS` or `RIG`
    typical : float, usual size of a parameter, SI
    function : change of the target by parameters p (B, 1, k), forces f (B, n, 3), settings s and
        the session x
    needs : attributes of a session without which it does not exist
    settings : Settings
    place : coordinate and target, if it is a function of one coordinate that changes one `FACTORS`
    count : int, number of parameters k
    """

    name: str
    target: str
    typical: float
    function: Callable[..., Array]
    needs: tuple[str, ...] = ()
    settings: Settings = Settings()
    place: Place | None = None
    count: int = 0

    @property
    def k(self) -> int:
        """Number of parameters."""
        return self.count or COUNTS[self.target]

    def shows(self, session: Session) -> bool:
        """Whether a session has what it needs."""
        return all(getattr(session, name) is not None for name in self.needs)

    def has_place(self, robot: bool) -> bool:
        """Whether it has a place whose coordinate a campaign records, with the robot or without."""
        return self.place is not None and (robot or self.place[0] not in OF_ROBOT)


@dataclass(frozen=True)
class Cause:
    """A kind with its settings and a batch of its parameters (B, k)."""

    kind: Kind
    settings: dict[str, float]
    parameters: Array

    def change(self, force: Array | None, session: Session) -> Array:
        """What it adds to its target."""
        return self.kind.function(self.parameters[:, None, :], force, self.settings, session)


def table(*kinds: Kind) -> dict[str, Kind]:
    """Kinds by name."""
    return {kind.name: kind for kind in kinds}


def tilted(p: Array) -> Array:
    """Rotations (B, n, 3) by which the base sees g (a, b, −1) for g (0, 0, −1), of a and b."""
    return np.stack([p[..., 1], -p[..., 0], np.zeros(p.shape[:-1])], axis=-1)


STILL = 0.02
"""m/s², a step between holds that is too small for any effect."""


def steps_of(f: Array) -> Array:
    """Steps from hold to hold of forces (B, n, 3); of those that keep still, 0."""
    step = np.zeros(f.shape)
    step[:, 1:] = f[:, 1:] - f[:, :-1]
    step[abs(step) < STILL] = 0
    return step
