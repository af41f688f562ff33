"""The score of hand-made truths and answers, of which all numbers are known."""

import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from accelstudy.basics.shares import clopper_pearson
from accelstudy.campaign.calibration.fit import usual_approach
from accelstudy.diagnosis.decision.problem import fit_base, pose
from accelstudy.diagnosis.space.shapes import LearnedShapes
from accelstudy.sensors.models import get_model
from studies.hidden.campaigns import TYPES, fit_squares
from studies.hidden.physics.designs import session
from studies.hidden.physics.generate import Case, generate
from studies.hidden.scoring.figures import figures
from studies.hidden.scoring.judging import LEARNABLE, all_true, same_effects
from studies.hidden.scoring.page import score_page
from studies.hidden.scoring.tables import SCORE, _measured, score_tables, shares

DRIFT, WARM, SQUARE, MOUNTED = (
    ["bias_drift"], ["warm_up"], ["quadratic_scale"],
    ["cross_axis_misalignment", "mounting_rotation"],
)  # fmt: skip


def truth(set_, classes=(), size=np.nan, oracle=None, **more):
    """A row of the table of truths; the oracle is right, wrong, or finds nothing."""
    best = {"right": classes, "wrong": [["settling"]], "nothing": []}.get(oracle, [])
    return {
        "set": set_, "what": "+".join(one[0] for one in classes), "size": size,
        "design": "spread-24", "approach": "robot", "sigma": "given",
        "classes": json.dumps(list(classes)), "effects": "[]", "noise": "null", "gross": "{}",
        "gross_name": "", "oracle_detected": None if oracle is None else oracle != "nothing",
        "oracle_best": json.dumps(list(best)), "oracle_told": json.dumps(list(classes)),
        "oracle_alternatives": 1,
        "left": "[]", "true_place": "null", "sensor": "null", "seed": "[]",
        "methods": '{"F test": [true, ["bias_drift"]]}' if set_ == "one" else "null", **more,
    }  # fmt: skip


def answer(verdict, *found, among=(), place=None, place_of="null", **more):
    """A row of the table of outcomes; the set is what was found at 0.8, and more at 0.15 each."""
    explanations = [] if verdict == "no_effect" else [(list(found) or ["unknown"], 0.8)]
    explanations += [(names, 0.15) for names in among]
    return {
        "verdict": verdict, "found": json.dumps(found), "specs": "[]", "found_classes": "[]",
        "positions": json.dumps([place] + [None] * (len(found) - 1)), "posteriors": "[]",
        "credible_set": json.dumps(
            [{"names": n, "classes": [[i] for i in n], "posterior": p} for n, p in explanations]
        ),
        "place": place_of, "fits": "[]",
        "confirmed": False, "statement": "", "held_out_z": np.nan, "sigma0_before": 2.0,
        "sigma0_after": 1.0, "p_size": 0.1, "redundancy": 63, "positions_used": 24, "reason": "",
        "error": "", **more,
    }  # fmt: skip


TRUE = session("spread-24")
YAW, TIME = '["yaw", "bias"]', '["time", "bias"]'


def learned(place, share, **more):
    """An answer that explains a share of λ = 150 by a function, with 10 of 63 dimensions."""
    before, after = 150 + 63, 150 * (1 - share) + 53
    # Ω is of forces before, of forces and angles after.
    fits = [
        {"force": before * TRUE.sigma**2, "angle": 0.0, "noise": 63},
        {"force": (after - 9) * TRUE.sigma**2, "angle": 9 * TRUE.sigma_angle**2, "noise": 53},
    ]
    return answer("learned", "learned", place_of=place, fits=json.dumps(fits), **more)


GIVEN_AWAY = {"verdict": None, "found": None, "credible_set": None, "confirmed": None}
"""What there is of a diagnosis that failed."""

BUMPED = {"gross_name": "outlier_position", "gross": '{"settings": {"position": 7.0}}'}

