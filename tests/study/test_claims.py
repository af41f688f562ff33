"""The paper's claims: verdicts that can be either.

The golden set keeps their numbers.
"""

import re

import numpy as np
import pytest
from page_helpers import text_of
from study_helpers import NINE, grid, make_study, run_study
from usual import STANDARD_ERRORS

from accelstudy.study.claims import quantities
from accelstudy.study.claims.page import claims_markdown, claims_page
from accelstudy.study.claims.quantities import single_reductions
from accelstudy.study.claims.verdicts import (
    NOT_REPRODUCED,
    REPRODUCED,
    ClaimData,
    claim_table,
    judge,
    judge_claim,
)
from accelstudy.study.sensitivity import sensitivity_table, shapley_table
from accelstudy.study.tables import with_derived

REPLICATES = 1000
BASE_SAMPLES = 256
KEYS = {
    "grids": [grid(schemes=["mclaren-24", "rings-24"], replicates=REPLICATES)],
    "leveling": {"attitudes": 5},
    "sensitivity": {
        "base_samples": BASE_SAMPLES,
        "roll_gon": [0, 20, 50], "pitch_gon": [0, 50],
    },
    "paper": True,
}  # fmt: skip


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    found = run_study(tmp_path_factory.mktemp("claims"), **KEYS)
    sensitivity = sensitivity_table(make_study(**KEYS), found["summary"])
    keys = {**KEYS, "sensitivity": {**KEYS["sensitivity"], "pitch_gon": [0, 25]}}
    shapley = shapley_table(make_study(**keys), found["summary"], found["correlations"])
    return {**found, "sensitivity": sensitivity, "shapley": shapley}


@pytest.fixture(scope="module")
def data(tables):
    """Function that gives the data where the study or its tables are others."""

    def of(noise=(), **changed):
        return ClaimData(make_study(**KEYS, noise=dict(noise)), {**tables, **changed})

    return of


@pytest.fixture(scope="module")
def judged(data):
    return judge(data()).set_index("claim")


def claim_of(name, data):
    """The row of one claim of the paper."""
    (claim,) = (each for each in claim_table() if each["claim"] == name)
    return judge_claim(claim, data)


def test_order_of_the_inputs(tables, judged, data):
    """At a roll of 50 gon and a pitch of 25 s_y and s_z overtake b_y and b_z; elsewhere none."""
    claim = judged.loc["order-of-inputs"]
    assert claim["verdict"] == NOT_REPRODUCED
    assert claim["ours"] == pytest.approx(100 / 12)  # of 6 attitudes, roll and pitch
    assert "s_y, s_z overtake b_y, b_z, from rank 4 down" in claim["sentence"]
    assert "With the robot no input overtakes another" in claim["sentence"]

    shapley = tables["shapley"]
    same = shapley.assign(shapley_effect=shapley["total_effect"])
    claim = claim_of("order-of-inputs", data(shapley=same))
    assert (claim["verdict"], claim["ours"]) == (REPRODUCED, 0)


# --- verdicts ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("mean", "central", "verdict"), [
    (54, (53, 55), REPRODUCED),  # rounds to about 50
    (57, (56, 58), NOT_REPRODUCED),
    (0, (-5, 5), NOT_REPRODUCED),
    (41, (-10, 65), REPRODUCED),  # single simulations spread over the paper's number
])  # fmt: skip
def test_verdict_on_a_reduction(tables, judged, data, mean, central, verdict, monkeypatch):
    low, high = central
    single = {"single_low": low, "single_high": high, "percentile": 12.34}
    monkeypatch.setattr(quantities, "single_reductions", lambda *_: single)
    summary = tables["summary"].copy()
    at = (summary["approach"] == "robot") & summary["parameter"].str.startswith("b_")
    factor = (100 - mean) / (100 - judged.loc["reduction-bias", "ours"])
    summary.loc[at, "sd_posteriori_mean"] *= factor
    claim = claim_of("reduction-bias", data(summary=summary))
    assert claim["verdict"] == verdict
    assert claim["ours"] == pytest.approx(mean, abs=1e-9)
    assert (claim["single_low"], claim["single_high"]) == (low, high)
    count = 2 if low <= 50 <= high else 0
    assert f"in {count} of 2 schemes" in claim["sentence"]
    said = f"{low} to {high} %, and 12.3 % of them".replace("-", "−")
    assert said in claim["sentence"]


