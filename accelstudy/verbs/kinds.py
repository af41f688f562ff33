"""Kinds of keywords: how a verb checks what it is given, and what a command offers instead.

A kind may have a meaning, which stands in `Annotated` beside it. So what several verbs take is
explained once: `verb` writes it into the docstring of each, and commands and pages read it there.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from functools import cache, wraps
from os import PathLike
from pkgutil import resolve_name
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Any, ParamSpec, TypeVar, get_args, get_origin

import click
from click.shell_completion import CompletionItem

from accelstudy.basics import bounds
from accelstudy.basics.arguments import (
    as_sequence,
    check_type,
    path_of,
    quantity,
    to_python,
    whole_number,
)
from accelstudy.basics.bounds import Range
from accelstudy.basics.errors import OPTIONS, InputError, brief, key
from accelstudy.basics.levels import MAX_TILT_GON
from accelstudy.basics.units import InputQuantity
from accelstudy.verbs.retired import KEYWORDS as RETIRED

if TYPE_CHECKING:
    from accelstudy import Campaign

Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")


class Kind(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.5 on
    """What a keyword may be; a command takes any text for it, which the verb reads.

    Parameters
    ----------
    read : function of the name of a keyword and of what was given, which returns what the verb
        works with, and raises `InputError` if it is wrong
    name : str, in the help of a command
    files : bool, whether it is a file, or may be one
    """

    def __init__(
        self, read: Callable[[str, Any], Any], name: str = "text", files: bool = False
    ) -> None:
        self.read, self.name, self.files = read, name, files

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Files, where it may be one."""
        return [CompletionItem(incomplete, type="file")] if self.files else []


class Names(Kind):
    """A name that stands in a registry.

    Parameters
    ----------
    name : str, what is named
    place : str, "module:name" of the names: a collection, or a function that returns one
    files : bool, whether a file may stand for a name
    parts : Names, optional, what may be joined to a name by +
    """

    def __init__(
        self, name: str, place: str, files: bool = False, parts: Names | None = None
    ) -> None:
        super().__init__(self._read, name=name, files=files)
        self.place, self.parts = place, parts

    def _read(self, name: str, value: Any) -> str:
        """Name, or path of a file as text."""
        article, what = "an" if self.name[0] in "aeiou" else "a", self.name.replace("_", " ")
        paths = (PathLike,) if self.files else ()
        check_type(name, value, str, *paths, expected=f"the name of {article} {what}")
        return str(value)

    def known_names(self) -> Iterable[str]:
        """Names that there are."""
        known = resolve_name(self.place)
        return known() if callable(known) else known

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Names that begin with what was typed; files, if none does."""
        before, plus, last = incomplete.rpartition("+" if self.parts else "\0")
        known = [*self.known_names(), *(self.parts.known_names() if plus and self.parts else ())]
        items = [CompletionItem(f"{before}{plus}{one}") for one in known if one.startswith(last)]
        return items or super().shell_complete(ctx, param, incomplete)


class FilePath(Kind):
    """A path that a file can have; a command makes one of any text."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path."""
        return path_of("path", value)


def kind_of_annotation(said: Any) -> Kind:
    """Kind that an annotation names; a `Range` is one of whole numbers."""
    if isinstance(said, Range):
        return Kind(lambda name, value: whole_number(name, value, said), "integer")
    if isinstance(said, InputQuantity):
        return Kind(lambda name, value: quantity(name, value, said), "quantity")
    assert isinstance(said, Kind)
    return said


def kind_of_types(expected: str, *types: type, name: str = "text") -> Kind:
    """Return the kind of values of some types."""

    def read(name: str, value: Any) -> Any:
        check_type(name, value, *types, expected=expected)
        return value

    return Kind(read, name)


def _share_or_rms(name: str, value: Any) -> float | None:
    try:
        return None if value == "rms" else quantity(name, value, SHARE)
    except InputError as error:
        raise InputError(f"{error}; or rms") from None