CASES = [
    *[(truth("null", sigma=s), answer("no_effect")) for s in ("given", "not given")] * 19,
    (truth("null"), answer("named", "settling", confirmed=True)),
    *[(truth("null"), answer("no_effect"))] * 19,
    (truth("null", sigma="not given"), answer("unknown")),
    (truth("one", [DRIFT], 25, "right"), answer("named", "bias_drift", confirmed=True)),
    (truth("one", [DRIFT], 25, "right"), answer("narrowed", "warm_up", among=[["bias_drift"]])),
    (truth("one", [MOUNTED], 25, "wrong"), answer("named", "mounting_rotation")),
    (truth("one", [SQUARE], 25, "nothing"), answer("no_effect")),
    (truth("one", [SQUARE], 60, "right"), answer("named", "quadratic_scale", "settling")),
    (truth("one", [SQUARE], 60, "right"), {**answer("named"), **GIVEN_AWAY, "error": "refused"}),
    (truth("two", [DRIFT, SQUARE], 40, "right"), answer("named", "quadratic_scale", "bias_drift")),
    (truth("two", [DRIFT, SQUARE], 40, "right"), answer("named", "bias_drift")),
    (truth("two", [DRIFT, WARM], 40, "wrong"), answer("named", "warm_up", "settling")),
    (truth("noise", what="level"), answer("noise_model", "noise_level")),
    (truth("removed", size=400.0, what="warm_up"), answer("unknown")),
    (truth("removed", size=60.0, what="warm_up"), answer("named", "bias_drift")),
    (truth("outside", size=150.0, what="fifth"), answer("narrowed", "settling")),
    (truth("outside", size=150.0, what="turn", true_place=YAW), learned(YAW, 0.9, confirmed=True)),
    (truth("outside", size=150.0, what="turn", true_place=YAW), learned(YAW, 0.8)),
    (truth("outside", size=400.0, what="turn", true_place=YAW), learned(TIME, 0.8)),
    (truth("outside", size=400.0, what="turn", true_place=YAW), answer("named", "settling")),
    (truth("outside", size=400.0, what="fifth"), learned(TIME, 0.3)),
    # Too small, and in a noise that nobody knows.
    (truth("outside", size=40.0, what="turn", true_place=YAW), learned(TIME, 0.8)),
    (truth("outside", size=150.0, what="turn", true_place=YAW, sigma="not given"),
     answer("named", "settling")),
    (truth("unforeseen", size=150.0, what="odd", true_place=TIME, sigma="not given",
           design="repeats-30"), learned(TIME, 0.8)),
    (truth("unforeseen", size=150.0, what="odd"), answer("named", "settling")),
    (truth("null"), learned(YAW, 0.1, confirmed=True)),
    (truth("gross", gross_name="axis_error"), answer("gross_error", "axis_error", "bias_drift")),
    (truth("gross", gross_name="row_order"), answer("unknown")),
    (truth("gross", **BUMPED), answer("gross_error", "outlier_position", place=7)),
    (truth("gross", **BUMPED), answer("gross_error", "outlier_position", place=8)),
]  # fmt: skip


@pytest.fixture(scope="module")
def campaigns():
    """Truths and outcomes."""
    rows = [{"cell": f"cell {i}", "campaign": i % 3, **truth, **answer}
            for i, (truth, answer) in enumerate(CASES)]  # fmt: skip
    table = pd.DataFrame(rows)
    return table.astype({name: TYPES[name] for name in table})


@pytest.fixture(scope="module")
def tables(campaigns):
    limit = {"design": "spread-24", "approach": "robot", "mdb": 1.0, "mib": 2.0, "unit": "m/s^2",
             "nearest": "warm_up", "lambda_mdb": 15.0, "lambda_mib": 50.0}  # fmt: skip
    known = [{"what": what, **limit} for what in ("bias_drift", "quadratic_scale")]
    return score_tables(campaigns, pd.DataFrame(known))


