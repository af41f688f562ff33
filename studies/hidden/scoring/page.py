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
from studies.hidden.campaigns import KEY
from studies.hidden.physics.generate import place_of
from studies.hidden.real_noise import RealNoiseConfig
from studies.hidden.scoring.figures import figures
from studies.hidden.scoring.judging import LARGE, NEAR, NONE, RIGHT, SAID, judge
from studies.hidden.scoring.tables import (
    SCORE,
    Tables,
    score_tables,
    study_limits,
    with_intervals,
)
from studies.hidden.study import HiddenConfig


def write_score(
    config: HiddenConfig | RealNoiseConfig,
    inputs: Mapping[str, Sequence[str]],
    outputs: Mapping[str, str],
    provenance: Mapping[str, Any],
) -> str:
    """Score a study; returns the page.

    Parameters
    ----------
    config : HiddenConfig or RealNoiseConfig
    inputs : paths of the tables of all jobs, campaigns and seconds
    outputs : paths of the tables of the score by name, of the page, and of the folder `figures`
    provenance : see `accelstudy.files.tables.origin`
    """
    campaigns, seconds = (read_table([*inputs[name]]) for name in ("campaigns", "seconds"))
    made = {"origin": origin(provenance), "fingerprint": config.fingerprint}
    tables: Tables
    if isinstance(config, RealNoiseConfig):
        tables = {"campaigns": judge(campaigns, {k: log.own for k, log in config.logs.items()})}
        page = real_page(config, tables["campaigns"], made)
    else:
        tables = score_tables(campaigns, study_limits(config))
        page = score_page(tables, seconds["seconds"], made)
        folder = Path(outputs["figures"])
        folder.mkdir(parents=True, exist_ok=True)
        save_all(figures(tables), folder)
    for name, table in tables.items():
        write_table(outputs[name], table, provenance)
    with whole_file(outputs["page"]) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return page


# --- text -----------------------------------------------------------------------------------------


def share_text(value: float) -> str:
    """Write a share to two digits, or three decimals."""
    return "–" if np.isnan(value) else f"{value:.3f}" if value < 0.0995 else f"{value:.2f}"


def intervals(table: pd.DataFrame) -> list[str]:
    """Write the intervals of shares, where there are any campaigns."""
    ends = zip(table["ci95_low"], table["ci95_high"], table["n"], strict=True)
    return [("–" if np.isnan(low) else f"{share_text(low)} … {share_text(high)}") if n else ""
            for low, high, n in ends]  # fmt: skip


def label(value: Any) -> str:
    """Write what divides campaigns: a size, a set or a name."""
    return f"{value:g}" if isinstance(value, float) else SCORE["sets"].get(value) or words(value)


def markdown(table: pd.DataFrame) -> str:
    """Write a table in Markdown."""
    rows = [[*table.columns], ["---"] * table.shape[1], *table.itertuples(index=False)]
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in rows)


