"""The job that scores a study: tables, page and figures, from what the chunks wrote."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from accelstudy.drawing.saving import save_all
from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import origin, read_table, write_table
from accelstudy.hidden.page.figures import figures
from accelstudy.hidden.page.markdown import score_page
from accelstudy.hidden.score.limits import study_limits
from accelstudy.hidden.score.scoring import score_tables
from accelstudy.hidden.study.config import HiddenConfig
from accelstudy.hidden.study.tables import TABLES

PARTS = ("truths", "outcomes", "baselines", "seconds")
"""Tables that the chunks write."""


def write_score(
    config: HiddenConfig,
    inputs: Mapping[str, Sequence[str]],
    outputs: Mapping[str, str],
    provenance: Mapping[str, Any],
) -> str:
    """Score a study; returns the page.

    Parameters
    ----------
    config : HiddenConfig
    inputs : paths of all chunks of each of `PARTS`
    outputs : paths of each of `accelstudy.hidden.study.tables.TABLES`, of the page, and of the
        folder of the figures
    provenance : see `accelstudy.files.tables.origin`
    """
    parts = {name: read_table([*inputs[name]]) for name in PARTS}
    tables = score_tables(
        parts["truths"], parts["outcomes"], parts["baselines"], study_limits(config)
    )
    for name in TABLES:
        write_table(outputs[name], tables[name], provenance)
    folder = Path(outputs["figures"])
    folder.mkdir(parents=True, exist_ok=True)
    save_all(figures(tables), folder)
    page = score_page(tables, parts["seconds"], origin(provenance))
    with whole_file(outputs["page"]) as path:
        path.write_text(page, encoding="utf-8")
    return page
