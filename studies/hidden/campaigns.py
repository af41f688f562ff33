"""The campaigns of the study, made with the row of their truth, and the tables of the study."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from typing import Any

import pandas as pd

from accelstudy.basics.errors import InputError
from accelstudy.campaign.session import Campaign
from studies.hidden.cells import Cell
from studies.hidden.physics import Truth, generate

Row = dict[str, Any]

KEY = ["cell", "campaign"]
"""Columns by which truths and answers belong together."""

TABLES = ("campaigns", "targets", "shares", "confusion", "calibration", "baselines", "limits")
"""Tables of a score."""

_TEXT, _NUMBER, _FLAG = "string", "float64", "boolean"
_KEYS = {"cell": _TEXT, "campaign": "int64"}

SCHEMA: dict[str, dict[str, str]] = {
    "truths": {
        **_KEYS,
        **dict.fromkeys(("set", "what"), _TEXT),
        "size": _NUMBER,
        **dict.fromkeys(("design", "approach", "sigma", "classes", "effects", "noise"), _TEXT),
        **dict.fromkeys(("gross", "gross_name"), _TEXT),
        "oracle_detected": _FLAG,
        **dict.fromkeys(("oracle_best", "oracle_told"), _TEXT),
        "oracle_alternatives": "Int64",
        **dict.fromkeys(("left", "true_place", "sensor", "seed", "failed"), _TEXT),
    },
    "outcomes": {
        **_KEYS,
        **dict.fromkeys(("verdict", "found", "specs", "found_classes", "positions"), _TEXT),
        **dict.fromkeys(("posteriors", "credible_set", "place", "fits"), _TEXT),
        "confirmed": _FLAG,
        "statement": _TEXT,
        **dict.fromkeys(("held_out_z", "sigma0_before", "sigma0_after", "p_size"), _NUMBER),
        **dict.fromkeys(("redundancy", "positions_used"), "Int64"),
        **dict.fromkeys(("reason", "error"), _TEXT),
    },
    "seconds": {**_KEYS, "seconds": _NUMBER},
    "baselines": {**_KEYS, "method": _TEXT, "detected": _FLAG, "found": _TEXT, "error": _TEXT},
}
"""Columns of the tables of a chunk, and their types; lists and mappings are JSON."""


def rows_table(name: str, rows: list[Row]) -> pd.DataFrame:
    """Table of the study, with its columns and their types, of rows."""
    return pd.DataFrame(rows, columns=[*SCHEMA[name]]).astype(SCHEMA[name])


def made(cell: Cell, k: int, seed: int) -> tuple[Campaign | None, Row]:
    """Make a campaign and the row of its truth; None if it could not be made."""
    campaign_and_truth, error = tried(
        lambda seed_of_campaign: generate(cell.case, seed_of_campaign),
        cell.seed(seed, k),
        f"{cell.name} {k}: not made",
    )
    campaign, truth = campaign_and_truth or (None, None)
    return campaign, _truth(cell, truth, error)


def tried(work: Callable[[Any], Any], given: Any, what: str) -> tuple[Any, str]:
    """Return the result of a work and no error, or None and the error; None is not worked on."""
    if given is None:
        return None, ""
    try:
        return work(given), ""
    except InputError as error:
        logging.info("%s: %s", what, error)
        return None, f"refused: {error}"
    except OSError:  # such as a full disk, which is no fault of this campaign
        raise
    except Exception as error:
        logging.exception("%s", what)
        return None, f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"


def _truth(cell: Cell, truth: Truth | None, error: str) -> Row:
    """Row of the table of truths; of a campaign that could not be made what was wanted."""
    case = cell.case
    content = {} if truth is None else truth.to_dict()
    oracle = content.get("oracle") or {}
    gross = content.get("gross") or {}
    # No name is right for what a session cannot show or the catalogue lacks.
    classes = (
        [] if case.set in ("invisible", "outside", "unforeseen") else content.get("classes", [])
    )
    left = [[name for name in one if name not in cell.removed] for one in classes]
    return {
        "set": case.set,
        "what": cell.what,
        "size": cell.size,
        "design": case.design,
        "approach": case.approach,
        "sigma": "given" if case.sigma_known else "not given",
        "classes": json.dumps([one for one in left if one]),
        "effects": json.dumps(content.get("effects", [])),
        "noise": json.dumps(content.get("noise")),
        "gross": json.dumps(gross),
        "gross_name": gross.get("name", ""),
        "oracle_detected": oracle.get("detected"),
        "oracle_best": json.dumps(oracle.get("best", [])),
        "oracle_told": json.dumps(oracle.get("told", [])),
        "oracle_alternatives": oracle.get("alternatives"),
        "left": json.dumps(content.get("left", [])),
        "true_place": json.dumps(content.get("place")),
        "sensor": json.dumps(content.get("sensor")),
        "seed": json.dumps(content.get("seed")),
        "failed": error,
    }
