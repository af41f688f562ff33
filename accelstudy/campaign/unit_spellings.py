"""Units by all the spellings in which loggers and people write them."""

from __future__ import annotations

_SPELLINGS = {
    "m/s^2": "m/s^2 m/s2 m/s/s m/sec^2 ms^-2 ms-2 mps2 mps^2 ms2",
    "g": "g g0 gn gs",
    "mg": "mg milli-g millig",
    "counts": "counts count lsb raw adc digits digit",
    "s": "s sec secs second seconds",
    "ms": "ms msec msecs millis millisecond milliseconds",
    "us": "us usec usecs micros microsecond microseconds",
    "ns": "ns nsec nsecs nanosecond nanoseconds",
    "degC": "c degc deg_c celsius",
    "other": "k degk kelvin f degf deg_f fahrenheit deg degs deg/s dps mdps rad rad/s gon t ut mt "
    "nt gauss mgauss ugauss pa hpa kpa mbar bar v mv % %rh rh m mm km m/s km/h hz khz min h hours",
    "": "- 1 none n/a",
}
_UNITS = {spelling: unit for unit, words in _SPELLINGS.items() for spelling in words.split()}
_PLAIN = str.maketrans({"²": "^2", "µ": "u", "μ": "u", "⁻": "-", "·": "", "*": "", ".": ""})


def parse_unit(text: str) -> str | None:
    """Unit by any usual spelling: "m/s^2", "g", …; "other" if unused here, None if it is none."""
    spelled = text.strip().lower().translate(_PLAIN).replace(" ", "").replace("°", "deg")
    return _UNITS.get(spelled.replace("℃", "degc"))