def numbers(example: str, separator: str = ",", count: int = 0) -> Kind:
    """Numbers in a list, or as text such as the example; `count` of them, or any number."""

    def read(name: str, value: Any) -> tuple[float, ...]:
        parts = value.split(separator) if isinstance(value, str) else as_sequence(value)
        try:
            read = tuple(map(float, parts))
        except (TypeError, ValueError):
            read = ()
        if len(read) != (count or len(read) or 1):
            raise InputError(f"{name}: expected {example}, not {brief(value)}")
        return read

    return Kind(read, "numbers")


def pairs(example: str) -> Kind:
    """Names with values, as a mapping, or as text such as the example; the verb knows which."""

    def read(name: str, value: Any) -> dict[str, Any]:
        if isinstance(value, Mapping):
            return {key: to_python(said) for key, said in value.items()}
        check_type(name, value, str, expected=f"a mapping, or a text as {example}")
        pairs = [part.split("=", 1) for part in value.split(",")]
        if any(len(pair) != 2 for pair in pairs):
            raise InputError(f"{name}: expected {example} or the like, not {brief(value)}")
        return {key.strip(): said.strip() for key, said in pairs}

    return Kind(read, "columns")


def si(unit: str, least: float, most: float) -> InputQuantity:
    """Quantity of which a number without a unit is in SI, on the command line, too."""
    return InputQuantity(unit, least, most, bare=True)


def angle(least: float, most: float) -> InputQuantity:
    """Angle with its unit; a number is in rad."""
    return InputQuantity("rad", least, most)


Quantity = float | str
"""A number in SI, or a text with a unit."""
TEXT = kind_of_types("a text", str)
DATE = kind_of_types("a date, as 2026-03-01", str, date)
FLAG = kind_of_types("True or False", bool)
COLUMN = kind_of_types("the name of a column or its number", str, int, name="column")
PATH = FilePath(path_of, "path", files=True)
SHARE = si("1", 0.5, 0.999)
SHARE_OR_RMS = Kind(_share_or_rms, "share")
File = Annotated[str | PathLike[str], PATH]
Accuracy = Annotated[Quantity, angle(1e-9, math.pi / 2)]
Tilt = Annotated[Quantity, angle(1e-3, math.pi / 2)]
TILT_RANGE = f"{MAX_TILT_GON:g}gon"
Share = Annotated[Quantity, SHARE]
Gravity = Annotated[Quantity, si("m/s^2", bounds.GRAVITY.least, bounds.GRAVITY.most)]

EFFECTS = Names("effect", "accelstudy.effects:effect_names")
APPROACHES = Names("approach", "accelstudy.approaches:approach_names")
EffectName = Annotated[str, EFFECTS]
NoiseEffectName = Annotated[
    str, Names("noise_effect", "accelstudy.noise_effects:noise_effect_names")
]
SchemeName = Annotated[str, Names("scheme", "accelstudy.schemes:scheme_names", True)]
SensorName = Annotated[str, Names("sensor", "accelstudy.data_sheets:data_sheet_names", True)]
_BY = "Calibrate by gravity alone, or with the angles of a robot, too."
ApproachName = Annotated[str, APPROACHES, _BY]
UsualApproach = Annotated[
    str | None, APPROACHES, f"{_BY} [default: robot, if the campaign has its angles]"
]
ModelName = Annotated[
    str,
    Names("model", "accelstudy.sensors.models:MODELS", True, EFFECTS),
    "A model: one that `accelstudy catalogue models` lists, a composition, or a YAML file.",
]
TypeFile = Annotated[
    str | PathLike[str] | None,
    PATH,
    "The type.yaml of a lot: how its sensors scatter, as prior knowledge of this one.",
]
CampaignOrPath = Annotated[
    "Campaign | str | PathLike[str]", Kind(lambda name, value: value, "path", files=True)
]
Force = Annotated[bool, FLAG, "Overwrite files of the same names, but never an input."]
Seed = Annotated[int, bounds.SEED, "Seed of all random numbers."]

