"""How a scheme gets its name, and is found by it.

A module of this package holds one idea: a function that returns directions, and its registration.
"""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import TypeVar

from numpy.typing import ArrayLike

from accelstudy.basics.arguments import check_type
from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.plugins import HOW, cached_lookup
from accelstudy.basics.registry import Registry
from accelstudy.positions.scheme import Scheme, Status, unit_vectors
from accelstudy.schemes.files import is_scheme_file, known_scheme, scheme_of_file

Builder = Callable[..., ArrayLike]
AnyBuilder = TypeVar("AnyBuilder", bound=Builder)


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
        built = self.build(*numbers)
        try:
            directions = unit_vectors(built)
        except ValueError as error:
            raise InputError(f"scheme {name!r}: {error}") from None
        title = f"{len(directions)} {self.title.format(*numbers)}"
        return Scheme(name, title, directions, self.status, self.source)


# Without leading zeros, so that a scheme has one name.
_NUMBERS = {"N": "([1-9][0-9]{0,3})", "SEED": "(0|[1-9][0-9]{0,17})"}

_registry: Registry[_Entry] = Registry("scheme", "schemes")


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
    InputError
        If the name is taken.
    """

    def decorate(build: AnyBuilder) -> AnyBuilder:
        listed = names if names is not None else () if _is_family(template) else (template,)
        entry = _Entry(template, title, status, source, listed, build)
        _registry.add(template, entry, build)
        return build

    return decorate


def get_scheme(name: str | PathLike[str]) -> Scheme:
    """Look up a scheme by its name, or read it from a file.

    Parameters
    ----------
    name : str or path
        One of `scheme_names()`, a member of a family such as "fibonacci-60", the path of a YAML
        file with a scheme, or the name that such a scheme got when it was read.

    Returns
    -------
    Scheme

    Raises
    ------
    UnknownNameError
        If there is no such scheme. The message lists what there is.
    InputError
        If a file cannot be read, or holds no scheme.
    """
    check_type("scheme", name, str, PathLike, expected="the name of a scheme, or a file")
    name = str(name)
    if is_scheme_file(name):
        return scheme_of_file(name)
    return known_scheme(name) or _registered(name)


@cached_lookup
def _registered(name: str) -> Scheme:
    # A scheme that has exactly this name goes before a family that it fits.
    for entry in sorted(_entries(), key=lambda entry: _is_family(entry.template)):
        if scheme := entry.scheme(name):
            return scheme
    if os.path.splitext(name)[1] or os.path.isfile(name):
        raise InputError(
            f"{name}: no scheme; a file with one is YAML (directions: [[x, y, z], …]) and its "
            "name ends in .yaml or .yml"
        )
    families = f"; families, N from 1 to 9999: {', '.join(scheme_families())}"
    raise UnknownNameError("scheme", name, scheme_names(), families + HOW)


def scheme_names() -> tuple[str, ...]:
    """Names of the schemes to choose from, sorted by the number of positions.

    Families have more members than those listed here.
    """
    names = {name for entry in _entries() for name in entry.names}
    return tuple(sorted(names, key=lambda name: (get_scheme(name).n_positions, name)))


def scheme_families() -> tuple[str, ...]:
    """Templates of the families, e.g. "fibonacci-N"."""
    return tuple(sorted(filter(_is_family, _registry.names())))


def _entries() -> list[_Entry]:
    return [_registry.get(template) for template in _registry.names()]


def _is_family(template: str) -> bool:
    return not _NUMBERS.keys().isdisjoint(template.split("-"))


def _pattern(template: str) -> str:
    return "-".join(_NUMBERS.get(word, re.escape(word)) for word in template.split("-"))
