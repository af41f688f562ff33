"""The glossary: what the terms on the pages mean, in hover and at the foot of each page."""

from __future__ import annotations

import re
from html import escape

FOOT = "<!-- terms -->"
"""Where a page lists its terms."""

TERMS = {
    "a posteriori": "from the residuals of the adjustment",
    "a priori": "as stated beforehand, in the header of the campaign",
    "condition": "how much worse the least well known combination of parameters is known than the "
    "best; of the scaled design, 1 is ideal and 10⁶ hopeless",
    "credible set": "explanations, the most probable first, until they hold a probability of 0.9 "
    "together",
    "excess χ²": "what the squared residuals sum up to beyond what the noise explains",
    "family": "effects that are alike in what they do, and easily taken for each other",
    "global test": "whether the residuals together are as large as the stated noise says (χ² test "
    "of the whole model)",
    "held-out": "of positions that a fit did not use and then predicted",
    "MDB": "minimal detectable bias: the error that a test of level 0.1 % finds with a power of "
    "80 %",
    "MIB": "minimal identifiable bias: the size at which an effect can also be told from the one "
    "that it is most like",
    "misclosure": "what is left of a condition, such as |f| = g, before the adjustment",
    "p-value": "how often noise alone would look like this; no probability that a name is right",
    "posterior probability": "how probable an explanation is once the data are seen, given that "
    "something is missing",
    "purity": "how alike the members of a set are, by the smallest cosine of two of them: near 1 "
    "they are rivals, near 0 they are what happened to be left over",
    "redundancy": "conditions less unknowns: what is left to check a fit; 0 checks nothing",
    "residual": "what a fit leaves of an observation",
    "rms": "root of the mean square",
    "signature": "the pattern that an effect would leave in the residuals",
    "variance components": "factors on the stated variances of sensor and robot; 1 if both are "
    "right",
    "variance of unit weight": "mean square of the residuals in units of the stated noise; 1 if it "
    "is right",
    "σ̂0": "size of the residuals in units of the stated noise; 1 if it is right",
}
"""Terms in alphabetical order; a page explains those that it uses."""

FORMS = {
    "a-priori": "a priori",
    "held out": "held-out",
    "misclosures": "misclosure",
    "p-values": "p-value",
    "posterior": "posterior probability",
    "redundant": "redundancy",
    "residuals": "residual",
    "signatures": "signature",
    "variances of unit weight": "variance of unit weight",
}
"""Other forms under which they stand on a page."""

_KNOWN = {**{term.lower(): term for term in TERMS}, **FORMS}
_WORD = re.compile(
    rf"(?<!\w)({'|'.join(map(re.escape, sorted(_KNOWN, key=len, reverse=True)))})(?!\w)",
    re.IGNORECASE,
)
_APART = re.compile(r"(<(svg|style|script|select|title|pre|code|a)\b.*?</\2>|<[^>]*>)", re.DOTALL)


def explained(page: str) -> str:
    """Explain the terms of a page: the first time by hovering, and all of them at its foot.

    Figures, links and commands are left as they are. A page without the mark `FOOT` has no list.
    """
    found: dict[str, str] = {}

    def mark(match: re.Match[str]) -> str:
        term = _KNOWN[match[0].lower()]
        if term in found:
            return match[0]
        found[term] = escape(TERMS[term])
        return f'<abbr title="{found[term]}">{match[0]}</abbr>'

    parts, end = [], 0
    for apart in _APART.finditer(page):
        parts += [_WORD.sub(mark, page[end : apart.start()]), apart[0]]
        end = apart.end()
    text = "".join([*parts, _WORD.sub(mark, page[end:])])
    terms = "".join(f"<dt>{term}</dt><dd>{found[term]}</dd>\n" for term in TERMS if term in found)
    return text.replace(FOOT, f"<h2>Terms</h2>\n<dl>\n{terms}</dl>" if found else "")
