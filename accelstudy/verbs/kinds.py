"""Kinds of keywords: how a verb checks what it is given, and what a command offers instead."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, wraps
from os import PathLike
from types import SimpleNamespace
from typing import Annotated, Any, ParamSpec, TypeVar, get_args, get_origin, get_type_hints

from accelstudy.api.given import each, for_programs, of_type, path_of, quantity, whole
from accelstudy.basics import bounds
from accelstudy.basics.errors import InputError, key
from accelstudy.basics.units import Given

Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")


@dataclass(frozen=True)
class Names:
    """A name that a registry knows.

    Attributes
    ----------
    what : str, what is named
    module, names : str, where the names are: a collection, or a function that returns one
    files : bool, whether a file may stand for a name
    parts : Names, optional, what may be joined to a name by +
    """

    what: str
    module: str
    names: str
    files: bool = False
    parts: Names | None = None


@dataclass(frozen=True)
class FileOrFolder:
    """The path of a file or of a folder."""


@dataclass(frozen=True)
class Share:
    """A share of all calibrations, ``95%`` or ``0.95``, or their ``rms``."""

    rms: bool = False

    def read(self, name: str, value: Any) -> float | None:
        """Share, None for the rms."""
        from accelstudy.planning.question import confidence_of

        of_type(name, value, int, float, str, expected="a probability, as 0.95 or 95%")
        share = confidence_of(str(value).strip())
        if share is None and not self.rms:
            raise InputError(f"{name}: a probability, such as 95%, not rms")
        return share


EFFECTS = Names("effect", "accelstudy.effects", "effect_names")
ApproachName = Annotated[str, Names("approach", "accelstudy.approaches", "approach_names")]
ModelName = Annotated[str, Names("model", "accelstudy.sensors.models", "MODELS", True, EFFECTS)]
SchemeName = Annotated[str, Names("scheme", "accelstudy.schemes", "scheme_names", True)]
SensorName = Annotated[str, Names("sensor", "accelstudy.data_sheets", "data_sheet_names", True)]
File = Annotated[str | PathLike[str], FileOrFolder()]
Seed = Annotated[int, bounds.SEED]
Quantity = float | str
"""A number in SI, or a text with a unit."""
Accuracy = Annotated[Quantity, Given("rad", "", 1e-9, math.pi / 2)]
Tilt = Annotated[Quantity, Given("rad", "", 1e-3, math.pi / 2)]


@dataclass(frozen=True)
class Keyword:
    """A keyword of a verb.

    Attributes
    ----------
    name : str
    kind : what checks it: Given, Range, Share, Names, FileOrFolder, or a plain type
    many : bool, whether it takes several
    default : of the signature; `inspect.Parameter.empty` if it must be given
    help : str, from the docstring
    """

    name: str
    kind: Any
    many: bool
    default: Any
    help: str

    @property
    def option(self) -> str:
        """Name of the option; one that is repeated has that of a single one."""
        return self.name.removesuffix("s") if self.many else self.name

    def check(self, value: Any) -> Any:
        """Value as the verb works with it, quantities in SI; raises `InputError` if it is wrong."""
        if value is None and self.default is None:
            return None
        name = key(self.name, self.option)
        if self.many:
            return tuple(self._check(name, one) for one in each(value))
        return self._check(name, value)

    def _check(self, name: str, value: Any) -> Any:
        match self.kind:
            case Given():
                return quantity(name, value, self.kind)
            case bounds.Range():
                return whole(name, value, self.kind)
            case Share():
                return self.kind.read(name, value)
            case FileOrFolder():
                return path_of(name, value)
            case Names(what=what):
                of_type(name, value, str, expected=f"the name of {_a(what)}")
        return value


@cache
def keywords(function: Callable[..., Any]) -> tuple[Keyword, ...]:
    """Keywords of a function: kinds of the annotations, meanings of the docstring."""
    said = meanings(function)
    return tuple(
        Keyword(one.name, *_kind(function, one.annotation), one.default, said[one.name])
        for one in inspect.signature(function).parameters.values()
        if one.kind is one.KEYWORD_ONLY
    )


def _kind(function: Callable[..., Any], annotation: str) -> tuple[Any, bool]:
    """Return what checks an annotation, and whether it takes several."""
    # That of a positional parameter may name a result, which is not imported for a help text.
    alone = SimpleNamespace(__annotations__={"it": annotation})
    names = getattr(inspect.unwrap(function), "__globals__", {})
    hint = get_type_hints(alone, names, include_extras=True)["it"]
    many = "Sequence" in annotation
    while get_origin(hint) is not None:
        first, *more = get_args(hint)
        if get_origin(hint) is Annotated:
            return more[0], many
        hint = first
    return hint, many


def summary(function: Callable[..., Any]) -> str:
    """Return what a docstring says before its sections."""
    return inspect.getdoc(function).partition("\n\nParameters\n")[0]  # type: ignore[union-attr]


def meanings(function: Callable[..., Any]) -> dict[str, str]:
    """Meaning of each parameter: the indented text below ``name : type`` of a NumPy docstring."""
    said = (inspect.getdoc(function) or "").partition("\n\nParameters\n")[2]
    items = re.findall(r"^(\w+(?:, \w+)*) : .*\n((?: {4}.*\n?)+)", said, re.MULTILINE)
    return {name: " ".join(text.split()) for names, text in items for name in names.split(", ")}


def verb(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
    """Check the keywords of a function by their kinds, and name what is wrong as its user does."""

    @for_programs
    @wraps(function)
    def within(*args: Arguments.args, **given: Arguments.kwargs) -> Returned:
        for one in keywords(function):
            value = given.get(one.name, one.default)
            if value is not inspect.Parameter.empty:
                given[one.name] = one.check(value)
        return function(*args, **given)

    return within


def in_si(value: Quantity) -> float:
    """Return a quantity that `verb` has checked, which is in SI."""
    return float(value)


def paths(values: Sequence[Any]) -> list[Any]:
    """Those of some values that are paths."""
    return [value for value in values if isinstance(value, str | PathLike)]


def _a(noun: str) -> str:
    return f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}"
