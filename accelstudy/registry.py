"""Registries: things found by their names, one module each."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from pkgutil import iter_modules
from typing import Generic, TypeVar

from accelstudy.errors import UnknownNameError

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
        return tuple(self._items)


def import_modules(package: str, path: Iterable[str]) -> None:
    """Import all modules of a package, so that what they register is known."""
    for module in iter_modules(path):
        import_module(f"{package}.{module.name}")
