"""The page of a score in Markdown, its figures, and the judged campaigns."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
import pandas as pd

from accelstudy.drawing.saving import save_all
from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import origin, read_table, write_table
from studies.hidden.baselines import METHODS
from studies.hidden.real_noise import RealNoiseConfig
from studies.hidden.scoring.figures import figures
from studies.hidden.scoring.judging import P_CLASSES, all_true, judge, same_effects
from studies.hidden.scoring.tables import HERE, SCORES, SETS, table
from studies.hidden.study import HiddenConfig

Frames = Mapping[str, pd.DataFrame]


def write_score(
    config: HiddenConfig | RealNoiseConfig,
    inputs: Sequence[str],
    outputs: Mapping[str, str],
    provenance: Mapping[str, Any],
) -> str:
    """Score a study; returns the page.

    Parameters
    ----------
    config : HiddenConfig or RealNoiseConfig
    inputs : paths of the tables of all jobs
    outputs : paths of the judged campaigns, of the page, and of the folder `figures`
    provenance : see `accelstudy.files.tables.origin`
    """
    judged = frames(read_table([*inputs]), config)
    made = {"origin": origin(provenance), "fingerprint": config.fingerprint}
    page = score_page(config.score, judged, made)
    write_table(outputs["campaigns"], judged["campaigns"], provenance)
    folder = Path(outputs["figures"])
    folder.mkdir(parents=True, exist_ok=True)
    save_all(figures(config.score, judged), folder)
    with whole_file(outputs["page"]) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return page


def frames(campaigns: pd.DataFrame, config: HiddenConfig | RealNoiseConfig) -> Frames:
    """What a score asks: the judged campaigns, and the simpler methods on some of them."""
    logs = config.logs if isinstance(config, RealNoiseConfig) else {}
    judged = judge(campaigns, {name: log.own for name, log in logs.items()})
    methods = method_rows(judged)
    judged["truth"] = judged["design"].map({name: log.note for name, log in logs.items()})
    order = {"set": pd.CategoricalDtype([*SETS]), "p_class": pd.CategoricalDtype([*P_CLASSES])}
    return {"campaigns": judged.astype(order), "methods": methods}


def method_rows(judged: pd.DataFrame) -> pd.DataFrame:
    """The simpler methods, the diagnosis and the oracle on the same campaigns, a row of each."""
    rows = []
    for row in judged[judged["methods"] != "null"].to_dict("records"):
        told = json.loads(row["methods"])
        told["diagnosis"] = row["alarm"], json.loads(row["found"]) if row["answered"] else []
        if not pd.isna(row["oracle_detected"]):
            told["oracle"] = row["oracle_detected"], json.loads(row["oracle_best"])
        true = json.loads(row["classes"])
        for method, (detected, found) in told.items():
            names = [[one] if isinstance(one, str) else one for one in found]
            rows.append(
                {"method": method, "set": row["set"], "size": row["size"], "found": bool(detected),
                 "right": same_effects(names, true), "first_right": all_true(names[:1], true),
                 "wrong": bool(names) and not all_true(names, true)}
            )  # fmt: skip
    order = pd.CategoricalDtype(["diagnosis", "oracle", *METHODS])
    return pd.DataFrame(rows).astype({"method": order}) if rows else pd.DataFrame()


def score_page(name: str, judged: Frames, made: Mapping[str, Any]) -> str:
    """Write a score as tables in Markdown.

    Parameters
    ----------
    name : of `SCORES`
    judged : of `frames`
    made : fingerprint of the configuration, and origin, see `accelstudy.files.tables.origin`
    """
    score = SCORES[name]
    tables = ((title, part, table(part, judged)) for title, part in score["page"].items())
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    return environment.get_template("score.md.j2").render(
        made,
        score=score,
        n=len(judged["campaigns"]),
        sections=[(title, part.get("says"), markdown(rows)) for title, part, rows in tables
                  if len(rows)],
    )  # fmt: skip


def markdown(rows: pd.DataFrame) -> str:
    """Write a table in Markdown."""
    lines = [[*rows.columns], ["---"] * rows.shape[1], *rows.itertuples(index=False)]
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in lines)
