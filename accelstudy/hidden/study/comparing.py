"""One job of the comparison: simpler methods judge campaigns of the study."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from accelstudy.campaign.session import Campaign
from accelstudy.effects import effects_without
from accelstudy.files.tables import write_table
from accelstudy.hidden.study.baselines import METHODS, answers
from accelstudy.hidden.study.cells import Cell
from accelstudy.hidden.study.config import HiddenConfig
from accelstudy.hidden.study.making import Row, made, rows_table, tried
from accelstudy.sensors.models import get_model


def run_baselines(
    config: HiddenConfig,
    campaigns: Iterable[tuple[Cell, int]],
    output: str | Path,
    provenance: Mapping[str, Any],
) -> None:
    """Let the simpler methods judge some of the campaigns.

    Parameters are those of `accelstudy.hidden.study.diagnosing.run_chunk`. Where the
    model cannot be fitted, no method can work: each finds nothing, and the row has the error.
    """
    model, rows = get_model(config.model), []

    def answer(campaign: Campaign) -> list[Row]:
        return [
            {"method": method, "detected": detected, "found": json.dumps(names), "error": ""}
            for method, (detected, names) in answers(campaign, model)
        ]

    for cell, k in campaigns:
        if cell.one_in(config.baselines_every, k):
            campaign, truth = made(cell, k, config.seed)
            with effects_without(cell.removed):
                answered, error = tried(answer, campaign, f"{cell.name} {k}")
            nothing = {"detected": False, "found": "[]", "error": error or truth["failed"]}
            answered = answered or [{"method": method, **nothing} for method in METHODS]
            rows += [{"cell": cell.name, "campaign": k, **row} for row in answered]
    write_table(output, rows_table("baselines", rows), provenance)
