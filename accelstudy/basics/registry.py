"""Registries: things found by their names, one module each."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pkgutil import iter_modules
from typing import ClassVar, Generic, TypeVar

from accelstudy.basics.errors import InputError, UnknownNameError

Item = TypeVar("Item")


class Registry(Generic[Item]):
    """Items by name, in order of registration.

    Parameters
    ----------
    kind : str
        What the items are, for messages.
    """

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self._items: dict[str, Item] = {}
        self._unlisted: frozenset[str] = frozenset()

    def check_free(self, name: str) -> None:
        """Raise `ValueError` if the name is taken."""
        if name in self._items:
            raise ValueError(f"{self.kind} {name!r} is registered twice")

    def add(self, name: str, item: Item) -> None:
        """Register an item; raise `ValueError` if its name is taken."""
        self.check_free(name)
        self._items[name] = item

    def get(self, name: str) -> Item:
        """Return the item of that name; raise `UnknownNameError` if there is none."""
        try:
            return self._items[name]
        except KeyError:
            raise UnknownNameError(self.kind, name, self._items) from None

    def names(self) -> tuple[str, ...]:
        """Names of all items."""
        return tuple(name for name in self._items if name not in self._unlisted)

    @contextmanager
    def without(self, names: Collection[str]) -> Iterator[None]:
        """Leave items out of `names` for a while; who knows of one can still get it."""
        before = self._unlisted
        self._unlisted = before | set(names)
        try:
            yield
        finally:
            self._unlisted = before


@dataclass(frozen=True)
class Hyper:
    """A number that shapes a thing; it is chosen or searched, not adjusted.

    Parameters
    ----------
    name, unit : str
    default : float; NaN leaves it open, and who uses the thing draws it
    above, below : float, between which it lies
    none : float, where the thing lacks what is shaped; allowed beside these, and left unsaid
    smooth : bool, whether the thing changes smoothly with it, so that a search can be refined
    """

    name: str
    unit: str
    default: float
    above: float = -math.inf
    below: float = math.inf
    smooth: bool = False
    none: float = math.nan


class Shaped:
    """Something with a name and with settings, written as ``name`` or ``name(setting=number)``.

    Attributes
    ----------
    kind : str, what it is, for messages
    name : str, canonical
    family : str, what it has in common with those that are easily taken for it; empty if there are
        none
    hypers : tuple of Hyper, its settings, found in ``self.shape``
    """

    kind: ClassVar[str]
    name: ClassVar[str]
    family: ClassVar[str] = ""
    hypers: ClassVar[tuple[Hyper, ...]] = ()

    def __init__(self, **shape: float) -> None:
        known = {hyper.name: hyper for hyper in self.hypers}
        for name, value in shape.items():
            if name not in known:
                raise UnknownNameError(f"setting of the {self.kind} {self.name!r}", name, known)
            above, below, none = known[name].above, known[name].below, known[name].none
            if value != none and not above < value < below:
                bounds = [f"above {above:g}"] if above > -math.inf else []
                bounds += [f"below {below:g}"] if below < math.inf else []
                raise InputError(
                    f"{self.kind} {self.name!r}: {name}={value:g} must be a number "
                    + (" and ".join(bounds) or "that is finite")
                    + ("" if math.isnan(none) else f", or {none:g}")
                )
        self.shape = {**{hyper.name: hyper.default for hyper in self.hypers}, **shape}

    @property
    def summary(self) -> str:
        """First line of what the class says of itself; empty if it says nothing."""
        return next(iter((type(self).__doc__ or "").strip().splitlines()), "")

    @property
    def spec(self) -> str:
        """Name with its settings, those left open or at `none` excepted: ``warm_up(tau=300)``."""
        fixed = [
            f"{hyper.name}={value:.12g}"
            for hyper in self.hypers
            if not math.isnan(value := self.shape[hyper.name]) and value != hyper.none
        ]
        return f"{self.name}({', '.join(fixed)})" if fixed else self.name


ShapedItem = TypeVar("ShapedItem", bound=Shaped)


class ShapedRegistry(Registry[ShapedItem]):
    """Things found by their name, or by their name and settings: ``warm_up(tau=300)``."""

    def get(self, spec: str) -> ShapedItem:
        """Return the item of that name, shaped as the settings say.

        Raises
        ------
        UnknownNameError
            If there is no such item or setting.
        InputError
            If the settings cannot be read.
        """
        match = re.fullmatch(r"\s*(\w+)\s*\(([^()]*)\)\s*", str(spec))
        if match is None:
            return super().get(spec)
        item = super().get(match[1])
        shape: dict[str, float] = {}
        for part in filter(None, map(str.strip, match[2].split(","))):
            key, _, value = part.partition("=")
            key = key.strip()
            if key in shape:
                raise InputError(f"{self.kind} {spec!r}: {key} is given twice")
            try:
                shape[key] = float(value)
            except ValueError:
                raise InputError(
                    f"{self.kind} {spec!r}: {part!r} is no setting; expected name=number"
                    + ("" if not item.hypers else f", such as {item.hypers[0].name}=300")
                ) from None
        return type(item)(**shape)


def import_modules(package: str, path: Iterable[str]) -> None:
    """Import all modules of a package, so that what they register is known."""
    for module in iter_modules(path):
        import_module(f"{package}.{module.name}")
