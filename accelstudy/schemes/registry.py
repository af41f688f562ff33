"""What a position scheme is, and how it gets its name.

A module of this package holds one idea: a function that returns directions, and its registration.
"""

import difflib
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.errors import InputError

Array = NDArray[np.float64]
Status = Literal["exact", "standard", "stand-in", "generated"]
Builder = Callable[..., ArrayLike]
AnyBuilder = TypeVar("AnyBuilder", bound=Builder)


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
        does not publish its own; or positions that come from a rule and no one's campaign.
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
        directions = np.asarray(self.directions, dtype=np.float64)
        if directions.ndim != 2 or directions.shape[1] != 3 or len(directions) == 0:
            raise ValueError(f"directions must have the shape (n, 3), not {directions.shape}")
        length = np.linalg.norm(directions, axis=1, keepdims=True)
        if not np.all(np.isfinite(length) & (length > 0)):
            raise ValueError("directions must be finite vectors other than zero")
        directions = directions / length + 0.0  # -0.0 becomes 0.0
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

    def rotated(self, euler_xyz: ArrayLike) -> "Scheme":
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


class UnknownSchemeError(InputError):
    """A name that no scheme has."""


@dataclass(frozen=True)
class _Entry:
    template: str
    title: str
    status: Status
    source: str
    names: tuple[str, ...]
    build: Builder

    def scheme(self, name: str) -> Scheme | None:
        """Build the scheme if the name fits the template, as "fibonacci-24" fits "fibonacci-N"."""
        match = re.fullmatch(_pattern(self.template), name)
        if match is None:
            return None
        numbers = [int(group) for group in match.groups()]
        directions = np.asarray(self.build(*numbers), dtype=np.float64)
        title = f"{len(directions)} {self.title.format(*numbers)}"
        return Scheme(name, title, directions, self.status, self.source)


# Without leading zeros, so that a scheme has one name.
_NUMBERS = {"N": "([1-9][0-9]{0,3})", "SEED": "(0|[1-9][0-9]{0,17})"}

_entries: dict[str, _Entry] = {}


def register(
    template: str,
    *,
    title: str,
    status: Status,
    source: str,
    names: tuple[str, ...] | None = None,
) -> Callable[[AnyBuilder], AnyBuilder]:
    """Register the decorated function under a name, or under a family of names.

    Parameters
    ----------
    template : str
        The name, e.g. "mclaren-24". N stands for a number of positions (1 to 9999) and SEED for a
        seed: "random-N-SEED" makes a family, and the function gets the numbers as arguments.
    title, status, source : str
        See `Scheme`; the number of positions is put before the title, and {0}, {1} in it stand
        for the numbers of the name.
    names : tuple of str, optional
        The members of a family that `scheme_names` lists.

    Returns
    -------
    callable
        The decorator. The function it takes returns directions, array_like of shape (n, 3), of
        any length.

    Raises
    ------
    ValueError
        If the name is taken.
    """

    def decorate(build: AnyBuilder) -> AnyBuilder:
        if template in _entries:
            raise ValueError(f"a scheme {template!r} is registered already")
        listed = names if names is not None else () if _is_family(template) else (template,)
        _entries[template] = _Entry(template, title, status, source, listed, build)
        return build

    return decorate


def get_scheme(name: str) -> Scheme:
    """Look up a scheme by its name, or read it from a file.

    Parameters
    ----------
    name : str
        One of `scheme_names()`, a member of a family such as "fibonacci-60", the path of a YAML
        file with a scheme, or the name that such a scheme has got when it was read.

    Returns
    -------
    Scheme

    Raises
    ------
    UnknownSchemeError
        If there is no such scheme. The message lists what there is.
    InputError
        If a file cannot be read, or holds no scheme.
    """
    from accelstudy.schemes.files import is_scheme_file, known_scheme, scheme_of_file

    if is_scheme_file(name):
        return scheme_of_file(name)
    return known_scheme(name) or _registered(name)


@lru_cache
def _registered(name: str) -> Scheme:
    # A scheme registered under its very name goes before a family that the name fits.
    for entry in sorted(_entries.values(), key=lambda entry: _is_family(entry.template)):
        if scheme := entry.scheme(name):
            return scheme
    raise UnknownSchemeError(_unknown(name))


def scheme_names() -> tuple[str, ...]:
    """Names of the schemes to choose from, sorted by the number of positions.

    Families have more members than those listed here.
    """
    names = {name for entry in _entries.values() for name in entry.names}
    return tuple(sorted(names, key=lambda name: (get_scheme(name).n_positions, name)))


def scheme_families() -> tuple[str, ...]:
    """Templates of the families, e.g. "fibonacci-N"."""
    return tuple(sorted(template for template in _entries if _is_family(template)))


def _is_family(template: str) -> bool:
    return not _NUMBERS.keys().isdisjoint(template.split("-"))


def _pattern(template: str) -> str:
    return "-".join(_NUMBERS.get(word, re.escape(word)) for word in template.split("-"))


def _unknown(name: str) -> str:
    names, families = scheme_names(), scheme_families()
    meant = [*_members(re.findall("[0-9]+", name)), *names]  # the numbers are the user's
    close = difflib.get_close_matches(name.lower(), meant, n=1)
    hint = f" Did you mean {close[0]!r}?" if close else ""
    return (
        f"unknown scheme {name!r}.{hint} Schemes: {', '.join(names)}; "
        f"families: {', '.join(families)} (N from 1 to 9999)"
    )


def _members(numbers: list[str]) -> list[str]:
    """Members of the families that have these numbers in their names."""
    members = []
    for family in scheme_families():
        words = family.split("-")
        if len(numbers) == sum(word in _NUMBERS for word in words):
            given = iter(numbers)
            member = "-".join(next(given) if word in _NUMBERS else word for word in words)
            if re.fullmatch(_pattern(family), member):
                members.append(member)
    return members
