"""What a person reads on a page."""

import html
import re
from html.parser import HTMLParser

VOID = {"meta", "br", "link", "img", "hr", "input"}


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