ORIGIN = {"seed": 5, "version": "1.2", "commit": "abcdef012345+"}


def test_names_are_right_in_any_order_and_each_for_another_effect():
    assert same_effects([["b"], ["a"]], [["a", "x"], ["b"]])
    assert not same_effects([["a"], ["x"]], [["a", "x"], ["b"]])
    assert not same_effects([["a"]], [["a"], ["b"]])
    assert all_true([["a"]], [["a"], ["b"]])
    assert not all_true([], [["a"]])
    assert not same_effects([], [])
    assert not all_true([["a"], ["b"]], [["a"]])


@pytest.mark.parametrize(("figure", "cases", "wanted", "measured", "n", "met"), [
    ("campaigns without an answer", "all", "0.00", 1 / len(CASES), len(CASES), "no"),
    ("false alarm", "nothing missing, sigma given", "0.05 ± 0.01", 2 / 40, 40, "yes"),
    ("named or narrowed to effects", "wrong noise only", "≤ 0.03", 0, 1, "yes"),
    # Drift is right, and the mounting by its other name; narrowed to the wrong one is not.
    ("best name right, named or narrowed", "one effect, λ = 25", "≥ 0.66 (oracle 0.50)",
     2 / 4, 4, "no"),
    # A second name beside the right one is wrong, and so is no answer.
    ("best name right, named or narrowed", "one effect, λ = 60", "≥ 0.86 (oracle 1.00)",
     0, 2, "no"),
    ("best name right, named or narrowed", "one effect, over all λ",
     "≥ 0.64 (oracle 0.67 − 0.03)", 2 / 6, 6, "no"),
    ("named, and wrong", "one and two effects", "≤ 0.02", 2 / 6, 6, "no"),
    ("90 % set holds the truth", "one effect, λ = 25", "≥ 0.90", 1, 3, "yes"),
    ("names in a 90 % set", "one effect, λ = 25", "≤ 2.40 (oracle 1.0)", 4 / 3, 3, "yes"),
    ("both of two right", "two effects, λ = 40 each", "≥ 0.60 (oracle 0.67)", 1 / 3, 3, "no"),
    ("place right", "never in the catalogue, with a place, λ ≥ 150", "≥ 0.70", 2 / 4, 4, "no"),
    ("place wrong", "never in the catalogue, with a place, λ ≥ 150", "≤ 0.02", 1 / 4, 4, "no"),
    ("confirmed", "never in the catalogue, place right, λ ≥ 150", "≥ 0.80", 1 / 2, 2, "no"),
    ("share of λ explained, median", "never in the catalogue, place right, λ ≥ 150", "≥ 0.85",
     0.85, 2, "yes"),
    ("named or narrowed wrongly", "unforeseen, λ ≥ 150", "≤ 0.12", 1 / 2, 2, "no"),
    ("confirmed", "nothing missing", "≤ 0.003", 2 / 60, 60, "no"),
    # Fewer than are needed for a share.
    ("confirmed, given a name or a function", "nothing missing", "0.05 ± 0.03, n ≥ 150", 1, 2,
     "no"),
    # A bumped hold is recognised where it is.
    ("recognised", "gross errors", "1.00", 2 / 4, 4, "no"),
    # What explains the targets.
    ("names in a 90 % set beyond the oracle's", "one effect, λ = 25", "", 1 / 3, 3, ""),
    ("right, and withheld", "one effect, λ = 25", "", 0, 2, ""),
    ("named, and wrong, as the posteriors expect", "one and two effects", "", 0.2, 6, ""),
    ("named, and wrong", "posterior from 0.85 on", "", np.nan, 0, ""),
    ("learned", "outside the catalogue, without a place, λ ≥ 150", "", 1 / 2, 2, ""),
    ("place right", "outside the catalogue, a place that can be learned, λ ≥ 150", "", 2 / 4, 4,
     ""),
])  # fmt: skip
def test_targets(tables, figure, cases, wanted, measured, n, met):
    table = tables["targets"]
    (row,) = table[(table["figure"] == figure) & (table["cases"] == cases)].to_dict("records")
    assert (row["wanted"], row["n"], row["met"]) == (wanted, n, met)
    assert row["measured"] == pytest.approx(measured, nan_ok=True)
    if n and "names" not in figure and "median" not in figure and "expect" not in figure:
        ends = clopper_pearson(round(measured * n), n)
        assert (row["ci95_low"], row["ci95_high"]) == pytest.approx([float(end) for end in ends])


