"""Pages: the templates of a package, with the units that people read."""

from __future__ import annotations

from typing import Any

from jinja2 import Environment, PackageLoader

from accelstudy.study.report import number
from accelstudy.units import (
    GON,
    MGON,
    angle_note,
    attitude_unit,
    display_unit,
    to_attitude,
    to_display,
)


def page_environment(package: str, **options: Any) -> Environment:
    """Templates of a package below accelstudy, for a page of which each text is escaped.

    They can use ``angle`` and ``attitude``, filters that show what is recorded in mgon and in gon,
    the units that these choose, ``angle_unit`` and ``attitude_unit``, and ``angle_note``, which
    belongs where the first of them is used. `options` are those of jinja2.
    """
    loader = PackageLoader("accelstudy", package)
    environment = Environment(loader=loader, autoescape=True, **options)
    environment.filters.update(
        number=number,
        angle=lambda mgon: number(to_display(mgon * MGON, "rad").item()),
        attitude=lambda gon: to_attitude(gon * GON).item(),
    )
    environment.globals.update(
        angle_unit=display_unit("rad"),
        attitude_unit=attitude_unit(),
        angle_note=angle_note(),
    )
    return environment
