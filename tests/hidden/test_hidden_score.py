"""The score of hand-made truths and answers, of which all numbers are known."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binomtest

from accelstudy.campaign.calibration.fit import usual_approach
from accelstudy.diagnosis.decision.problem import fit_base, pose
from accelstudy.diagnosis.space.shapes import LearnedShapes
from accelstudy.sensors.models import get_model
from studies.hidden.campaigns import fit_squares
from studies.hidden.physics.designs import session
from studies.hidden.physics.generate import Case, generate
from studies.hidden.scoring.figures import figures
from studies.hidden.scoring.judging import LEARNABLE, all_true, same_effects
from studies.hidden.scoring.page import frames, score_page
from studies.hidden.scoring.tables import SCORES, share_text, statistic, table
from studies.hidden.study import HiddenConfig

DRIFT, WARM, SQUARE, MOUNTED = (
    ["bias_drift"], ["warm_up"], ["quadratic_scale"],
    ["cross_axis_misalignment", "mounting_rotation"],
)  # fmt: skip


def truth(set_, classes=(), size=np.nan, oracle=None, **more):
    """Truth of a campaign; the oracle is right, wrong, or finds nothing."""
    best = {"right": classes, "wrong": [["settling"]], "nothing": []}.get(oracle, [])
    return {
        "set": set_, "what": "+".join(one[0] for one in classes), "size": size,
        "design": "spread-24", "approach": "robot", "sigma": "given", "recorded": None,
        "classes": classes, "gross": {"name": "", "settings": {}}, "true_place": None,
        "oracle": oracle and {"detected": oracle != "nothing", "best": best, "told": classes,
                              "alternatives": 1},
        "p_known": np.nan,
        "methods": {"F test": [True, ["bias_drift"]]} if set_ == "one" else None, **more,
    }  # fmt: skip


def answer(verdict, *found, among=(), at=None, **more):
    """Answer to a campaign; the set is what was found at 0.8, and more at 0.15 each."""
    explanations = [] if verdict == "no_effect" else [(list(found) or ["unknown"], 0.8)]
    explanations += [(names, 0.15) for names in among]
    return {
        "verdict": verdict, "found": found, "positions": [at, None, None][: len(found)],
        "credible_set": [{"names": n, "posterior": p} for n, p in explanations],
        "place": None, "fits": [], "confirmed": False, "name_confirmed": False,
        "sigma0_before": 2.0, "error": "", **more,
    }  # fmt: skip


TRUE = session("spread-24")
YAW, TIME = ["yaw", "bias"], ["time", "bias"]


def learned(place, share, **more):
    """An answer that explains a share of λ = 150 by a function, with 10 of 63 dimensions."""
    before, after = 150 + 63, 150 * (1 - share) + 53
    # Ω is of forces before, of forces and angles after.
    fits = [
        {"force": before * TRUE.sigma**2, "angle": 0.0, "noise": 63},
        {"force": (after - 9) * TRUE.sigma**2, "angle": 9 * TRUE.sigma_angle**2, "noise": 53},
    ]
    return answer("learned", "learned", place=place, fits=fits, **more)


def gross(name, **settings):
    """Truth of a campaign with a gross error."""
    return truth("gross", gross={"name": name, "settings": settings})


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
    (truth("one", [SQUARE], 60, "right"), {"error": "refused"}),
    (truth("two", [DRIFT, SQUARE], 40, "right"), answer("named", "quadratic_scale", "bias_drift")),
    (truth("two", [DRIFT, SQUARE], 40, "right"), answer("named", "bias_drift")),
    (truth("two", [DRIFT, WARM], 40, "wrong"), answer("named", "warm_up", "settling")),
    (truth("three", [DRIFT, SQUARE, MOUNTED], 60, "nothing"),
     answer("named", "quadratic_scale", "mounting_rotation", "bias_drift")),
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
    (gross("axis_error"), answer("gross_error", "axis_error", "bias_drift")),
    (gross("row_order"), answer("unknown")),
    (gross("outlier_position", position=7.0), answer("gross_error", "outlier_position", at=7)),
    (gross("outlier_position", position=7.0), answer("gross_error", "outlier_position", at=8)),
]  # fmt: skip


@pytest.fixture(scope="module")
def campaigns():
    """Truths and outcomes."""
    return [{"cell": f"cell {i}", "campaign": i % 3, **truth, **answer}
            for i, (truth, answer) in enumerate(CASES)]  # fmt: skip


CONFIG = HiddenConfig.model_validate(
    {"study": "one", "seed": 1, "one": {"sizes": 25, "campaigns": 1}}
)
PAGE = SCORES["score"]["page"]


@pytest.fixture(scope="module")
def judged(campaigns):
    """The judged campaigns, and the methods on them."""
    return frames(campaigns, CONFIG)


ORIGIN = {"seed": 5, "version": "1.2", "commit": "abcdef012345+"}


def test_names_are_right_in_any_order_and_each_for_another_effect():
    assert same_effects([["b"], ["a"]], [["a", "x"], ["b"]])
    assert not same_effects([["a"], ["x"]], [["a", "x"], ["b"]])
    assert not same_effects([["a"]], [["a"], ["b"]])
    assert all_true([["a"]], [["a"], ["b"]])
    assert not all_true([], [["a"]])
    assert not same_effects([], [])
    assert not all_true([["a"], ["b"]], [["a"]])


@pytest.fixture(scope="module")
def targets(judged):
    """All rows of the targets, and of what stands beside them."""
    both = (table(PAGE[title], judged) for title in ("Targets", "Beside the targets"))
    return [row for part in both for row in part.to_dict("records")]


@pytest.mark.parametrize(("figure", "cases", "wanted", "measured", "n", "met"), [
    ("campaigns without an answer", "all", "0.00", 1 / len(CASES), len(CASES), "no"),
    ("false alarm", "nothing missing, sigma given", "0.05 ± 0.01", 2 / 40, 40, "yes"),
    # Drift is right, and the mounting by its other name; narrowed to the wrong one is not.
    ("best name right, named or narrowed", "one effect, λ = 25", "≥ 0.66 (oracle 0.50)",
     2 / 4, 4, "no"),
    # A second name beside the right one is wrong, and so is no answer.
    ("best name right, named or narrowed", "one effect, λ = 60", "≥ 0.86 (oracle 1.00)",
     0, 2, "no"),
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
    # Fewer than are needed for a share.
    ("confirmed, given a name or a function", "nothing missing", "0.05 ± 0.03, n ≥ 150", 1, 2,
     "no"),
    # A bumped hold is recognised where it is.
    ("recognised", "gross errors", "1.00", 2 / 4, 4, "no"),
    # What explains the targets.
    ("named, and wrong, as the posteriors expect", "one and two effects", "", 0.2, 6, ""),
    ("named, and wrong", "posterior from 0.85 on", "", np.nan, 0, ""),
])  # fmt: skip
def test_targets(targets, figure, cases, wanted, measured, n, met):
    (row,) = [r for r in targets if (r["figure"], r["campaigns"]) == (figure, cases)]
    assert (row.get("target", ""), row["n"], row.get("met", "")) == (wanted, n, met)
    assert row["measured"] == share_text(measured)
    if n and "names" not in figure and "median" not in figure and "expect" not in figure:
        ends = binomtest(round(measured * n), n).proportion_ci()
        assert row["95 % interval"] == " … ".join(share_text(float(end)) for end in ends)


def test_what_was_not_measured_is_not_met(campaigns):
    rows = table(PAGE["Targets"], frames([row for row in campaigns if row["set"] == "one"], CONFIG))
    row = rows[rows["figure"] == "recognised"].iloc[0]
    assert (row["met"], row["95 % interval"], row["measured"]) == ("–", "", "–")


def test_the_interval_of_a_median_holds_it():
    """Of 40 exponential values: in 95 % of all samples, and not in many more."""
    values = np.random.default_rng(3).exponential(size=(400, 40))
    ends = [statistic(np.sort(x), "median")[1:3] for x in values]
    inside = np.mean([low <= np.log(2) <= high for low, high in ends])
    assert inside == pytest.approx(0.96, abs=4 * np.sqrt(0.96 * 0.04 / 400))
    assert np.isnan(statistic(np.array([1.0, 2.0]), "median").low)


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


def test_a_page_with_every_target_and_every_error(judged, targets):
    page = score_page(CONFIG, judged, ORIGIN)
    assert (
        f"configuration `{CONFIG.fingerprint}`, seed 5, accelstudy 1.2, commit `abcdef0123`" in page
    )
    for row in targets:
        assert f"| {row['figure']} | {row['campaigns']} |" in page
    assert "| refused | 1 |" in page
    assert "nan" not in page


def test_figures_of_much_and_of_nothing(judged):
    empty = {name: rows[:0] for name, rows in judged.items()}
    for made in (judged, empty):
        drawn = {name: draw() for name, draw in figures("score", made).items()}
        assert [*drawn] == [*SCORES["score"]["figures"]]
        assert all(figure.axes for figure in drawn.values())
