"""Words and numbers as all messages and pages have them."""

from __future__ import annotations

from collections.abc import Sequence

SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def words(name: str) -> str:
    """Return a name of the catalogue as words."""
    return name.replace("_", " ")


def joined(items: Sequence[str], last: str = "and") -> str:
    """Join words: a, b and c; nothing of none."""
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
