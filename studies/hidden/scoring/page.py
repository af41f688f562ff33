"""The pages of both scores, in Markdown: their tables, as text, for the templates."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import pandas as pd

from accelstudy.basics.wording import number, words
from accelstudy.drawing.saving import save_all
from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import origin, read_table, write_table
from studies.hidden.campaigns import KEY, joined
from studies.hidden.config import HiddenConfig
from studies.hidden.physics.generate import place_of
from studies.hidden.scoring.figures import figures
from studies.hidden.scoring.judging import LARGE, judge
from studies.hidden.scoring.limits import limit_table, study_limits
from studies.hidden.scoring.tables import baseline_table, calibration, confusion, shares, targets

PARTS = ("truths", "outcomes", "baselines", "seconds")
"""Tables that the chunks write."""
TABLES = ("campaigns", "targets", "confusion", "calibration", "baselines", "limits")
"""Tables of a score."""
Tables = Mapping[str, pd.DataFrame]


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
    outputs : paths of each of `TABLES`, of the page, and of the folder of the figures
    provenance : see `accelstudy.files.tables.origin`
    """
    truths, outcomes, answers, seconds = (read_table([*inputs[name]]) for name in PARTS)
    tables = score_tables(joined(truths, outcomes), answers, study_limits(config))
    for name in TABLES:
        write_table(outputs[name], tables[name], provenance)
    folder = Path(outputs["figures"])
    folder.mkdir(parents=True, exist_ok=True)
    save_all(figures(tables), folder)
    return written(outputs["page"], score_page(tables, seconds, origin(provenance)))


def score_tables(campaigns: pd.DataFrame, answers: pd.DataFrame, limits: pd.DataFrame) -> Tables:
    """All tables of a score.

    Parameters
    ----------
    campaigns : DataFrame, truths and outcomes side by side
    answers : DataFrame, of the simpler methods
    limits : DataFrame, of `studies.hidden.scoring.limits.study_limits`
    """
    judged = judge(campaigns)
    tables = targets(judged), confusion(judged), calibration(judged)
    more = baseline_table(judged, answers), limit_table(judged, limits)
    return dict(zip(TABLES, (judged, *tables, *more), strict=True))


def written(path: str, page: str) -> str:
    """Write a page; returns it."""
    with whole_file(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return page


# --- text -----------------------------------------------------------------------------------------


def share_text(value: float) -> str:
    """Write a share to two digits, or three decimals."""
    return "–" if np.isnan(value) else f"{value:.3f}" if value < 0.0995 else f"{value:.2f}"


def interval_text(low: float, high: float) -> str:
    """Write an interval of a share."""
    return "–" if np.isnan(low) else f"{share_text(low)} … {share_text(high)}"


def markdown(table: pd.DataFrame) -> str:
    """Write a table in Markdown."""
    rows = [[*table.columns], ["---"] * table.shape[1], *table.itertuples(index=False)]
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in rows)


