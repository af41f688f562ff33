"""The glossary: the terms of the pages, explained at the foot of each page that uses them."""

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

_NO_PROSE = re.compile(r"<(svg|style|script|select|title|pre|code|a)\b.*?</\1>|<[^>]*>", re.DOTALL)


def explain_terms(page: str) -> str:
    """Explain the terms of a page at its foot, where its mark is."""
    prose = _NO_PROSE.sub(" ", page)
    forms = {term: re.sub(r"\\?[ -]", "[ -]", re.escape(term)) for term in TERMS}
    used = [
        f"<dt>{term}</dt><dd>{escape(TERMS[term])}</dd>\n"
        for term, form in forms.items()
        if re.search(rf"(?<!\w){form}s?(?!\w)", prose, re.IGNORECASE)
    ]
    return page.replace(FOOT, f"<h2>Terms</h2>\n<dl>\n{''.join(used)}</dl>" if used else "")
