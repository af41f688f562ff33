"""A plan as files: table, page, figure, and the study that reproduces its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from accelstudy.basics.plugins import as_a_key
from accelstudy.basics.suggested import study_again
from accelstudy.basics.units import MGON
from accelstudy.leveling.distribution import NOISE
from accelstudy.planning.answer import Answer
from accelstudy.planning.candidates import Candidate
from accelstudy.planning.reasons import limits
from accelstudy.planning.wording import part_lines, positions_command, table_lines
from accelstudy.proposal.design import write_design
from accelstudy.proposal.order import field_order

STUDY_HEAD = """\
# The simulated candidates of a plan as a study, made by `accelstudy plan`. It reproduces their
# numbers: {command}
"""
ANGLES = ("roll", "pitch")


def plan_files(
    answer: Answer,
    folder: Path,
    provenance: Mapping[str, Any],
    shown: Path,
    study: str = "plan",
) -> None:
    """Write the files of a plan into an existing folder.

    Parameters
    ----------
    answer : Answer, that reaches its target
    folder : Path
    provenance : see `accelstudy.files.tables.origin`
    shown : Path, name of the folder in the files
    study : str, name of the study that reproduces the numbers
    """
    # Slow to import, and not needed for what is printed.
    import matplotlib as mpl

    from accelstudy.drawing.saving import save
    from accelstudy.drawing.style import DPI, STYLE
    from accelstudy.files.tables import write_table
    from accelstudy.planning.figure import plan_figure

    write_table(folder / "plan.parquet", plan_table(answer), provenance)
    head = STUDY_HEAD.format(command=study_again(shown / "study.yaml"))
    content = yaml.safe_dump(
        {**as_a_key(), **answer.study, "study": study}, sort_keys=False, allow_unicode=True
    )
    (folder / "study.yaml").write_text(head + content, encoding="utf-8")
    (folder / "plan.md").write_text(plan_page(answer), encoding="utf-8")
    write_positions(answer, folder / "positions.yaml", study)
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        figure = plan_figure(answer)
    save(figure, folder / "plan.svg", folder / "plan.png", "Plan", DPI)


def write_positions(answer: Answer, path: Path, name: str) -> None:
    """Write the recommended positions as a scheme, in the order in which to take them."""
    question, first = answer.question, answer.first
    directions, command = first.scheme.directions, positions_command(question, first)
    if first.request is not None:
        order = field_order(first.request.task, directions)
        directions = directions[order]
    write_design(path, name, f"of {name}", command, directions, {"made_by": "accelstudy plan"})


def plan_page(answer: Answer) -> str:
    """The plan as a page in Markdown."""
    first, *rest = part_lines("answer", answer)
    parts = [
        f"# {first}",
        "\n".join(rest),
        "\n".join(part_lines("how_to", answer)),
        "```\n" + "\n".join(table_lines(answer)) + "\n```",
        "![Tilt accuracy over effort](plan.svg)",
        "```\n" + "\n".join(part_lines("reasons", answer)) + "\n```",
        "\n".join(f"* {line}" for line in part_lines("assumptions", answer)),
    ]
    return "\n\n".join(parts) + "\n"


def plan_table(answer: Answer) -> pd.DataFrame:
    """All candidates that were compared, and the rank of those in the table of the plan.

    Angles are in mgon, whatever unit the user chose.
    """
    return pd.DataFrame([_row(answer, c) for c in answer.compared]).astype({"rank": "Int64"})


def _row(answer: Answer, c: Candidate) -> dict[str, Any]:
    rank = answer.ranked.index(c) + 1 if c in answer.ranked else None
    expected = {"rms": c.tilt.rms, "noise": np.sqrt(c.tilt.squares[NOISE])}
    found, of_both = dict.fromkeys(("rms", "rms_error", "rms_q95"), np.full(2, np.nan)), np.nan
    if c.simulated is not None:
        values = c.simulated.rms, c.simulated.error, c.simulated.quantile(0.95)
        found, of_both = dict(zip(found, values, strict=True)), c.simulated.of_both(0.95)
    return {
        "equipment": c.equipment.name,
        "model": c.model.name,
        "n_parameters": c.model.n_parameters,
        "scheme": c.scheme.name,
        "n_positions": c.scheme.n_positions,
        "hold_s": c.hold,
        "sensor_sigma_mps2": c.sigma,
        "minutes": c.seconds / 60,
        "redundancy": c.redundancy,
        **{
            f"{angle}_{what}_mgon": float(values[i]) / MGON
            for i, angle in enumerate(ANGLES)
            for what, values in expected.items()
        },
        "reaches": answer.question.reached_by(c.tilt),
        "rank": rank,
        "limited_by": limits(answer.question, c) if rank else None,
        "cell": None if c.simulated is None else c.simulated.cell,
        **{
            f"{angle}_{what}_simulated_mgon": float(values[i]) / MGON
            for what, values in found.items()
            for i, angle in enumerate(ANGLES)
        },
        "both_rms_q95_simulated_mgon": of_both / MGON,
    }
