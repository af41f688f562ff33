"""Kinds of keywords: how a verb checks what it is given, and what a command offers instead.

A kind may have a meaning, which stands in `Annotated` beside it. So what several verbs take is
explained once: `verb` writes it into the docstring of each, and commands and pages read it there.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, wraps
from os import PathLike
from pathlib import Path
from textwrap import fill
from typing import Annotated, Any, ParamSpec, TypeVar, get_args, get_origin

from accelstudy.api.given import each, of_type, path_of, quantity, whole
from accelstudy.basics import bounds
from accelstudy.basics.errors import InputError, key, shown
from accelstudy.basics.units import Given, unit_label

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

    def read(self, name: str, value: Any) -> str:
        """Name; whether there is such a thing, its registry says."""
        article = "an" if self.what[0] in "aeiou" else "a"
        value = str(value) if self.files and isinstance(value, PathLike) else value
        of_type(name, value, str, expected=f"the name of {article} {self.what.replace('_', ' ')}")
        return str(value)


@dataclass(frozen=True)
class FileOrFolder:
    """The path of a file or of a folder."""

    def read(self, name: str, value: Any) -> Path:
        """Path, which need not be there."""
        return path_of(name, value)


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


@dataclass(frozen=True)
class Numbers:
    """Numbers with a separator as text, or in a list.

    Attributes
    ----------
    example : str, as they are written
    separator : str
    count : int, how many there are; 0 for any
    """

    example: str
    separator: str = ","
    count: int = 0

    def read(self, name: str, value: Any) -> tuple[float, ...]:
        """Numbers, as many as there are."""
        parts = value.split(self.separator) if isinstance(value, str) else each(value)
        try:
            numbers = tuple(map(float, parts))
        except (TypeError, ValueError):
            numbers = ()
        if len(numbers) != (self.count or len(numbers) or 1):
            raise InputError(f"{name}: expected {self.example}, not {shown(value)}")
        return numbers


@dataclass(frozen=True)
class Word:
    """A text; what it may say, the verb knows."""

    def read(self, name: str, value: Any) -> str:
        """Text."""
        of_type(name, value, str, expected="a text")
        return str(value)


@dataclass(frozen=True)
class Place:
    """A column by its name, or by its number from 0."""

    def read(self, name: str, value: Any) -> str | int:
        """Name or number; whether there is such a column, the log says."""
        of_type(name, value, str, int, expected="the name of a column or its number")
        return value if isinstance(value, str) else int(value)


@dataclass(frozen=True)
class Pairs:
    """Names with values, as a mapping, or as text.

    Attributes
    ----------
    example : str, as they are written
    """

    example: str

    def read(self, name: str, value: Any) -> dict[str, Any]:
        """Mapping; the verb knows the names and what their values may be."""
        if isinstance(value, Mapping):
            return dict(value)
        of_type(name, value, str, expected=f"a mapping, or a text as {self.example}")
        pairs = [part.split("=", 1) for part in value.split(",")]
        if any(len(pair) != 2 for pair in pairs):
            raise InputError(f"{name}: expected {self.example} or the like, not {shown(value)}")
        return {key.strip(): said.strip() for key, said in pairs}


Quantity = float | str
"""A number in SI, or a text with a unit."""
RENAMED = {"sigma_angle": "robot_sigma", "robot_accuracy": "robot_sigma"}
"""Keywords of earlier versions, and what takes their place."""


def si(unit: str, least: float, most: float) -> Given:
    """Quantity of which a number without a unit is in SI, on the command line, too."""
    return Given(unit, "", least, most, bare=True)


File = Annotated[str | PathLike[str], FileOrFolder()]
Accuracy = Annotated[Quantity, Given("rad", "", 1e-9, math.pi / 2)]
Tilt = Annotated[Quantity, Given("rad", "", 1e-3, math.pi / 2)]

EFFECTS = Names("effect", "accelstudy.effects", "effect_names")
EffectName = Annotated[str, EFFECTS]
NoiseEffectName = Annotated[
    str, Names("noise_effect", "accelstudy.noise_effects", "noise_effect_names")
]
GrossErrorName = Annotated[
    str, Names("gross_error", "accelstudy.campaign.gross_errors", "gross_error_names")
]
SchemeName = Annotated[str, Names("scheme", "accelstudy.schemes", "scheme_names", True)]
SensorName = Annotated[str, Names("sensor", "accelstudy.data_sheets", "data_sheet_names", True)]
_APPROACHES = Names("approach", "accelstudy.approaches", "approach_names")
_BY = "Calibrate by gravity alone, or with the angles of a robot, too."
ApproachName = Annotated[str, _APPROACHES, _BY]
UsualApproach = Annotated[
    str | None, _APPROACHES, f"{_BY} [default: robot, if the campaign has its angles]"
]
ModelName = Annotated[
    str,
    Names("model", "accelstudy.sensors.models", "MODELS", True, EFFECTS),
    "A model: one that `accelstudy models` lists, a composition, or a YAML file.",
]
TypeFile = Annotated[
    str | PathLike[str] | None,
    FileOrFolder(),
    "The type.yaml of a lot: how its sensors scatter, as what is known of this one.",
]
Force = Annotated[bool, "Overwrite files of the same names, but never an input."]
Seed = Annotated[int, bounds.SEED, "Seed of all random numbers."]

# How the numbers of a log are read.
COLUMNS = Pairs("fx=1,fy=2,fz=3")
ColumnsOf = Annotated[
    Mapping[str, str | int] | str | None,
    COLUMNS,
    "Columns of fx, fy, fz, temperature and vibration, by name, or by number from 0: "
    "fx=1,fy=2,fz=3.",
]
Time = Annotated[str | int | None, Place(), "Column of the time, by name or number."]
TimeUnit = Annotated[
    str | None, Word(), "Unit of the time: s, ms, us or ns. [default: as named, or s]"
]
Rate = Annotated[
    Quantity | None,
    si("Hz", bounds.RATE.least, bounds.RATE.most),
    "Samples per second, where there is no time.",
]
Delimiter = Annotated[
    str | None, Word(), "Between columns of text: ; or tab or blank. [default: from its rows]"
]
Variable = Annotated[
    str | None, Word(), "Array of a MATLAB file, topic of a bag or instance of a ULog."
]
Unit = Annotated[
    str | None,
    Word(),
    "Unit of the readings: m/s^2, g, mg or counts. [default: as named, or m/s^2]",
]
PerAxis = Numbers("numbers, as 1.5 or 1,2,3")
Scale = Annotated[
    float | Sequence[float] | str | None,
    PerAxis,
    "For counts: m/s² per count, one number or three.",
]
Offset = Annotated[
    float | Sequence[float] | str | None,
    PerAxis,
    "For counts: reading at 0 m/s². [default: from the holds]",
]
Frame = Annotated[
    str | None, Word(), "Where x, y, z point: frd, flu, rfu … [default: frd; of ROS flu]"
]


@dataclass(frozen=True)
class Keyword:
    """A keyword of a verb.

    Attributes
    ----------
    name : str
    kind : what checks it: Given, Range, one of the classes above, or a plain type
    many : bool, whether it takes several
    ends : bool, whether it takes two values of its kind
    default : of the signature; `inspect.Parameter.empty` if it must be given
    optional : bool, whether it may be None
    meaning : str, of its kind
    """

    name: str
    kind: Any
    many: bool
    ends: bool
    default: Any
    optional: bool
    meaning: str

    @property
    def option(self) -> str:
        """Name of the option."""
        return option_of(self.name, self.many)

    @property
    def type(self) -> str:
        """Type in words, as a docstring has it."""
        unit = unit_label(getattr(self.kind, "unit", "1"))
        words = {
            Given: "float or str" if unit == "1" else f"float in {unit}, or str with a unit",
            bounds.Range: "int",
            Names: "str",
            FileOrFolder: "path",
            Share: "float or str",
            Numbers: "str, or several float",
            Pairs: "mapping or str",
            Place: "str or int",
            Word: "str",
        }
        word = words.get(type(self.kind)) or str(getattr(self.kind, "__name__", ""))
        return f"{word}, or several" if self.many else f"two of {word}" if self.ends else word

    def check(self, value: Any) -> Any:
        """Value as the verb works with it, quantities in SI; raises `InputError` if it is wrong."""
        if self.optional and (value is None or (isinstance(self.kind, Given) and value == "none")):
            return None
        name = key(self.name)
        if self.many:
            return tuple(self._check(name, one) for one in each(value))
        if self.ends:
            values = each(value)
            if len(values) != 2:
                raise InputError(f"{name}: expected two values, not {shown(value)}")
            return tuple(self._check(name, one) for one in values)
        return self._check(name, value)

    def _check(self, name: str, value: Any) -> Any:
        match self.kind:
            case Given():
                return quantity(name, value, self.kind)
            case bounds.Range():
                return whole(name, value, self.kind)
        if self.kind is bool:
            of_type(name, value, bool, expected="True or False")
            return value
        return self.kind.read(name, value)


def option_of(name: str, many: bool) -> str:
    """Name of the option of a keyword; one that is repeated has that of a single one."""
    return name.removesuffix("s") if many else name


@cache
def keywords(function: Callable[..., Any]) -> tuple[Keyword, ...]:
    """Keywords of a function, with the kinds of their annotations."""
    return tuple(
        keyword(function, one)
        for one in inspect.signature(function).parameters.values()
        if one.kind is one.KEYWORD_ONLY
    )


def keyword(function: Callable[..., Any], parameter: inspect.Parameter) -> Keyword:
    """Keyword of a parameter, with the kind of its annotation."""
    # Not by `get_type_hints`, which takes all parameters: that of a positional one may name a
    # result, which is not imported for a help text.
    hint = eval(parameter.annotation, getattr(inspect.unwrap(function), "__globals__", {}))
    optional = type(None) in get_args(hint)
    kind, meaning, ends = None, "", False
    while get_origin(hint) is not None:
        first, *more = get_args(hint)
        ends = ends or get_origin(hint) is tuple
        if get_origin(hint) is Annotated:
            optional = optional or type(None) in get_args(first)
            meaning = next((one for one in more if isinstance(one, str)), "")
            kind = next((one for one in more if not isinstance(one, str)), None)
        hint = first
        if kind is not None:
            break
    if kind is None:
        kind = Word() if hint is str else hint
    many = "Sequence" in parameter.annotation
    return Keyword(parameter.name, kind, many, ends, parameter.default, optional, meaning)


# --- docstrings ---------------------------------------------------------------------------------

_SECTION = "\n\nParameters\n----------\n"


def summary(function: Callable[..., Any]) -> str:
    """Return what a docstring says before its sections."""
    return (inspect.getdoc(function) or "").partition("\n\nParameters\n")[0]


@cache
def meanings(function: Callable[..., Any]) -> dict[str, str]:
    """Meaning of each parameter: the indented text below ``name : type`` of a NumPy docstring."""
    said = (inspect.getdoc(function) or "").partition(_SECTION)[2]
    items = re.findall(r"^(\w+(?:, \w+)*) : .*\n((?: {4}.*\n?)+)", said, re.MULTILINE)
    return {name: " ".join(text.split()) for names, text in items for name in names.split(", ")}


def _documented(function: Callable[..., Any]) -> str:
    """Docstring with the meanings of the kinds of those keywords that it leaves out."""
    head, _, rest = (inspect.getdoc(function) or "").partition(_SECTION)
    parts = re.split(r"\n\n(?=\w+\n-+\n)", rest if rest else head)
    own, sections = (parts[0], parts[1:]) if rest else ("", parts[1:])
    head = head if rest else parts[0]
    items = {
        name: item
        for item in re.findall(r"^\w.*\n(?: {4}.*\n?)+", own, re.MULTILINE)
        for name in item.partition(" : ")[0].split(", ")
    }
    parameters = inspect.signature(function).parameters
    for name, parameter in parameters.items():
        if name not in items and parameter.kind is parameter.KEYWORD_ONLY:
            one = keyword(function, parameter)
            text = fill(one.meaning, 88, initial_indent="    ", subsequent_indent="    ")
            items[name] = f"{name} : {one.type}\n{text}"
    ordered = dict.fromkeys(items[name].rstrip("\n") for name in parameters if name in items)
    return "\n\n".join([head + _SECTION + "\n".join(ordered), *sections]) if ordered else head


def check(function: Callable[..., Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Check keywords as a verb does; those that are not given have their defaults."""
    values = {one.name: given.get(one.name, one.default) for one in keywords(function)}
    checked = {
        one.name: one.check(values[one.name])
        for one in keywords(function)
        if values[one.name] is not inspect.Parameter.empty
    }
    return {**given, **checked}


def verb(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
    """Check the keywords of a function by their kinds, and name what is wrong as its user does."""

    @wraps(function)
    def within(*args: Arguments.args, **given: Arguments.kwargs) -> Returned:
        for old in given.keys() & RENAMED.keys():
            raise InputError(f"{old}: no longer a keyword; {RENAMED[old]} takes it")
        return function(*args, **check(function, given))

    within.__doc__ = _documented(function)
    within.__signature__ = inspect.signature(function)  # type: ignore[attr-defined]
    return within


def in_si(value: Quantity) -> float:
    """Return a quantity that `verb` has checked, which is in SI."""
    return float(value)


def paths(values: Sequence[Any]) -> list[Any]:
    """Those of some values that are paths."""
    return [value for value in values if isinstance(value, str | PathLike)]
