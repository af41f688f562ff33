"""The jobs of `workflow/rules/plan.smk`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl

from accelstudy.basics.errors import InputError
from accelstudy.drawing.saving import save
from accelstudy.drawing.style import DPI, STYLE
from accelstudy.files.tables import write_table
from accelstudy.plan.batch.comparison import front_figure, front_table
from accelstudy.plan.batch.config import PlanCase
from accelstudy.plan.report.output import plan_files
from accelstudy.plan.report.wording import unreachable
from accelstudy.plan.search.answer import answer


def make_plan(
    name: str,
    case: Mapping[str, Any],
    replicates: int,
    folder: str | Path,
    provenance: Mapping[str, Any],
) -> None:
    """Make one plan.

    Raises
    ------
    InputError
        If no calibration reaches the target; the message says what is reachable.
    """
    found = answer(PlanCase(**case).question, int(provenance["seed"]), replicates)
    if not found.ranked:
        raise InputError(f"plan.cases.{name}: {unreachable(found)}")
    plan_files(found, Path(folder), provenance, Path(folder), f"plan-{name}")


def compare_sensors(
    sensors: Sequence[str], outputs: Mapping[str, str], provenance: Mapping[str, Any]
) -> None:
    """Compare sensors; `outputs` has the paths of `table`, `svg` and `png`."""
    table = front_table(sensors)
    write_table(outputs["table"], table, provenance)
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        figure = front_figure(table)
    save(figure, outputs["svg"], outputs["png"], "Sensors", DPI)