def test_what_was_not_measured_is_not_met(campaigns):
    table = score_tables(campaigns.query("set == 'one'"), NO_LIMITS)
    row = table["targets"].query("figure == 'recognised'").iloc[0]
    assert (row["met"], row["ci95_low"], row["ci95_high"]) == ("–", 0, 1)


NO_LIMITS = pd.DataFrame(
    [{"what": "none", "design": "none", "approach": "none", "lambda_mdb": 1.0, "lambda_mib": 1.0}]
)


def test_every_line_of_the_table_is_known():
    keys = {"figure", "campaigns", "set", "filter", "statistic", "of", "beside", "each", "least",
            "most", "below_oracle", "n"}  # fmt: skip
    lines = [one for line in SCORE["targets"] for one in line.get("together", [line])]
    assert len(lines) > 40
    assert all({"figure", "campaigns", "of"} <= line.keys() <= keys for line in lines)


def test_the_interval_of_a_median_holds_it():
    """Of 40 exponential values: in 95 % of all samples, and not in many more."""
    values = np.random.default_rng(3).exponential(size=(400, 40))
    ends = [_measured("median", x)[1:] for x in values]
    inside = np.mean([low <= np.log(2) <= high for low, high in ends])
    assert inside == pytest.approx(0.96, abs=4 * np.sqrt(0.96 * 0.04 / 400))
    assert np.isnan(_measured("median", np.array([1.0, 2.0]))[1])


def test_what_noise_leaves_of_the_residuals_of_a_fit_with_a_prior():
    """Least squares of noise alone, two of five parameters held by rows of their own."""
    rng, rows = np.random.default_rng(4), 30
    columns = rng.standard_normal((rows, 5))
    held = np.diag([0, 0, 0, 3.0, 6.0])[3:]
    design = np.concatenate([columns, held])
    noise = np.concatenate([rng.standard_normal((rows, 4000)), np.zeros((2, 4000))])
    left = noise - design @ np.linalg.lstsq(design, noise)[0]
    sums = np.sum(left[:rows] ** 2, axis=0)
    solution = SimpleNamespace(
        design=design, misclosures=np.zeros((10, 3)), residuals=left[:rows, :1].reshape(10, 3)
    )
    fit = fit_squares(solution)
    assert fit["noise"] == pytest.approx(sums.mean(), abs=4 * sums.std() / np.sqrt(4000))
    assert rows - 5 < fit["noise"] < rows - 3
    assert (fit["force"], fit["angle"]) == (pytest.approx(sums[0], rel=1e-5), 0)


def test_the_places_at_which_a_function_can_be_learned():
    """Those of a session with all coordinates."""
    case = Case("null", "repeats-30", "robot", True)
    campaign, _ = generate(case, np.random.SeedSequence(1))
    model = get_model("bias-scale-nonorthogonality")
    frame = pose(fit_base(campaign, model, usual_approach(campaign))).frame
    places = {(one, target) for target, names in LEARNABLE.items() for one in names}
    assert places == set(LearnedShapes.of(frame).places)


