"""The smallest size of each effect that a design should show, and what the study finds of it."""

from __future__ import annotations

import numpy as np
import pandas as pd

from accelstudy.adjustment.quality import noncentrality
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.visibility import POWER, examine_campaign, visibilities
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import SensorModel
from studies.hidden.cells import Cell
from studies.hidden.config import HiddenConfig
from studies.hidden.physics.generate import Case, generate
from studies.hidden.scoring.tables import with_intervals

ALPHA = 0.001
"""Level of the tests for which the minimal detectable and identifiable sizes are computed."""
EDGES = (0.4, 0.6, 0.75, 0.9, 1.1, 1.35, 1.7, 2.2, 3.0, 4.5, 7.0)
"""Bounds of the classes of sizes relative to a limit."""


def study_limits(config: HiddenConfig) -> pd.DataFrame:
    """Limits of all effects in each design and approach, from a campaign without any effect."""
    model, rows = get_model(config.model), []
    for design, approach in dict.fromkeys(place[:2] for place in config.places):
        cell = Cell(Case("null", design, approach, sigma_known=True))
        campaign, _ = generate(cell.case, cell.seed(config.seed, 0))
        place = {"design": design, "approach": approach}
        rows += [{**place, **row} for row in limit_rows(campaign, model)]
    return pd.DataFrame(rows)


def limit_rows(campaign: Campaign, model: SensorModel) -> list[dict[str, object]]:
    """Minimal detectable and identifiable sizes of all effects that a campaign can show.

    Both are also given as noncentralities λ, which do not depend on parameters and units. λ of the
    MDB is that of a test of one parameter. λ of the MIB is larger by (MIB/MDB)², since the nearest
    rival has to be excluded as well.
    """
    least = noncentrality(1, ALPHA, POWER)
    return [
        {
            "what": row.name,
            "mdb": row.mdb,
            "mib": row.mib,
            "unit": row.unit,
            "nearest": row.confused[0][0] if row.confused else "",
            "lambda_mdb": least,
            "lambda_mib": least * (row.mib / row.mdb) ** 2,
        }
        for row in visibilities(examine_campaign(campaign, model), ALPHA)
        if row.status == "visible" and np.isfinite(row.mdb)
    ]


def with_limits(judged: pd.DataFrame, limits: pd.DataFrame) -> pd.DataFrame:
    """Campaigns with one effect for which there are limits.

    Parameters
    ----------
    judged : DataFrame, of `studies.hidden.scoring.judging.judge`
    limits : DataFrame, of `study_limits`

    Returns
    -------
    DataFrame
        With by_mdb and by_mib, their sizes as multiples of the MDB and of the MIB.
    """
    one = judged[judged["set"] == "one"]
    table = one.merge(limits, on=["what", "design", "approach"], how="inner")
    return table.assign(
        by_mdb=np.sqrt(table["size"] / table["lambda_mdb"]),
        by_mib=np.sqrt(table["size"] / table["lambda_mib"]),
    )


def limit_table(judged: pd.DataFrame, limits: pd.DataFrame) -> pd.DataFrame:
    """Limits of each effect in each design, beside the power that the study finds there.

    Parameters as in `with_limits`.

    Returns
    -------
    DataFrame
        A row per effect, design, approach and noise: the columns of `limit_rows`, and
        above_mdb, detected, above_mib, right: campaigns from the limit on, and the share of them
        in which something is found, or the name is right; both should be 0.8 at least.
    """
    table = with_limits(judged, limits)
    of_limits = ["mdb", "mib", "unit", "nearest", "lambda_mdb", "lambda_mib"]
    groups = table.groupby(["what", "design", "approach", "sigma"])
    made = groups[of_limits].first()
    for limit, answer, name in (("mdb", "alarm", "detected"), ("mib", "right", "right")):
        above = table[f"by_{limit}"] >= 1
        yes = table[answer].astype(float).where(above)
        groups = pd.DataFrame({"above": above, "yes": yes}).groupby(
            [table[key] for key in made.index.names]
        )
        made[f"above_{limit}"], made[name] = groups["above"].sum(), groups["yes"].mean()
    return made.reset_index()


def power_over(
    judged: pd.DataFrame, limits: pd.DataFrame, column: str, answer: str
) -> pd.DataFrame:
    """Share of campaigns with an answer, over their size beside a limit.

    Parameters
    ----------
    judged : DataFrame, of `studies.hidden.scoring.judging.judge`
    limits : DataFrame, of `limit_table`
    column : str, "by_mdb" or "by_mib"
    answer : str, a column of `judged`

    Returns
    -------
    DataFrame
        beside (geometric mean), count, n, share, ci95_low, ci95_high
    """
    of_places = limits[["what", "design", "approach", "lambda_mdb", "lambda_mib"]].drop_duplicates()
    table = with_limits(judged, of_places)
    place = pd.cut(table[column], EDGES, labels=False)
    groups = table.assign(yes=table[answer].astype(bool), log=np.log(table[column])).groupby(place)
    made = groups.agg(log=("log", "mean"), count=("yes", "sum"), n=("yes", "size"))
    return with_intervals(made.assign(beside=np.exp(made["log"])).reset_index(drop=True))
