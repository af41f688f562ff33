"""Registries: things found by their names, one module each."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, ClassVar, Generic, Self, TypeVar

from accelstudy.basics import plugins
from accelstudy.basics.errors import InputError, UnknownNameError, check_name, locate_errors

Item = TypeVar("Item")
Kind = TypeVar("Kind", bound=type[Any])


class Registry(Generic[Item]):
    """Items by name, in order of registration.

    Parameters
    ----------
    kind : str
        What the items are, for messages.
    room : str, optional
        Room of the package for which installed packages may have items, too.
    check : function, optional
        Raises `InputError` if an item of a plug-in cannot be used.
    """

    def __init__(
        self, kind: str, room: str | None = None, check: Callable[[Item], None] | None = None
    ) -> None:
        self.kind = kind
        self._room, self._check = room, check
        self._items: dict[str, Item] = {}
        self._unlisted: frozenset[str] = frozenset()

    def add(self, name: str, item: Item, code: Any = None) -> None:
        """Register an item, of the class or function `code`; it replaces that of the same code.

        Raises
        ------
        InputError
            If its name is taken, or it is of a plug-in and cannot be used.
        """
        source = plugins.find_source(code or type(item))
        of_plugin = bool(source[0])
        again = of_plugin and source == plugins.source_of(self.kind, name)
        if name in self._items and not again:
            raise InputError(f"the {self.kind} {name!r} is there already; choose another name")
        if of_plugin:
            with locate_errors(f"{self.kind} {name!r}"):
                _check_complete(item)
                if self._check:
                    self._check(item)
            plugins.note_registration(self.kind, name, source)
        self._items[name] = item

    @property
    def _all_items(self) -> dict[str, Item]:
        """All items; those of installed packages are looked for when one is first asked for."""
        if self._room:
            room, self._room = self._room, ""
            plugins.load_installed(room)
        return self._items

    def register(self, kind: Kind) -> Kind:
        """Class decorator: enter one object of a class into the registry under its name."""
        self.add(getattr(kind, "name", kind.__name__), kind())
        return kind

    def unlisted(self, kind: Kind) -> Kind:
        """Enter one object of a class, which `names` does not list."""
        self._unlisted |= {kind.name}
        return self.register(kind)

    def __contains__(self, name: str) -> bool:
        return name in self._all_items

    def get(self, name: str) -> Item:
        """Return the item of that name; raise `UnknownNameError` if there is none."""
        try:
            return self._all_items[name]
        except KeyError:
            more = "" if self._room is None else plugins.HOW
            raise UnknownNameError(self.kind, name, self._all_items, more) from None

    def names(self) -> tuple[str, ...]:
        """Names of all items."""
        return tuple(name for name in self._all_items if name not in self._unlisted)

    @contextmanager
    def without(self, names: Collection[str]) -> Iterator[None]:
        """Leave items out of `names` within a ``with`` block; `get` still returns them."""
        before = self._unlisted
        self._unlisted = before | set(names)
        try:
            yield
        finally:
            self._unlisted = before


def _check_complete(item: object) -> None:
    """Raise `InputError` if a class lacks attributes that its bases declare without a value."""
    declared = [name for base in type(item).__mro__ for name in inspect.get_annotations(base)]
    if missing := [name for name in declared if not hasattr(item, name)]:
        raise InputError(f"lacks {', '.join(missing)}")


@dataclass(frozen=True)
class Setting:
    """A number that an effect or error takes; it is chosen or searched for, never adjusted.

    Parameters
    ----------
    name, unit : str
    default : float; NaN leaves it open, and it is drawn where the effect is used
    above, below : float, limits, both excluded
    none : float, allowed in spite of the limits: the effect then lacks what the setting describes,
        and its spec does not name the setting
    smooth : bool, whether the effect changes smoothly with it, so that a search can be refined
    """

    name: str
    unit: str
    default: float
    above: float = -math.inf
    below: float = math.inf
    smooth: bool = False
    none: float = math.nan

    @property
    def limits(self) -> str:
        """Its limits in words; empty without any."""
        ends = {"above": self.above, "below": self.below}
        return " and ".join(f"{word} {end:g}" for word, end in ends.items() if math.isfinite(end))


class WithSettings:
    """Something with a name and with settings, written as ``name`` or ``name(setting=number)``.

    Attributes
    ----------
    kind : str, what it is, for messages
    name : str, canonical
    family : str, what it has in common with those that are easily mistaken for it; empty if there
        are none
    takes : tuple of Setting, the settings that it takes
    settings : dict of name to number, the settings that it has
    """

    kind: ClassVar[str]
    name: ClassVar[str]
    family: ClassVar[str] = ""
    takes: ClassVar[tuple[Setting, ...]] = ()

    @classmethod
    def variant(cls, words: dict[str, str], settings: dict[str, float]) -> type[Self]:
        """Return the kind that words and settings choose."""
        return cls

    def __init__(self, **settings: float) -> None:
        takes = {setting.name: setting for setting in self.takes}
        for name, value in settings.items():
            check_name(f"setting of the {self.kind} {self.name!r}", name, takes)
            setting = takes[name]
            if value != setting.none and not setting.above < value < setting.below:
                raise InputError(
                    f"{self.kind} {self.name!r}: {name}={value:g} must be a number "
                    + (setting.limits or "that is finite")
                    + ("" if math.isnan(setting.none) else f", or {setting.none:g}")
                )
        self.settings = {**{setting.name: setting.default for setting in self.takes}, **settings}

    @property
    def words(self) -> Mapping[str, str]:
        """Words that choose its kind, by what they say."""
        return {}

    @property
    def summary(self) -> str:
        """First line of the docstring of the class; empty if it has none."""
        return next(iter((type(self).__doc__ or "").strip().splitlines()), "")

    @property
    def spec(self) -> str:
        """Name with its settings, ``warm_up(tau=300)``, except those that are open or `none`."""
        fixed = [f"{name}={word}" for name, word in self.words.items()]
        fixed += [
            f"{setting.name}={value:.12g}"
            for setting in self.takes
            if not math.isnan(value := self.settings[setting.name]) and value != setting.none
        ]
        return f"{self.name}({', '.join(fixed)})" if fixed else self.name


ItemWithSettings = TypeVar("ItemWithSettings", bound=WithSettings)


class RegistryWithSettings(Registry[ItemWithSettings]):
    """Things found by their name, or by their name and settings: ``warm_up(tau=300)``."""

    def add(self, name: str, item: ItemWithSettings, code: Any = None) -> None:
        """Register an item; raise `InputError` also if its name is no word."""
        if not re.fullmatch(r"\w+", name):
            raise InputError(f"{self.kind} {name!r}: a name has letters, digits and _ only")
        super().add(name, item, code)

    def get(self, spec: str) -> ItemWithSettings:
        """Return the item of that name, with the settings that are given.

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
        settings: dict[str, float] = {}
        words: dict[str, str] = {}
        for part in filter(None, map(str.strip, match[2].split(","))):
            key, _, value = part.partition("=")
            key = key.strip()
            if key in settings or key in words:
                raise InputError(f"{self.kind} {spec!r}: {key} is given twice")
            if key in item.words:
                words[key] = value.strip()
                continue
            try:
                settings[key] = float(value)
            except ValueError:
                raise InputError(
                    f"{self.kind} {spec!r}: {part!r} is no setting; expected name=number"
                    + ("" if not item.takes else f", such as {item.takes[0].name}=300")
                ) from None
        return type(item).variant(words, settings)(**settings)


def import_modules(package: str, path: Iterable[str]) -> None:
    """Import all modules of a package, so that what they register is known."""
    for module in iter_modules(path):
        import_module(f"{package}.{module.name}")
