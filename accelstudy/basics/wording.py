"""How all messages and pages write words, numbers and quantities: each rule stands once, here.

A number has three significant digits, what has a sigma has two digits of it, and a round quantity
is written as it was given.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from accelstudy.basics.units import attitude_unit, display_unit, to_attitude, to_display

SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
DIGITS = 3
"""Significant digits of a number."""
MAX_ROUND_DIGITS = 4
"""Significant digits up to which a quantity is round: given rather than computed."""
MAX_EXPONENT = 9
"""Exponent from which a number is written with a power of ten."""


def words(name: str) -> str:
    """Return a name of the catalogue as words."""
    return name.replace("_", " ")


def comma_list(items: Sequence[str], last: str = "and") -> str:
    """Join words: a, b and c; an empty text for no words."""
    if len(items) < 2:
        return "".join(items)
    return f"{', '.join(items[:-1])} {last} {items[-1]}"


def probability(value: float | None) -> str:
    """Show a probability; a dash where there is none."""
    if value is None:
        return "–"
    if value < 1e-12:
        return "< 10⁻¹²"
    if value < 9.5e-4:
        return _rounded(value, 2)[0]
    if value > 0.9995:
        return "> 0.999"
    return f"{value:.2g}" if value < 0.995 else f"{value:.3g}"


def p_value(value: float | None) -> str:
    """Show a p-value with its sign of relation: p = 0.03."""
    shown = probability(value)
    return f"p {shown}" if shown[0] in "<>" else f"p = {shown}"


def number(value: float | None) -> str:
    """Show a number with three significant digits; a dash where there is none.

    Digits before the point are not rounded away, as counts have them, too; a number with a sigma is
    for `estimate`.
    """
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value == 0:
        return "0"
    text, exponent = _rounded(value, DIGITS)
    if exponent < MAX_EXPONENT:
        text = f"{value:.{max(0, DIGITS - 1 - exponent)}f}"
    return text.replace("-", "−")


def amount(value: float | None, unit: str) -> str:
    """Show an SI value in the unit that people use, without the unit; angles are small ones."""
    return number(None if value is None else float(to_display(value, unit)))


def quantity_text(value: float, unit: str) -> str:
    """Show an SI value with the unit that people use.

    Angles from 1 gon on are attitudes. A round quantity was given, and no zeros are added: 30 gon,
    but 30.0 gon if it is 30.04.
    """
    shown, of = float(to_display(value, unit)), display_unit(unit)
    if unit == "rad" and abs(to_attitude(value)) >= 1:
        shown, of = float(to_attitude(value)), attitude_unit()
    text = f"{shown:.{MAX_ROUND_DIGITS}g}"
    is_round = "e" not in text and math.isclose(float(text), shown, rel_tol=1e-9)
    text = text.replace("-", "−") if is_round else number(shown)
    return f"{text} {of}".removesuffix(" 1")


def estimate(value: float, sigma: float | None, unit: str) -> tuple[str, str]:
    """Show an SI value and its sigma in the unit that people use, to two digits of the sigma.

    Where there is no sigma, a dash stands for it, and the value is a number.
    """
    if sigma is None or math.isnan(sigma):
        return amount(value, unit), number(None)
    both = [float(to_display(v, unit)) for v in (value, sigma)]
    digits = 1 - _rounded(both[1], 2)[1] if both[1] > 0 else 6
    if digits < 0:
        both, digits = [round(v, digits) for v in both], 0
    value_text, sigma_text = (f"{v:.{digits}f}".replace("-", "−") for v in both)
    return value_text, sigma_text


def _rounded(value: float, digits: int) -> tuple[str, int]:
    """Write a number with a power of ten, and return its exponent, too, after rounding."""
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa} · 10{str(int(exponent)).translate(SUPERSCRIPT)}", int(exponent)


def interval(low: float, high: float) -> str:
    """Show an interval; nothing where there is none."""
    return "" if math.isnan(low) else f"{number(low)} … {number(high)}"


def one_line(text: object, length: int = 100) -> str:
    """Text, or the message of an error, shortened to one line."""
    line = " ".join(str(text).split()) or type(text).__name__
    return line if len(line) <= length else f"{line[:length]} …"


def plural(number: int, noun: str) -> str:
    """Number and noun, in the plural unless the number is 1."""
    return f"{number} {noun}" + ("" if number == 1 else "s")


def words_with_counts(names: Sequence[str], said: Callable[[str], str] = words) -> list[str]:
    """Return names of the catalogue as words, equal ones together: warm up, 2 outlier positions."""
    many = ((names.count(name), said(name)) for name in dict.fromkeys(names))
    return [plural(number, noun) if number > 1 else noun for number, noun in many]


def short_list(names: Sequence[str], most: int = 20) -> str:
    """Names in one line: the first of many, and the beginnings of long ones."""
    shown = ", ".join(one_line(name, 30) if name.strip() else repr(name) for name in names[:most])
    return shown + (", …" if len(names) > most else "")