def test_the_place_of_what_is_learned(tables):
    judged = tables["campaigns"].query("set == 'outside'")
    told = judged[["learned", "has_place", "place_right", "place_wrong", "answered", "wrong"]]
    yes, no, none = True, False, None
    assert told.astype(object).where(told.notna(), None).to_numpy().tolist() == [
        [no, no, none, none, yes, yes],
        *[[yes, yes, yes, no, no, no]] * 2,
        [yes, yes, no, yes, no, no],
        [no, yes, no, no, yes, yes],
        [yes, no, none, none, no, no],
        [yes, yes, no, yes, no, no],
        [no, yes, no, no, yes, yes],
    ]
    explained = judged["explained"].to_numpy()
    assert explained == pytest.approx(
        [np.nan, 0.9, 0.8, 0.8, np.nan, 0.3, 0.8, np.nan], nan_ok=True
    )


def test_shares(tables):
    judged = tables["campaigns"]
    one = judged[judged["set"] == "one"]
    alarms = shares(judged[judged["set"] == "null"], "alarm", "sigma").set_index("sigma")
    assert alarms.loc["given", ["count", "n"]].tolist() == [2, 40]
    # A place is only asked of what has one.
    assert shares(judged, "place_right", "set").set_index("set").loc["outside", "n"] == 6
    # Narrowed to a set that holds the truth is not wrong.
    assert shares(one, "wrong", "size")["count"].tolist() == [0, 1]
    assert shares(one, "oracle_found", "size")["share"].tolist() == [3 / 4, 1]
    low, high = clopper_pearson([0, 1, 5], [10, 20, 5])
    assert low == pytest.approx([0, 0.0012651, 0.4781762], abs=1e-6)
    assert high == pytest.approx([0.3084971, 0.2487328, 1], abs=1e-6)


def test_other_tables(tables):
    confused = tables["confusion"].set_index(["truth", "answer"])["share"]
    assert confused["slow change in time", "slow change in time"] == 1  # warm-up for a drift, too
    assert confused["even nonlinearity", "nothing"] == 1 / 2
    # Of all with a set, singles and pairs: three names of the first place are right in the end.
    stated = tables["calibration"].set_index("of")
    assert stated.loc["explanation", ["count", "n"]].tolist() == [3, 7]
    assert stated.loc["explanation", "stated"] == pytest.approx(0.8)
    assert stated.loc["set", ["count", "n"]].sum().tolist() == [4, 7]
    table = tables["baselines"]
    whole = table[table["size"].isna()].set_index(["method", "quantity"])["share"]
    assert whole["F test"].to_dict() == pytest.approx(
        {"detected": 1, "right": 2 / 6, "first right": 2 / 6, "wrong": 4 / 6}
    )
    assert whole["oracle", "right"] == pytest.approx(4 / 6)
    assert whole["diagnosis", "right"] == pytest.approx(2 / 6)
    limits = tables["limits"].set_index("what")
    assert limits.loc["bias_drift", ["above_mdb", "above_mib"]].tolist() == [2, 0]
    assert limits.loc["quadratic_scale", ["above_mib", "right"]].tolist() == [2, 0]
    assert limits.loc["quadratic_scale", "detected"] == pytest.approx(1 / 3)


def test_a_page_with_every_target_and_every_error(tables):
    page = score_page(tables, pd.Series([0.1, 0.2, 0.3]), {"fingerprint": "0123", "origin": ORIGIN})
    assert "configuration `0123`, seed 5, accelstudy 1.2, commit `abcdef0123`" in page
    for row in tables["targets"].to_dict("records"):
        wanted = f" {row['wanted']} |" if row["wanted"] else ""
        assert f"| {row['figure']} | {row['cases']} |{wanted}" in page
    assert "| refused | 1 |" in page
    assert (
        "| never in the catalogue | turn | – | 4 | 0.25 | 0.75 | 0.50 | 0.25 | 0.50 | 0.85 |"
        in page
    )
    assert "nan" not in page


def test_figures_of_much_and_of_nothing(tables):
    empty = {name: table[:0] for name, table in tables.items()}
    for made in (tables, empty):
        for draw in figures(made).values():
            assert draw().axes
