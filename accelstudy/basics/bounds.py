"""The widest ranges that are accepted: wider than any measurement, and safe to compute with."""

from __future__ import annotations

from dataclasses import dataclass

from accelstudy.basics.errors import InputError, locate_errors


@dataclass(frozen=True)
class Range:
    """The values that a quantity may have.

    Attributes
    ----------
    least, most : float, both allowed
    unit : str, for messages; empty for a count
    zero : bool, whether 0 is allowed as well; it means "none"
    other : str, a unit in which values are larger by `shift` and often come; empty for none
    """

    least: float
    most: float
    unit: str = ""
    zero: bool = False
    other: str = ""
    shift: float = 0.0

    def check(self, value: float) -> float:
        """Return the value; raise `InputError` with the range if it is outside."""
        if self.least <= value <= self.most or (self.zero and value == 0):
            return value
        ends = f"from {_plain(self.least)} to {_plain(self.most)} {self.unit}".rstrip()
        meant = self.other and self.least <= value - self.shift <= self.most
        text = f"must be {'0, or ' if self.zero else ''}{ends}, not {_plain(value)}"
        raise InputError(f"{text}; is it in {self.other}?" if meant else text)

    def check_key(self, key: str, value: float) -> None:
        """Check the value of a key, which the error names."""
        with locate_errors(key):
            self.check(value)


def _plain(value: float) -> str:
    if isinstance(value, int):
        # Python writes no integer of more than 4300 digits.
        return str(value) if abs(value) <= 10**20 else "a huge number"
    return f"{value:.7g}"


GRAVITY = Range(1.0, 30.0, "m/s²")  # from the Moon, 1.6, to Jupiter, 25
GRAVITY_ERROR = Range(-1e2, 1e2, "m/s²")
# Forces are always observed, and an observation without noise would have an infinite weight. The
# best gravimeters resolve 1e-9 m/s².
SIGMA_FORCE = Range(1e-9, 1e3, "m/s²")
SIGMA_READING = Range(1e-9, 1e3, "m/s²", zero=True)
SIGMA_GRAVITY = Range(1e-9, 1e3, "m/s²", zero=True)
SIGMA_ANGLE = Range(1e-6, 4e5, "mgon", zero=True)
ANGLE = Range(-400.0, 400.0, "gon")
# The hottest accelerometers work in oil wells, at up to 200 °C; in kelvin none works at so little.
TEMPERATURE = Range(-273.15, 210.0, "°C", other="kelvin", shift=273.15)
VIBRATION = Range(0.0, 1e4, "m/s²")
TIME = Range(0.0, 1e12, "s")
INTERVAL = Range(1e-6, 1e6, "s")
RATE = Range(1e-6, 1e9, "per second")
# Parameters of sensors, in SI: no sensor has larger ones, and their squares stay finite.
PARAMETER = Range(-1e6, 1e6)
SIGMA_PARAMETER = Range(0.0, 1e9)

CELLS = Range(1, 100_000)
REPLICATES = Range(1, 10**6)
ATTITUDES = Range(1, 100_000)
BASE_SAMPLES = Range(2, 2**20)
POSITIONS = Range(1, 100_000)
SAMPLES = Range(2, 10**9)
SIZE = Range(1e-6, 1e6)
SEED = Range(0, 2**64 - 1)
