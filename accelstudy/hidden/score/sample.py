"""A few campaigns of a study, to be diagnosed again: they tell whether its score still holds."""

from __future__ import annotations

import hashlib
import json

import pandas as pd

from accelstudy.hidden.physics import Case
from accelstudy.hidden.study.cells import Cell
from accelstudy.hidden.study.tables import KEY

BY_KIND = ("noise", "one", "gross", "outside")
"""Sets of which each kind has its campaign; of the others each size has one."""


def sample(campaigns: pd.DataFrame) -> pd.DataFrame:
    """Choose a campaign of each kind or size, as good as at random, whatever others there are.

    Parameters
    ----------
    campaigns : DataFrame, truths and outcomes side by side

    Returns
    -------
    DataFrame
        cell, campaign; verdict, whether it is confirmed, the most probable explanation with its
        posterior, and the variance of unit weight before
    """
    kind = campaigns["what"].where(campaigns["set"].isin(BY_KIND), campaigns["size"])
    keys = campaigns["cell"] + " " + campaigns["campaign"].astype(str)
    digest = keys.map(lambda key: hashlib.sha256(key.encode()).hexdigest())
    chosen = (
        campaigns.assign(kind=kind, digest=digest)
        .sort_values("digest")
        .drop_duplicates(["set", "kind"])
        .sort_values("cell", kind="stable")
    )
    first = [(json.loads(one) if one else []) for one in chosen["credible_set"].fillna("")]
    return chosen[[*KEY, "verdict", "confirmed"]].assign(
        explanation=["+".join(one[0]["names"]) if one else "" for one in first],
        posterior=[one[0]["posterior"] if one else float("nan") for one in first],
        sigma0_before=chosen["sigma0_before"],
    )


def cell_of(name: str) -> Cell:
    """Return the cell of a name, with one campaign; the reverse of `Cell.name`."""
    set_, *hidden, design, approach, sigma = name.split("/")
    what, size = [*hidden, "", ""][:2]
    kinds = {set_: what} if set_ in ("noise", "gross") else {}
    effects = () if kinds or not what else tuple(what.split("+"))
    lam = (float(size),) * len(effects) if size else ()
    return Cell(Case(set_, design, approach, sigma == "sigma given", effects, lam, **kinds), 1)
