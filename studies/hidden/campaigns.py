"""The campaigns of both studies, made with the rows of their truths; the tables of the jobs."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from typing import Any, NamedTuple, TypeVar

import pandas as pd

from accelstudy.basics.errors import InputError
from accelstudy.campaign.session import Campaign
from studies.hidden.cells import Cell
from studies.hidden.physics.generate import Truth, generate

Row = dict[str, Any]

KEY = ["cell", "campaign"]
"""Columns by which truths and answers belong together."""
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


class Made(NamedTuple):
    """A campaign and its truth, with further columns of its row and of that of its diagnosis."""

    campaign: Campaign
    truth: Truth
    columns: Row = {}  # noqa: RUF012, nobody changes it
    of_answer: Callable[[Any], Row] = lambda verdict: {}


C = TypeVar("C", bound=Cell)
Make = Callable[[C, int], Made]
"""Makes a campaign of a cell by its number."""


def rows_table(rows: Iterable[Row], schema: Mapping[str, str]) -> pd.DataFrame:
    """Table of rows, with columns of given types."""
    return pd.DataFrame(rows, columns=[*schema]).astype(dict(schema))


def simulated(seed: int) -> Make[Cell]:
    """Make campaigns by the physics of the study."""
    return lambda cell, k: Made(*generate(cell.case, cell.seed(seed, k)))


def made_of(cell: C, k: int, make: Make[C]) -> tuple[Made | None, Row]:
    """Make a campaign, and the row of its truth; None if it could not be made."""
    made: Made | None
    made, error = tried(lambda number: make(cell, number), k, f"{cell.name} {k}: not made")
    truth = made.truth if made else Truth()
    oracle = truth.oracle
    # No name is right for what a session cannot show or the catalogue lacks.
    nameless = cell.case.set in ("invisible", "outside", "unforeseen")
    known = [[name for name in one if name not in cell.removed] for one in truth.classes]
    row = {
        "set": cell.case.set,
        "what": cell.what,
        "size": cell.size,
        "design": cell.case.design,
        "approach": cell.case.approach,
        "sigma": cell.sigma,
        "classes": json.dumps([] if nameless else [one for one in known if one]),
        "effects": json.dumps([asdict(one) for one in truth.effects]),
        "noise": json.dumps(truth.noise),
        "gross": json.dumps(truth.gross if made else {}),
        "gross_name": truth.gross["name"],
        "oracle_detected": None if oracle is None else oracle.detected,
        "oracle_best": json.dumps([] if oracle is None else oracle.best),
        "oracle_told": json.dumps([] if oracle is None else oracle.told),
        "oracle_alternatives": None if oracle is None else oracle.alternatives,
        "left": json.dumps(truth.left),
        "true_place": json.dumps(truth.place),
        "sensor": json.dumps(truth.sensor),
        "seed": json.dumps(truth.seed if made else None),
        "failed": error,
    }
    return made, row | (made.columns if made else {})


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


def joined(truths: pd.DataFrame, outcomes: pd.DataFrame) -> pd.DataFrame:
    """Truths and outcomes side by side, one row for each campaign.

    Raises
    ------
    InputError
        If a campaign has a truth and no outcome, or the other way round.
    """
    table = truths.merge(outcomes, on=KEY, how="outer", validate="1:1", indicator=True)
    alone = table[table["_merge"] != "both"]
    if len(alone):
        first = alone.iloc[0]
        lacks = "outcome" if first["_merge"] == "left_only" else "truth"
        raise InputError(
            f"{first['cell']}, campaign {first['campaign']}: has no {lacks}; {len(alone)} in all; "
            "run the study again"
        )
    return table.drop(columns="_merge")