def render(template: str, **content: Any) -> str:
    """Render a page from a template beside this file."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("studies.hidden.scoring", ""),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    environment.filters.update(table=markdown, number=number)
    return environment.get_template(template).render(content)


def divided(judged: pd.DataFrame, by: str, questions: Mapping[str, str]) -> pd.DataFrame:
    """Shares of the answers to questions by a column, which is the index, as text."""
    columns = {
        head: shares(judged, question, by).set_index(by)["share"]
        for head, question in questions.items()
    }
    return pd.DataFrame(columns).astype(float).map(share_text)


# --- the study of hidden effects ------------------------------------------------------------------

SETS = {
    "null": "nothing missing",
    "noise": "wrong noise only",
    "one": "one effect",
    "two": "two effects",
    "removed": "family taken out",
    "outside": "never in the catalogue",
    "unforeseen": "unforeseen",
    "gross": "gross errors",
    "invisible": "cannot be seen",
}
OVER_SIZE = {
    "found": "alarm",
    "oracle": "oracle_found",
    **{name: name for name in ("named", "narrowed", "unknown")},
    "name right": "right",
    "oracle right": "oracle_right",
    "wrong": "wrong",
    "explanation right": "explanation_right",
    "set holds the truth": "set_holds",
}
VERDICTS = (
    "alarm", "named", "narrowed", "learned", "unknown", "noise_model", "gross_error", "confirmed",
)  # fmt: skip


def score_page(tables: Tables, seconds: pd.DataFrame, origin: Mapping[str, Any]) -> str:
    """Write the score as tables in Markdown.

    Parameters
    ----------
    tables : of `score_tables`
    seconds : DataFrame, processor time of each diagnosis
    origin : see `accelstudy.files.tables.origin`
    """
    campaigns, wanted = tables["campaigns"], tables["targets"]["wanted"] != ""
    one = campaigns[campaigns["set"] == "one"]
    sizes = divided(one, "size", OVER_SIZE).rename_axis("λ").rename("{:g}".format).reset_index()
    verdicts = divided(campaigns, "set", {words(name): name for name in VERDICTS})
    verdicts = verdicts.reindex([name for name in SETS if name in verdicts.index]).rename(SETS)
    failed = campaigns.loc[~campaigns["ok"].astype(bool), "error"].value_counts()
    return render(
        "score.md.j2",
        n=len(campaigns),
        origin=origin,
        large=f"{LARGE:g}",
        seconds=[float(seconds["seconds"].quantile(part)) for part in (0.5, 0.95)],
        targets=figure_table(tables["targets"][wanted]),
        beside=figure_table(tables["targets"][~wanted]).drop(columns=["target", "met"]),
        sizes=sizes,
        verdicts=verdicts.rename_axis("campaigns").reset_index(),
        kinds=kind_table(campaigns),
        methods=method_table(tables["baselines"]),
        shrinking=shrink_table(campaigns),
        effects=effect_table(one, tables["limits"]),
        sample=sample_table(campaigns),
        failed=failed.rename_axis("error").reset_index(name="campaigns"),
    )


def figure_table(table: pd.DataFrame) -> pd.DataFrame:
    """What was measured, with its interval, what is wanted, and whether it is met."""
    ends = zip(table["ci95_low"], table["ci95_high"], table["n"], strict=True)
    return pd.DataFrame(
        {
            "figure": table["figure"],
            "campaigns": table["cases"],
            "target": table["wanted"],
            "measured": table["measured"].map(share_text),
            "95 % interval": [interval_text(low, high) if n else "" for low, high, n in ends],
            "n": table["n"],
            "met": table["met"],
        }
    )


def kind_table(campaigns: pd.DataFrame) -> pd.DataFrame:
    """What becomes of each kind of physics that the catalogue lacks."""
    large = campaigns[campaigns["large"].astype(bool)]
    rows = []
    for name in ("outside", "unforeseen"):
        for what, part in large[large["set"] == name].groupby("what"):
            right = part[part["place_right"].eq(True)]
            place = place_of(str(what))
            rows.append({
                "campaigns": SETS[name],
                "kind": words(str(what)),
                "place": ", ".join(place) if place else "–",
                "n": len(part),
                "wrong name": _share(part["wrong"]),
                "learned": _share(part["learned"]),
                "place right": _share(part["place_right"]),
                "place wrong": _share(part["place_wrong"]),
                "confirmed": _share(right["confirmed"]),
                "explained": share_text(right["explained"].median()),
            })  # fmt: skip
    heads = ["campaigns", "kind", "place", "n", "wrong name", "learned", "place right",
             "place wrong", "confirmed", "explained"]  # fmt: skip
    return pd.DataFrame(rows, columns=heads)


def _share(values: pd.Series) -> str:
    """Share of those to which a question applies."""
    asked = values[values.notna()]
    return share_text(float(asked.astype(bool).mean())) if len(asked) else "–"


def method_table(baselines: pd.DataFrame) -> pd.DataFrame:
    """The simpler methods, the diagnosis and the oracle, over all sizes."""
    whole = baselines[baselines["size"].isna()].set_index(["method", "set", "quantity"])["share"]
    columns = {
        "false alarm": ("null", "detected"),
        "wrong noise named": ("noise", "wrong"),
        "one: found": ("one", "detected"),
        "one: all names right": ("one", "right"),
        "one: first name right": ("one", "first right"),
        "one: some name wrong": ("one", "wrong"),
        "two: both right": ("two", "right"),
    }
    rows = [
        (method, *(share_text(whole.get((method, *key), np.nan)) for key in columns.values()))
        for method in dict.fromkeys(["diagnosis", "oracle", *baselines["method"]])
    ]
    return pd.DataFrame(rows, columns=["method", *columns])


def shrink_table(campaigns: pd.DataFrame) -> pd.DataFrame:
    """Variance of unit weight before and after what was confirmed."""
    chosen = campaigns[campaigns["set"].isin(["one", "two"]) & campaigns["confirmed"].eq(True)]
    before, after = chosen["sigma0_before"], chosen["sigma0_after"]
    table = pd.DataFrame(
        {"σ₀² before": before, "σ₀² after": after, "ratio (medians)": after / before}
    )
    groups = table.groupby([chosen["set"].rename("campaigns"), chosen["size"].rename("λ")])
    medians = groups.median().map(number)
    medians.insert(0, "confirmed", groups.size())
    shown = medians.rename(SETS, level=0).rename("{:g}".format, level=1)
    return shown.reset_index()


def effect_table(one: pd.DataFrame, limits: pd.DataFrame) -> pd.DataFrame:
    """Each effect over all sizes, and from its limits on."""
    asked = {"found": "alarm", "name right": "right", "oracle": "oracle_right", "wrong": "wrong"}
    table = divided(one, "what", asked)
    heads = {"found from the MDB on": ("detected", "above_mdb"),
             "right from the MIB on": ("right", "above_mib")}  # fmt: skip
    for head, (column, n) in heads.items():
        right = (limits[column].fillna(0) * limits[n]).groupby(limits["what"]).sum()
        above = limits.groupby("what")[n].sum()
        table[head] = (right / above).reindex(table.index).astype(float).map(share_text)
    return table.rename(words).rename_axis("effect").reset_index()


BY_KIND = ("noise", "one", "gross")
"""Sets of which each kind has its campaign in the sample; of the others each size has one."""


def sample_table(campaigns: pd.DataFrame) -> pd.DataFrame:
    """A campaign of each kind or size, as good as at random, and what was said of it.

    Parameters
    ----------
    campaigns : DataFrame, truths and outcomes side by side
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
    rows = []
    for row in chosen.to_dict("records"):
        said = isinstance(row["verdict"], str)
        best = [*json.loads(row["credible_set"])[:1]] if said else []
        rows.append({
            **{name: row[name] for name in KEY},
            "verdict": words(row["verdict"]) if said else "no answer",
            "confirmed": "yes" if row["confirmed"] is True else "no",
            "explanation": words("+".join(best[0]["names"]) if best else ""),
            "posterior": number(best[0]["posterior"] if best else np.nan),
            "σ₀²": number(row["sigma0_before"]),
        })  # fmt: skip
    return pd.DataFrame(rows)
