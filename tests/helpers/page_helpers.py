"""What a person reads on a page."""

import html
import re
from html.parser import HTMLParser

VOID = {"meta", "br", "link", "img", "hr", "input"}
NUMBER = re.compile(r"(?<![\w.])[-−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?: ?%)?")


def numbers(text: str) -> list[float]:
    """Numbers of a text, without their units."""
    return [float(number.rstrip(" %").replace("−", "-")) for number in NUMBER.findall(text)]


def digit_of(number: str) -> float:
    """Worth of the last digit of a computed number; 0 of a count, which has no other way to round.

    A whole number below 100 is a count, but for percentages.
    """
    mantissa, _, exponent = number.lstrip("-−").rstrip(" %").partition("e")
    if not exponent and "." not in mantissa and "%" not in number and len(mantissa) < 3:
        return 0.0
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def assert_told_alike(printed: str, quoted: str) -> None:
    """Assert that a page quotes what a command prints, as far as all processors agree.

    Words are the same, and spaces where there are any. A number may differ by one in the last
    digit, which rounding decides where the number lies between two.
    """
    assert NUMBER.sub("#", printed).split() == NUMBER.sub("#", quoted).split()
    pairs = zip(NUMBER.findall(printed), NUMBER.findall(quoted), strict=True)
    for one, other in pairs:
        differ = abs(numbers(one)[0] - numbers(other)[0])
        assert differ <= 1.001 * max(digit_of(one), digit_of(other)), f"{one}, not {other}"


def text_of(page: str) -> str:
    """Text of a page without tags, figures and style, in single spaces."""
    plain = re.sub(r"<(svg|style|title)\b.*?</\1>", " ", page, flags=re.DOTALL)
    plain = re.sub(r"</?(abbr|b|span|a|code)\b[^>]*>", "", plain)
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", plain)).split())


class _Nesting(HTMLParser):
    def __init__(self):
        super().__init__()
        self.open = []

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag, f"</{tag}> in the wrong place, line {self.getpos()}"


def assert_sound(page: str) -> None:
    """Assert that tags are nested well and that nothing unknown was printed."""
    parser = _Nesting()
    parser.feed(re.sub(r"<svg\b.*?</svg>", "", page, flags=re.DOTALL))
    assert not parser.open
    found = re.search(r"\b(nan|None|NaN|inf|NA|undefined|Undefined)\b|[{}]{2}", text_of(page))
    assert not found, text_of(page)[max(found.start() - 80, 0) : found.end() + 80]
    assert 'name="viewport"' in page
    assert "could not be" not in page
