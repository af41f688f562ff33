"""Pages (HTML, self-contained) and texts: one look, one glossary, one badge for each verdict.

Their words stand in templates; numbers are shown as `accelstudy.basics.wording` has it.
"""

from __future__ import annotations

import re
from functools import cache
from html import escape
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Undefined

from accelstudy.basics import units, wording
from accelstudy.basics.progress import failure
from accelstudy.files.outputs import write_text
from accelstudy.files.reading import read_layer
from accelstudy.sensors.frames import axes_note

FOOT = "<!-- terms -->"
"""Where a page explains its terms."""
_NO_PROSE = re.compile(r"<(svg|style|script|select|title|pre|code|a)\b.*?</\1>|<[^>]*>", re.DOTALL)
_CONTROLS = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")  # no page may have them

BADGES = {
    "accepted": ("✓ ACCEPTED", "good"),
    "rejected": ("✗ REJECTED", "bad"),
    "cannot tell": ("? CANNOT TELL", "open"),
    "implausible": ("! IMPLAUSIBLE", "wrong"),
    "not calibrated": ("✗ NOT CALIBRATED", "bad"),
    "no_effect": ("✓ NOTHING FOUND", "good"),
    "named": ("➜ NAMED", "found"),
    "narrowed": ("➜ NARROWED", "found"),
    "learned": ("➜ LEARNED", "found"),
    "unknown": ("? UNKNOWN", "open"),
    "noise_model": ("≈ NOISE", "noise"),
    "gross_error": ("! GROSS ERROR", "wrong"),
    "unchanged": ("✓ UNCHANGED", "good"),
    "changed": ("➜ CHANGED", "found"),
    "reproduced": ("✓ reproduced", "good"),
    "not reproduced": ("✗ not reproduced", "bad"),
    "slip in the paper": ("! slip in the paper", "noise"),
}
"""Word and colour class of each verdict; none rests on the colour alone."""
WORDS = ("amount", "plural", "number", "p_value", "short_list", "words")
"""Functions of `accelstudy.basics.wording` that templates use as filters of the same name."""


def render(template: str, **content: Any) -> str:
    """Render a page, with its terms explained.

    Templates can use ``angle`` and ``attitude``, filters that show what is recorded in mgon and in
    gon, the units that these choose, ``angle_unit`` and ``attitude_unit``, and ``angle_note``,
    which belongs where the first of them is used.

    Parameters
    ----------
    template : str, path of the template within the package; it extends `pages/base.html.j2`
    content : what the template shows. `next_steps`, pairs of what for and a command, stand at the
        end of the page
    """
    of_angles = {
        "angle_unit": units.display_unit("rad"),
        "attitude_unit": units.attitude_unit(),
        "angle_note": units.angle_note(),
    }
    page = explain_terms(_environment(True).get_template(template).render(of_angles | content))
    return _CONTROLS.sub(lambda control: control[0].encode("unicode_escape").decode("ascii"), page)


@cache
def terms() -> dict[str, str]:
    """The terms that pages explain, with their meanings."""
    return read_layer(Path(__file__).with_name("terms.yaml"))


def explain_terms(page: str) -> str:
    """Explain the terms of a page at its foot, where its mark is."""
    prose = _NO_PROSE.sub(" ", page)
    used = []
    for term, meaning in terms().items():
        form = re.sub(r"\\?[ -]", "[ -]", re.escape(term))  # some have hyphens, or a plural
        if re.search(rf"(?<!\w){form}s?(?!\w)", prose, re.IGNORECASE):
            used.append(f"<dt>{term}</dt><dd>{escape(meaning)}</dd>\n")
    return page.replace(FOOT, f"<h2>Terms</h2>\n<dl>\n{''.join(used)}</dl>" if used else "")


def write_page(path: Path, template: str, fallback: str, **content: Any) -> None:
    """Render and write a page; if that fails, one that says so, and a warning on stderr.

    Parameters
    ----------
    path : Path
    template, content : as in `render`
    fallback : str, what is said all the same
    """
    try:
        page = render(template, **content)
    except Exception as error:
        reason = failure("The page could not be made", error)
        page = (
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>Report</title>'
            f"</head>\n<body><p>{escape(fallback)}</p>\n<p>{escape(reason)}</p></body></html>\n"
        )
    write_text(path, page)


def render_text(template: str, **content: Any) -> str:
    """Render a file of plain text."""
    return _environment(False).get_template(template).render(content) + "\n"


def render_lines(template: str, part: str, *content: Any, **named: Any) -> list[str]:
    """Say something in plain text, one sentence or row a line.

    Parameters
    ----------
    template : str, path of the template within the package; it is made of macros
    part : str, the macro that says it
    content, named : its arguments

    Returns
    -------
    list of str, without empty lines
    """
    macro = getattr(_environment(False).get_template(template).module, part)
    return [line for line in map(str.rstrip, macro(*content, **named).splitlines()) if line]


@cache
def _environment(markup: bool) -> Environment:
    """Environment of the pages or, without markup, of the texts."""
    environment = Environment(
        loader=PackageLoader("accelstudy", ""),
        autoescape=markup,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=Undefined if markup else StrictUndefined,
    )
    environment.filters.update(
        {name: getattr(wording, name) for name in WORDS},
        angle=lambda mgon: wording.amount(None if mgon is None else mgon * units.MGON, "rad"),
        attitude=lambda gon: units.to_attitude(gon * units.GON).item(),
        axes=axes_note,
        badge=lambda verdict: BADGES[verdict][0],
        colour=lambda verdict: BADGES[verdict][1],
        comma_list=lambda items, last="and": wording.comma_list(list(items), last),
        each=lambda items, function: [function(item) for item in items],
        p=wording.probability,
        quantity=wording.quantity_text,
    )
    environment.globals.update(
        amount=wording.amount,
        estimate=wording.estimate,
        interval=wording.interval,
        unit=units.shown_unit,
    )
    return environment
