"""How all messages and pages write words and numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence

SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


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
        digits, exponent = f"{value:.1e}".split("e")
        return f"{digits} · 10{str(int(exponent)).translate(SUPERSCRIPT)}"
    if value > 0.9995:
        return "> 0.999"
    return f"{value:.2g}" if value < 0.995 else f"{value:.3g}"


def p_value(value: float | None) -> str:
    """Show a p-value with its sign of relation: p = 0.03."""
    shown = probability(value)
    return f"p {shown}" if shown[0] in "<>" else f"p = {shown}"


def number(value: float) -> str:
    """Show a number with three significant digits; a dash where there is none."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value == 0:
        return "0"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{digits}f}".replace("-", "−")


def interval(low: float, high: float) -> str:
    """Show an interval; nothing where there is none."""
    return "" if math.isnan(low) else f"{number(low)} … {number(high)}"


def one_line(text: object, length: int = 100) -> str:
    """Text, or the message of an error, shortened to one line."""
    line = " ".join(str(text).split()) or type(text).__name__
    return line if len(line) <= length else f"{line[:length]} …"


def counted(number: int, noun: str) -> str:
    """Number and noun, in the plural unless the number is 1."""
    return f"{number} {noun}" + ("" if number == 1 else "s")


def short_list(names: Sequence[str], most: int = 20) -> str:
    """Names in one line: the first of many, and the beginnings of long ones."""
    shown = ", ".join(one_line(name, 30) if name.strip() else repr(name) for name in names[:most])
    return shown + (", …" if len(names) > most else "")
