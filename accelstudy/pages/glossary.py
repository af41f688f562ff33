"""The glossary: the terms of the pages, explained by hovering and at the foot of each page."""

from __future__ import annotations

import re
from html import escape

FOOT = "<!-- terms -->"
"""Where a page lists its terms."""

TERMS = {
    "a posteriori": "from the residuals of the adjustment",
    "a priori": "as stated beforehand, in the header of the campaign",
    "condition": "uncertainty of the least known combination of parameters over that of the best "
    "known; for the scaled design 1 is ideal and 10⁶ hopeless",
    "control variate": "a number whose mean is known, drawn with the same noise as one whose mean "
    "is wanted; only their difference is left to chance",
    "credible set": "the most probable explanations, as many as it takes for a probability of 0.9",
    "family": "effects that act alike and are easily confused",
    "global test": "whether the residuals together are as large as the stated noise says (χ² test "
    "of the whole model)",
    "held-out": "not used by a fit, which then predicts it; said of positions",
    "MDB": "minimal detectable bias: the error that a test of level 0.1 % finds with a power of "
    "80 %",
    "MIB": "minimal identifiable bias: the size at which an effect can also be distinguished from "
    "the one that is most similar to it",
    "misclosure": "amount by which a condition, such as |f| = g, fails before the adjustment",
    "p-value": "how often noise alone would look like this; not the probability that a name is "
    "right",
    "posterior probability": "how probable an explanation is after the data are seen, given that "
    "something is missing",
    "purity": "similarity of the members of a set, by the smallest cosine of two of them: near 1 "
    "they are rivals, near 0 they have nothing in common",
    "redundancy": "number of conditions minus number of unknowns: what is left to check a fit; 0 "
    "checks nothing",
    "residual": "difference between an observation and its value by the fit",
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
}
"""Other forms of the terms."""

_KNOWN = {**{term.lower(): term for term in TERMS}, **FORMS}
_WORD = re.compile(
    rf"(?<!\w)({'|'.join(map(re.escape, sorted(_KNOWN, key=len, reverse=True)))})(?!\w)",
    re.IGNORECASE,
)
_APART = re.compile(r"(<(svg|style|script|select|title|pre|code|a)\b.*?</\2>|<[^>]*>)", re.DOTALL)


def explain_terms(page: str) -> str:
    """Explain the terms of a page: at their first use by hovering, and all of them at its foot.

    Figures, links and commands stay unchanged. A page without the mark `FOOT` gets no list.
    """
    used: dict[str, str] = {}

    def mark(match: re.Match[str]) -> str:
        term = _KNOWN[match[0].lower()]
        if term in used:
            return match[0]
        used[term] = escape(TERMS[term])
        return f'<abbr title="{used[term]}">{match[0]}</abbr>'

    parts, end = [], 0
    for apart in _APART.finditer(page):
        parts += [_WORD.sub(mark, page[end : apart.start()]), apart[0]]
        end = apart.end()
    text = "".join([*parts, _WORD.sub(mark, page[end:])])
    terms = "".join(f"<dt>{term}</dt><dd>{used[term]}</dd>\n" for term in TERMS if term in used)
    return text.replace(FOOT, f"<h2>Terms</h2>\n<dl>\n{terms}</dl>" if used else "")