# How the numbers of a log are read.
COLUMNS = pairs("fx=1,fy=2,fz=3")
Columns = Annotated[
    Mapping[str, str | int] | str | None,
    COLUMNS,
    "Columns of fx, fy, fz, temperature and vibration, by name, or by number from 0: "
    "fx=1,fy=2,fz=3; temperature=none takes none.",
]
Time = Annotated[str | int | None, COLUMN, "Column of the time, by name or number."]
TimeUnit = Annotated[
    str | None, TEXT, "Unit of the time: s, ms, us or ns. [default: as named, or s]"
]
Rate = Annotated[
    Quantity | None,
    si("Hz", bounds.RATE.least, bounds.RATE.most),
    "Samples per second, for a log without times.",
]
Variable = Annotated[
    str | None, TEXT, "Array of a MATLAB file, topic of a bag or instance of a ULog."
]
Unit = Annotated[
    str | None, TEXT, "Unit of the readings: m/s^2, g, mg or counts. [default: as named, or m/s^2]"
]
PER_AXIS = numbers("numbers, as 1.5 or 1,2,3")
Scale = Annotated[
    float | Sequence[float] | str | None,
    PER_AXIS,
    "For counts: m/s² per count, one number or three.",
]
Offset = Annotated[
    float | Sequence[float] | str | None,
    PER_AXIS,
    "For counts: reading at 0 m/s². [default: from the holds]",
]
Frame = Annotated[
    str | None, TEXT, "Where x, y, z point: frd, flu, rfu … [default: frd; of ROS flu]"
]


@dataclass(frozen=True)
class Keyword:
    """A parameter of a verb.

    Attributes
    ----------
    name : str
    kind : Kind
    type : str, as a docstring has it
    many : bool, whether it takes several
    ends : bool, whether it takes two values of its kind
    default : of the signature; `inspect.Parameter.empty` if it must be given
    optional : bool, whether it may be None
    meaning : str, of its kind
    """

    name: str
    kind: Kind
    type: str
    many: bool
    ends: bool
    default: Any
    optional: bool
    meaning: str

    @classmethod
    def of(cls, function: Callable[..., Any], parameter: inspect.Parameter) -> Keyword:
        """Keyword of a parameter, with the kind of its annotation; without one it is a text."""
        said, default = parameter.annotation, parameter.default
        # Not by `get_type_hints`, which takes all parameters: that of a positional one may name a
        # result, which is not imported for a help text.
        hint = eval(said, getattr(inspect.unwrap(function), "__globals__", {}))
        kind, *meaning = _metadata(hint) or (FLAG if hint is bool else TEXT,)
        return cls(
            parameter.name,
            kind_of_annotation(kind),
            inspect.formatannotation(getattr(hint, "__origin__", hint)),
            many="Sequence" in said,
            ends=said.startswith("tuple"),
            default=default,
            optional=default is None or "None" in said,
            meaning="".join(meaning),
        )

    @property
    def option(self) -> str:
        """Option of the command; one that is repeated is called as a single one."""
        return f"--{(self.name.removesuffix('s') if self.many else self.name).replace('_', '-')}"

    def check(self, value: Any) -> Any:
        """Value as the verb works with it, quantities in SI; raises `InputError` if it is wrong."""
        value = to_python(value)
        if self.optional and (value is None or (self.kind.name == "quantity" and value == "none")):
            return None
        if not (self.many or self.ends):
            return self.kind.read(key(self.name), value)
        values = as_sequence(value)
        if self.ends and len(values) != 2:
            raise InputError(f"{key(self.name)}: expected two values, not {brief(value)}")
        return tuple(self.kind.read(key(self.name), one) for one in values)


