"""The page of a score in Markdown, its figures, and the judged campaigns."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from accelstudy.drawing.saving import save_all
from accelstudy.files.outputs import write_text
from accelstudy.files.tables import origin, write_table
from studies.hidden.baselines import METHODS
from studies.hidden.campaigns import Config, read_rows
from studies.hidden.scoring.figures import Frames, figures
from studies.hidden.scoring.judging import P_CLASSES, all_true, judge, same_effects
from studies.hidden.scoring.tables import SCORES, SETS, table
from studies.hidden.study import Row


def write_score(
    config: Config, inputs: Sequence[str], outputs: Mapping[str, str], made: Mapping[str, Any]
) -> str:
    """Score a study; returns the page.

    Parameters
    ----------
    config : HiddenConfig or RealNoiseConfig
    inputs : paths of the rows of all jobs
    outputs : paths of the judged campaigns, of the page, and of the folder `figures`
    made : provenance, see `accelstudy.files.tables.origin`
    """
    judged = frames(read_rows(inputs), config)
    page = score_page(config, judged, origin(made))
    flat = judged["campaigns"].map(lambda v: json.dumps(v) if isinstance(v, list | dict) else v)
    write_table(outputs["campaigns"], flat, made)
    folder = Path(outputs["figures"])
    folder.mkdir(parents=True, exist_ok=True)
    save_all(figures(config.score, judged), folder)
    write_text(outputs["page"], page)
    return page


def frames(rows: Sequence[Row], config: Config) -> Frames:
    """What a score asks: the judged campaigns, and the simpler methods on some of them."""
    judged = judge(rows, {name: log.own for name, log in config.logs.items()})
    judged["truth"] = judged["design"].map({name: log.note for name, log in config.logs.items()})
    order = {"set": pd.CategoricalDtype([*SETS]), "p_class": pd.CategoricalDtype([*P_CLASSES])}
    return {"campaigns": judged.astype(order), "methods": method_rows(judged)}


def method_rows(judged: pd.DataFrame) -> pd.DataFrame:
    """The simpler methods, the diagnosis and the oracle on the same campaigns, a row of each."""
    rows = []
    for row in judged.dropna(subset="methods").to_dict("records"):
        named = row["found"] if row["answered"] else []
        answers = row["methods"] | {"diagnosis": (row["alarm"], named)}
        if row["oracle"]:
            answers["oracle"] = row["oracle"]["detected"], row["oracle"]["best"]
        true = row["classes"]
        for method, (detected, found) in answers.items():
            names = [[one] if isinstance(one, str) else one for one in found]
            rows.append(
                {"method": method, "set": row["set"], "size": row["size"], "found": bool(detected),
                 "right": same_effects(names, true), "first_right": all_true(names[:1], true),
                 "wrong": bool(names) and not all_true(names, true)}
            )  # fmt: skip
    order = pd.CategoricalDtype(["diagnosis", "oracle", *METHODS])
    return pd.DataFrame(rows).astype({"method": order}) if rows else pd.DataFrame()


def score_page(config: Config, judged: Frames, made: Mapping[str, Any]) -> str:
    """Write a score as tables in Markdown.

    Parameters
    ----------
    config : HiddenConfig or RealNoiseConfig
    judged : of `frames`
    made : see `accelstudy.files.tables.origin`
    """
    score = SCORES[config.score]
    parts = [
        f"# {score['title']}",
        f"Written by `{score['command']}`, not by hand; hidden-effects.md explains it.",
        f"{len(judged['campaigns'])} campaigns, configuration `{config.fingerprint}`, "
        f"seed {made['seed']}, accelstudy {made['version']}, commit `{made['commit'][:10]}`.",
    ]
    for title, section in score["page"].items():
        rows = table(section, judged)
        if len(rows):
            parts += [f"## {title}", *filter(None, [section.get("says")]), markdown(rows)]
    return "\n\n".join(parts) + "\n"


def markdown(rows: pd.DataFrame) -> str:
    """Write a table in Markdown."""
    lines = [[*rows.columns], ["---"] * rows.shape[1], *rows.itertuples(index=False)]
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in lines)