def render(template: str, made: Mapping[str, Any], **content: Any) -> str:
    """Render a page from a template beside this file."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("studies.hidden.scoring", ""),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    environment.filters.update(table=markdown, number=number)
    return environment.get_template(template).render(made, **content)


# --- the study of hidden effects ------------------------------------------------------------------


def score_page(tables: Tables, seconds: pd.Series, made: Mapping[str, Any]) -> str:
    """Write the score as tables in Markdown.

    Parameters
    ----------
    tables : of `score_tables`
    seconds : Series, processor time of each diagnosis
    made : fingerprint of the configuration, and origin, see `accelstudy.files.tables.origin`
    """
    campaigns = tables["campaigns"].astype({"set": pd.CategoricalDtype([*SCORE["sets"]])})
    targets, lines = target_table(tables["targets"]), SCORE["tables"]
    wanted = targets["target"] != ""
    failed = campaigns.loc[~campaigns["ok"], "error"].value_counts().rename_axis("error")
    return render(
        "score.md.j2",
        made,
        n=len(campaigns),
        large=f"{LARGE:g}",
        seconds=[float(seconds.quantile(part)) for part in (0.5, 0.95)],
        targets=targets[wanted],
        beside=targets[~wanted].drop(columns=["target", "met"]),
        kinds=kind_table(campaigns, lines["kinds"]),
        methods=method_table(tables["baselines"]),
        shrinking=shrink_table(campaigns),
        sample=sample_table(campaigns),
        failed=failed.reset_index(name="campaigns"),
        **{name: labelled(share_table(campaigns, lines[name]))
           for name in ("sizes", "verdicts", "effects")},
    )  # fmt: skip


def share_table(campaigns: pd.DataFrame, line: Mapping[str, Any]) -> pd.DataFrame:
    """Shares as text that a line of `tables` in `score.yaml` asks for."""
    part = campaigns[campaigns["set"] == line["of"]] if "of" in line else campaigns
    answers = part[[*line["shares"].values()]].astype(float).set_axis([*line["shares"]], axis=1)
    by = [part[column].rename(head) for head, column in line["by"].items()]
    return answers.groupby(by, observed=True).mean().map(share_text)


def labelled(table: pd.DataFrame) -> pd.DataFrame:
    """Make what divides campaigns, the index of a table, columns of words."""
    heads = [*table.index.names]
    table = table.reset_index()
    for head in heads:
        table[head] = [label(value) for value in table[head]]
    return table


def target_table(table: pd.DataFrame) -> pd.DataFrame:
    """What was measured, with its interval, what is wanted, and whether it is met."""
    shown = table.rename(columns={"cases": "campaigns", "wanted": "target"})
    shown["measured"], shown["95 % interval"] = table["measured"].map(share_text), intervals(table)
    return shown[["figure", "campaigns", "target", "measured", "95 % interval", "n", "met"]]


def kind_table(campaigns: pd.DataFrame, line: Mapping[str, Any]) -> pd.DataFrame:
    """What becomes of each kind of physics that the catalogue lacks."""
    large = campaigns[campaigns["large"] & campaigns["set"].isin(["outside", "unforeseen"])]
    right = large["place_right"].fillna(value=False)
    of_right = {name: large[name].where(right) for name in ("confirmed", "explained")}
    large = large.assign(**of_right)
    groups = large.groupby(["set", "what"], observed=True)
    kinds: Any = groups.groups
    places = [", ".join(place_of(what) or ("–",)) for _, what in kinds]
    table = share_table(large, line)
    table.insert(0, "place", places)
    table.insert(1, "n", groups.size().to_numpy())
    explained = groups["explained"].median().map(share_text)
    return labelled(table.assign(explained=explained.to_numpy()))


def method_table(baselines: pd.DataFrame) -> pd.DataFrame:
    """The simpler methods, the diagnosis and the oracle, over all sizes."""
    whole = baselines[baselines["size"].isna()]
    heads = {head: tuple(column) for head, column in SCORE["methods"].items()}
    wide = whole.pivot_table("share", "method", ["set", "quantity"])
    wide = wide.reindex(columns=pd.MultiIndex.from_tuples(heads.values()))
    wide.columns = pd.Index([*heads])
    order = dict.fromkeys(["diagnosis", "oracle", *wide.index])
    return wide.reindex([*order]).map(share_text).rename_axis("method").reset_index()


def shrink_table(campaigns: pd.DataFrame) -> pd.DataFrame:
    """Variance of unit weight before and after what was confirmed."""
    chosen = campaigns[campaigns["set"].isin(["one", "two"]) & campaigns["confirmed"].eq(True)]
    before, after = chosen["sigma0_before"], chosen["sigma0_after"]
    values = {"σ₀² before": before, "σ₀² after": after, "ratio (medians)": after / before}
    by = [chosen["set"].rename("campaigns"), chosen["size"].rename("λ")]
    groups = pd.DataFrame(values).groupby(by, observed=True)
    table = groups.median().map(number)
    table.insert(0, "confirmed", groups.size())
    return labelled(table)


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
    table = campaigns.assign(kind=kind, digest=digest).sort_values("digest")
    table = table.drop_duplicates(["set", "kind"]).sort_values("cell", kind="stable")
    sets = table["credible_set"].map(lambda text: json.loads(text) if isinstance(text, str) else [])
    best = [(each or [{"names": [], "posterior": np.nan}])[0] for each in sets]
    said: dict[str, Any] = {
        "verdict": table["verdict"].fillna("no answer").map(words),
        "confirmed": ["yes" if yes is True else "no" for yes in table["confirmed"].astype(object)],
        "explanation": [words("+".join(one["names"])) for one in best],
        "posterior": [number(one["posterior"]) for one in best],
        "σ₀²": table["sigma0_before"].map(number),
    }
    return table[KEY].assign(**said)


# --- the study with real noise --------------------------------------------------------------------

P = "p of the F test"
CLASSES = {"> 0.01": -1.1, "10⁻⁴ … 0.01": -1e-2, "< 10⁻⁴": -1e-4}
"""Classes of the p-value of the F test that knows the form, and the lower ends of −p."""
PLAIN = [*CLASSES][-1]
WITHIN = 3.0
"""Sigmas within which a size counts as right."""
KINDS = ("one effect, with its column", "one effect, without its column", "two effects")
SIZES = (("size within 3σ", "ratio", "ratio_sigma"),
         ("the same of the F test", "known_ratio", "known_sigma"))  # fmt: skip
BESIDE = (*(head for head, *_ in SIZES), "oracle: name right")


def real_page(config: RealNoiseConfig, campaigns: pd.DataFrame, made: Mapping[str, Any]) -> str:
    """Write the score of a study with real noise.

    Parameters
    ----------
    config : RealNoiseConfig
    campaigns : DataFrame, of `judge`
    made : as in `score_page`
    """
    said = [one for one in SAID if one == RIGHT or (campaigns["said"] == one).any()]
    dummies = pd.get_dummies(campaigns["said"]).reindex(columns=said, fill_value=False)
    told = campaigns.drop(columns=said, errors="ignore").join(dummies.astype(int))
    null, put = told[told["set"] == "null"], told[told["set"] != "null"]
    column = put["recorded"].astype(object).map({True: "recorded", False: "not recorded"})
    kinds = np.select([put["set"] == "two", column == "not recorded"], KINDS[:0:-1], KINDS[0])
    shown: dict[str, Any] = {
        "what": pd.Categorical(kinds, KINDS),
        "effect": pd.Categorical(put["what"], config.effects),
        "its column": column.fillna("–"),
        P: pd.cut(-put["p_known"], [*CLASSES.values(), 1], right=False, labels=[*CLASSES]),
        **{
            head: (abs(put[ratio] - 1) <= WITHIN * put[sigma]).where(put[ratio].notna())
            for head, ratio, sigma in SIZES
        },
        "oracle: name right": put["oracle_right"],
    }
    put = put.assign(**shown)
    whole = said_table(put[put[P].notna()], ["what", P], said, BESIDE)
    ends = with_intervals(whole[[RIGHT, "n"]].rename(columns={RIGHT: "count"}))
    whole[said] = whole[said].div(whole["n"], axis=0).map(share_text)
    whole.insert(4, "95 %", intervals(ends))
    effects = said_table(put, ["effect", "its column", P], said, BESIDE)
    nothing = said_table(null, ["design"], said).set_index("design").loc[[*config.logs]]
    nothing.insert(0, "truth", [log.note for log in config.logs.values()])
    plain = put[(put[P] == PLAIN) & ~put["said"].isin([RIGHT, NEAR])]
    return render(
        "real.md.j2",
        made,
        n=len(campaigns),
        logs=len(config.logs),
        whole=whole,
        effects=effects.assign(effect=effects["effect"].map(words)),
        nothing=nothing.rename_axis("log").reset_index(),
        plain=PLAIN,
        otherwise=pd.DataFrame([otherwise(row) for row in plain.to_dict("records")],
                               columns=["campaign", P, "said", "verdict", "found", "oracle"]),
    )  # fmt: skip


def said_table(
    campaigns: pd.DataFrame, by: list[str], said: list[str], beside: Sequence[str] = ()
) -> pd.DataFrame:
    """Count what is said of campaigns that are divided by columns, and the answers beside it."""
    groups = campaigns.groupby(by, observed=True, dropna=False)
    table = pd.concat([groups.size().rename("n"), groups[said].sum()], axis=1)
    for head in beside:
        counts = zip(groups[head].sum(), groups[head].count(), strict=True)
        table[head] = [f"{yes:.0f} of {n}" if n else "–" for yes, n in counts]
    return table.reset_index()


def otherwise(row: Mapping[Any, Any]) -> tuple[str, ...]:
    """A campaign whose effect is plain, and that got another answer."""
    failed = row["said"] == NONE
    told, oracle = ([] if failed else json.loads(row["found"])), json.loads(row["oracle_told"])
    names = [" + ".join(told), " + ".join(" = ".join(one) for one in oracle)]
    verdict = row["error"] if failed else words(row["verdict"])
    return (row["cell"], f"{row['p_known']:.1e}", row["said"], verdict,
            *(words(text) or "–" for text in names))  # fmt: skip