def _metadata(hint: Any) -> tuple[Any, ...]:
    """Kind and meaning beside the type, wherever in it they stand."""
    if get_origin(hint) is Annotated:
        return tuple(hint.__metadata__)
    inner: Iterator[tuple[Any, ...]] = map(_metadata, get_args(hint))
    return next(filter(None, inner), ())


@cache
def keywords(function: Callable[..., Any]) -> dict[str, Keyword]:
    """Keywords of a function by their names, with the kinds of their annotations."""
    parameters = inspect.signature(function).parameters.values()
    each = (Keyword.of(function, one) for one in parameters if one.kind is one.KEYWORD_ONLY)
    return {one.name: one for one in each}


# --- docstrings ---------------------------------------------------------------------------------

_ITEM = re.compile(r"^(\w+(?:, \w+)*) : .*\n((?: {4}.*\n?)+)", re.MULTILINE)
"""``name : type`` of a NumPy docstring, and the indented text below it."""


def _sections(function: Callable[..., Any]) -> tuple[str, str, list[str]]:
    """What a docstring says first, its section on parameters, and the other sections."""
    head, *sections = re.split(r"\n\n(?=\w+\n-+\n)", inspect.getdoc(function) or "")
    others = [one for one in sections if not one.startswith("Parameters\n")]
    return head, next((one for one in sections if one not in others), ""), others


def summary(function: Callable[..., Any]) -> str:
    """Return what a docstring says before its sections."""
    return _sections(function)[0]


def examples(function: Callable[..., Any]) -> list[str]:
    """Return the commands that a docstring shows, which may go on in a line that is indented."""
    shown = [one for one in _sections(function)[2] if one.startswith("Examples\n")]
    lines = re.findall(r"^ {4}\S.*(?:\n {8}.*)*", "".join(shown), re.MULTILINE)
    return [" ".join(line.split()) for line in lines]


@cache
def meanings(function: Callable[..., Any]) -> dict[str, str]:
    """Meaning of each parameter in a docstring."""
    items = _ITEM.findall(_sections(function)[1])
    return {name: " ".join(text.split()) for names, text in items for name in names.split(", ")}


def _documented(function: Callable[..., Any]) -> str:
    """Docstring with the meanings of the kinds of those keywords that it leaves out."""
    head, own, others = _sections(function)
    items = {name: item[0] for item in _ITEM.finditer(own) for name in item[1].split(", ")}
    for name, one in keywords(function).items():
        text = fill(one.meaning, 88, initial_indent="    ", subsequent_indent="    ")
        items.setdefault(name, f"{name} : {one.type}\n{text}")
    names = (name for name in inspect.signature(function).parameters if name in items)
    listed = "\n".join(dict.fromkeys(items[name].rstrip("\n") for name in names))
    section = [f"Parameters\n----------\n{listed}"] if listed else []
    return "\n\n".join([head, *section, *others])


def check(function: Callable[..., Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Check keywords as a verb does; those that are not given have their defaults."""
    return {**values} | {
        name: one.check(value)
        for name, one in keywords(function).items()
        if (value := values.get(name, one.default)) is not inspect.Parameter.empty
    }


def refuse_retired(function: Callable[..., Any], names: Iterable[str]) -> None:
    """Say what takes the place of a keyword of earlier versions that is among those given."""
    what = "a keyword" if OPTIONS.get() is None else "an option"
    instead = RETIRED.get(function.__name__, {})
    for old in instead.keys() & {*names}:
        raise InputError(f"{key(old)}: no longer {what}; {instead[old]}")


def verb(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
    """Check the keywords of a function by their kinds, and name what is wrong as its user does."""

    @wraps(function)
    def within(*args: Arguments.args, **keywords: Arguments.kwargs) -> Returned:
        refuse_retired(function, keywords)
        return function(*args, **check(function, keywords))

    within.__doc__ = _documented(function)
    return within
