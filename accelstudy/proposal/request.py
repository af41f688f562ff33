"""A request for a design, in words and numbers, and its meaning."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

from accelstudy.approaches import get_approach
from accelstudy.basics.bounds import Range
from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import GON, STANDARD_GRAVITY, parse_quantity
from accelstudy.design.criteria import CRITERIA, DISCRIMINATE, ROBUST, Criterion, get_criterion
from accelstudy.design.search import STARTS, Search
from accelstudy.design.spaces import Attitudes, find_attitudes
from accelstudy.design.task import Task
from accelstudy.effects import get_effect
from accelstudy.leveling.error import MAX_TILT_GON
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise

SPACES = ("all", "cube", "hand")
MOST_POSITIONS = Range(1, 300)


@dataclass(frozen=True)
class Request:
    """A design that is asked for; SI.

    Attributes
    ----------
    positions : int, how many new ones
    model, approach : str
    criterion : str, of `CRITERIA`
    tilt_range : float, rad
    noise : Noise
    gravity : float, m/s²
    attitudes : str, of `SPACES`, or the path of a CSV file with those that are allowed
    roll, pitch : (least, most), rad, optional
    pole_distance, least_angle : float, rad, optional
    prior : tuple of str, parameters known before, as "bias=20mg" or "s_x=500ppm"
    after : str, scheme that was measured before, optional
    neglect : tuple of str, effects that the model leaves out, as "quadratic_scale=50ug/g^2"
    discriminate : (effect, effect), optional
    seed, starts : int
    """

    positions: int
    model: str = "bias-scale-nonorthogonality"
    approach: str = "robot"
    criterion: str = "I"
    tilt_range: float = MAX_TILT_GON * GON
    noise: Noise = field(default_factory=Noise)
    gravity: float = STANDARD_GRAVITY
    attitudes: str = "all"
    roll: tuple[float, float] | None = None
    pitch: tuple[float, float] | None = None
    pole_distance: float | None = None
    least_angle: float | None = None
    prior: tuple[str, ...] = ()
    after: str | None = None
    neglect: tuple[str, ...] = ()
    discriminate: tuple[str, str] | None = None
    seed: int = 1
    starts: int = STARTS

    def __post_init__(self) -> None:
        MOST_POSITIONS.check_key("positions", self.positions)
        if self.criterion not in CRITERIA:
            raise UnknownNameError("criterion", self.criterion, CRITERIA)
        if (self.neglect or self.discriminate) and self.criterion != "I":
            raise InputError(
                f"criterion {self.criterion}: effects that are neglected, or told apart, have a "
                "criterion of their own; leave it out"
            )
        if self.neglect and self.discriminate:
            raise InputError("neglect and discriminate exclude each other; give one of them")

    @cached_property
    def task(self) -> Task:
        """What is to be calibrated."""
        model = get_model(self.model)
        prior: dict[str, float] = {}
        named = {effect.name: effect.parameters for effect in model.effects}
        named |= {parameter.name: (parameter,) for parameter in model.parameters}
        for text in self.prior:
            name, size = _split_size(text, "prior")
            if name not in named:
                raise UnknownNameError(f"effect or parameter of {self.model!r}", name, [*named])
            for parameter in named[name]:
                prior[parameter.name] = _positive(text, size, parameter.unit, "prior")
        neglected: dict[str, float] = dict.fromkeys(self._rivals, 0.0)
        for text in self.neglect:
            name, size = _split_size(text, "neglect", needs_size=False)
            effect = get_effect(name)
            unit = effect.parameters[0].unit
            neglected[effect.spec] = (
                _positive(text, size, unit, "neglect") if size else effect.typical[1]
            )
        in_model = {effect.spec for effect in model.effects}
        for spec in neglected:
            if spec in in_model:
                raise InputError(f"the effect {spec!r} is in the model; it is not neglected")
        return Task(
            model,
            get_approach(self.approach),
            self.noise,
            self.gravity,
            self.tilt_range,
            prior,
            None if self.after is None else get_scheme(self.after).directions,
            neglected,
        )

    @cached_property
    def _rivals(self) -> tuple[str, ...]:
        specs = tuple(get_effect(name).spec for name in self.discriminate or ())
        if len(set(specs)) < len(specs):
            raise InputError(f"discriminate: {specs[0]!r} twice; give two effects")
        return specs

    @cached_property
    def chosen(self) -> Criterion:
        """The criterion."""
        own = DISCRIMINATE if self.discriminate else ROBUST if self.neglect else self.criterion
        return get_criterion(own, self.task)

    @cached_property
    def allowed(self) -> Attitudes:
        """The attitudes to choose from, and what constrains the positions."""
        return replace(
            find_attitudes(self.attitudes, SPACES),
            roll=self.roll,
            pitch=self.pitch,
            pole_distance=self.pole_distance,
            least_angle=self.least_angle,
        )

    @property
    def search(self) -> Search:
        """The search for the positions."""
        return Search(self.task, self.chosen, self.positions, self.allowed, self.seed)


def _split_size(text: str, key: str, needs_size: bool = True) -> tuple[str, str]:
    """Split "name=size"; an effect may have settings of its own, with equal signs."""
    name, equal, size = text.rpartition("=")
    if equal and ")" not in size:
        return name.strip(), size.strip()
    if needs_size:
        raise InputError(f"{key}: expected NAME=SIZE, as bias=20mg, not {text!r}")
    return text.strip(), ""


def _positive(text: str, size: str, unit: str, key: str) -> float:
    try:
        value = parse_quantity(size, unit)
    except InputError as error:
        raise InputError(f"{key}: {text}: {error}") from None
    if not value > 0:
        raise InputError(f"{key}: {text}: must be more than 0")
    return value