def test_verdict_on_accuracy_near_level(data):
    claim = claim_of("level-roll", data(noise={"sensor": {"sigma_mps2": 0.004}}))
    assert claim["verdict"] == NOT_REPRODUCED
    assert claim["ours"] == pytest.approx(25.97, rel=0.01)


@pytest.mark.parametrize(("claim", "factor", "rest", "verdict"), [
    ("scale-correlation-gravity", 0.8, 0.0, REPRODUCED),  # 0.20
    ("scale-correlation-gravity", 1.6, 0.0, NOT_REPRODUCED),  # 0.40
    ("scale-correlation-gravity", 0.1, 0.0, NOT_REPRODUCED),  # 0.02
    ("nearly-uncorrelated", 1.0, 0.0, REPRODUCED),
    ("nearly-uncorrelated", 1.0, 0.2, NOT_REPRODUCED),
])  # fmt: skip
def test_verdict_on_the_correlation(tables, data, claim, factor, rest, verdict):
    table = tables["correlations"]
    scales = table["parameter_1"].str.startswith("s_") & table["parameter_2"].str.startswith("s_")
    adjustment = table["adjustment"] * np.where(scales, factor, 1) + np.where(scales, 0, rest)
    changed = data(correlations=table.assign(adjustment=adjustment))
    assert claim_of(claim, changed)["verdict"] == verdict


def test_a_scheme_without_redundancy_has_no_reduction(tables, data):
    summary = tables["summary"].copy()
    summary.loc[summary["scheme"] == "rings-24", "sd_posteriori_mean"] = np.nan
    assert "of 1 schemes" in claim_of("reduction-bias", data(summary=summary))["sentence"]


def test_single_simulations_are_those_of_the_estimates(tables, data):
    """Ratios of the sds a posteriori of pairs of calibrations, by their order statistics."""
    estimates = with_derived(tables["estimates"])
    chosen = estimates["parameter"].isin(["b_x", "b_y", "b_z"])
    for scheme in ("mclaren-24", "rings-24"):
        sds = [
            estimates[chosen & (estimates["cell"] == f"{NINE}/{scheme}/{approach}")]
            .groupby("replicate")["sigma_posteriori"].mean()
            for approach in ("gravity", "robot")
        ]  # fmt: skip
        reduction = 100 * (1 - sds[1] / sds[0])
        said = single_reductions(data(), "bias", scheme, 50)
        n = len(reduction)
        for share, value in ((0.025, "single_low"), (0.5, "median"), (0.975, "single_high")):
            below = np.mean(reduction < said[value])
            assert abs(below - share) < STANDARD_ERRORS * np.sqrt(share * (1 - share) / n)
        below = np.mean(reduction < 50)
        assert abs(said["percentile"] / 100 - below) < STANDARD_ERRORS * 0.5 / np.sqrt(n)


# --- for people ----------------------------------------------------------------------------------


def test_every_claim_is_on_the_page_and_in_the_markdown(judged):
    claims = judged.reset_index()
    page, text = claims_page(claims), claims_markdown(claims)
    for row in claims.to_dict("records"):
        for words in (row["statement"], row["sentence"], row["verdict"]):
            assert words in text_of(page)
            assert words in text
    assert [line.count("|") for line in text.splitlines()] == [7] * (len(claims) + 2)
    assert "&lt;b&gt;&amp;&lt;/b&gt;" in claims_page(claims.assign(statement="<b>&</b>"))
    assert not re.search(r"\bnan\b", page + text, re.IGNORECASE)
    assert not re.search(r"(src|href)=[\"']https?:", page)
