"""What a scheme is: the positions of a sensor, in the order in which they are taken."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from accelstudy.basics.arrays import Array

Status = Literal["exact", "standard", "stand-in", "generated"]


def unit_vectors(directions: ArrayLike) -> Array:
    """Scale vectors (n, 3) to unit length.

    Raises
    ------
    ValueError
        If they are not an (n, 3) array of finite vectors other than zero.
    """
    vectors = np.asarray(directions, dtype=np.float64)
    if vectors.ndim != 2 or vectors.shape[1] != 3 or len(vectors) == 0:
        raise ValueError(f"directions must have the shape (n, 3), not {vectors.shape}")
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not np.all(np.isfinite(length) & (length > 0)):
        raise ValueError("directions must be finite vectors other than zero")
    return vectors / length + 0.0  # -0.0 becomes 0.0


@dataclass(frozen=True, eq=False)
class Scheme:
    """Positions of the sensor in the gravity field.

    Attributes
    ----------
    name : str
        The name that `get_scheme` knows.
    title : str
        A short form for figures, e.g. "24 McLaren".
    directions : ndarray, shape (n, 3)
        Directions of the gravity vector g in the body frame, so that the specific force is
        f_b = -g * direction. Given at any length, kept as read-only unit vectors. The order of
        the rows is the order of acquisition: effects with a history (drift, hysteresis) see it.
    status : {"exact", "standard", "stand-in", "generated"}
        The positions of the source; the usual set of that kind; a substitute, because the source
        does not publish its own; or positions made by a rule that nobody has measured.
    source : str
        The citation.

    Raises
    ------
    ValueError
        If the directions are not an (n, 3) array of finite vectors other than zero.
    """

    name: str
    title: str
    directions: Array
    status: Status
    source: str

    def __post_init__(self) -> None:
        """Normalise the directions and make them read-only."""
        directions = unit_vectors(self.directions)
        directions.setflags(write=False)
        object.__setattr__(self, "directions", directions)

    @property
    def n_positions(self) -> int:
        """Number of positions."""
        return len(self.directions)

    @property
    def fourth_moment(self) -> float:
        """Mean of x²y² over the positions and the three pairs of axes; 1/15 on the sphere."""
        x2, y2, z2 = self.directions.T**2
        return float(np.mean(x2 * y2 + y2 * z2 + z2 * x2) / 3)

    @property
    def pole_distance(self) -> float:
        """Smallest angle to the roll pole, the +x or -x axis, where roll is undefined; rad."""
        x, y, z = self.directions.T
        return float(np.arctan2(np.hypot(y, z), np.abs(x)).min())

    def rotated(self, euler_xyz: ArrayLike) -> Scheme:
        """Turn the whole scheme by angles about the fixed axes x, then y, then z.

        Parameters
        ----------
        euler_xyz : array_like, shape (3,)
            The three angles in rad. Every direction u becomes R_z R_y R_x u.

        Returns
        -------
        Scheme
            The same positions in another orientation, named "<name>-rotated".
        """
        from scipy.spatial.transform import Rotation  # slow to import, and seldom needed

        matrix = Rotation.from_euler("xyz", euler_xyz).as_matrix()
        return replace(self, name=f"{self.name}-rotated", directions=self.directions @ matrix.T)
