"""The tables of the study, and the columns of those that its jobs write."""

from __future__ import annotations

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
        **dict.fromkeys(("left", "sensor", "seed", "failed"), _TEXT),
    },
    "outcomes": {
        **_KEYS,
        **dict.fromkeys(("verdict", "found", "specs", "found_classes", "positions"), _TEXT),
        **dict.fromkeys(("posteriors", "credible_set"), _TEXT),
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
