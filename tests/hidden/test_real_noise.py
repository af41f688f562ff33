"""Effects in public logs: what is put in is what was meant, and answers are judged by it."""

import numpy as np
import pandas as pd
import pytest
from places import ROOT
from scipy import optimize, stats

from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.files.reading import read_layer
from studies.hidden.campaigns import parse_hidden, row_of
from studies.hidden.physics.kinds import EFFECTS, Cause
from studies.hidden.real_logs import BUMPED, PUT, Donor, LogCase
from studies.hidden.real_noise import RealNoiseConfig
from studies.hidden.scoring.judging import judge

G, SIZE, COUNT, SIGMA = 9.80665, 20, 26, 0.01
CONFIG = parse_hidden(read_layer(ROOT / "studies/hidden/config/real-noise.yaml"))
NAME = "mpu6050"
SQUARE = LogCase("one", NAME, effect=("quadratic_scale",), lam=(300.0,))
OURS = RealNoiseConfig(
    study="test",
    seed=3,
    logs={NAME: {"note": "nothing is missing"}},
    sizes=[300],
    effects=["quadratic_scale", BUMPED, "thermal_bias", "quadratic_scale+bias_drift"],
    nothing=2,
)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A log of 26 blocks by an imperfect sensor."""
    rng = np.random.default_rng(21)
    directions = rng.standard_normal((COUNT, 3))
    forces = G * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    output = forces * [1.01, 0.99, 1.005] + [0.1, -0.05, 0.02]
    output[:, 0] += 0.004 * forces[:, 1]
    samples = np.repeat(output, SIZE, axis=0) + SIGMA * rng.standard_normal((COUNT * SIZE, 3))
    path = tmp_path_factory.mktemp("log") / "log.csv"
    pd.DataFrame(samples, columns=["fx", "fy", "fz"]).to_csv(path, index=False)
    donor = Donor(NAME, path, ImportSettings(block=SIZE), 30.0)
    OURS._opened[NAME] = donor
    return donor


def test_an_effect_is_put_into_each_reading(log):
    """k f² / g, at the force that the sensor felt then."""
    k = np.array([1e-3, -2e-3, 5e-4])
    one = Cause(EFFECTS["quadratic_scale"], {}, k[None])
    written = log.changed([one], False)[0].to_numpy()[:, :3]
    felt = (log.forces - log.sensor.bias) / (1 + log.sensor.scale)
    np.testing.assert_allclose(written - log.forces, k * felt**2 / G, atol=1e-12)


def test_what_acts_from_hold_to_hold_is_constant_within_each(log):
    for name, settings in (("hysteresis", {}), (BUMPED, {"row": 3.0})):
        added = log.unit(PUT[name], settings).reshape(3, COUNT, SIZE, 3)
        assert np.ptp(added, axis=2).max() == 0
        assert abs(added).max() == 1


def test_p_is_that_of_a_nested_fit(log):
    """The misclosures of the norm, fitted without and with the form, by a solver of its own."""
    row = row_of(OURS, SQUARE, 0)
    rng = np.random.default_rng(SQUARE.seed(OURS.seed, 0))
    one = log.drawn("quadratic_scale", 300, rng)
    means = import_log(*log.changed([one], False))[0].forces

    def misclosures(p):
        t = np.array([[p[0], p[1], p[2]], [0, p[3], p[4]], [0, 0, p[5]]])
        felt = means - p[6:9]
        felt = felt - p[9:] * felt**2 / G if len(p) > 9 else felt
        return np.linalg.norm(felt @ t.T, axis=1) - G

    start = [1.0, 0, 0, 1, 0, 1, 0, 0, 0]
    base, full = (
        optimize.least_squares(misclosures, p, xtol=1e-12) for p in (start, [*start, 0, 0, 0])
    )
    before, after = (2 * fit.cost for fit in (base, full))
    f = (before - after) / 3 / (after / (COUNT - 12))
    assert np.log10(row["p_known"]) == pytest.approx(
        np.log10(stats.f.sf(f, 3, COUNT - 12)), abs=0.3
    )
    # λ is what the effect alone adds to the sum of squares: 300 of the log's own variance.
    assert before / log.sigma**2 == pytest.approx(COUNT - 9 + 300, rel=0.3)


@pytest.fixture(scope="module")
def campaigns(log):
    """Truths and answers of the campaigns of the log."""
    return [row_of(OURS, case, k) for case, k in OURS.job(*OURS.jobs)]


def test_plain_effects_in_white_noise_are_found(campaigns):
    table = judge(campaigns)
    said = dict(zip(table["cell"], table["said"], strict=True))
    assert said[f"{NAME}/nothing/nan/as it is"] == "nothing"
    assert said[f"{NAME}/quadratic_scale/300/as it is"] in ("right name", "family or set")
    assert said[f"{NAME}/outlier_position/300/as it is"] == "right name"
    assert said[f"{NAME}/thermal_bias/300/recorded"] in ("right name", "family or set")
    assert said[f"{NAME}/thermal_bias/300/not recorded"] != "right name"


def said(
    row, verdict, found=(), true=("thermal_bias",), recorded=True, explanations=(), own=(), **more
):
    """What is said of an answer to a campaign."""
    answer = {
        "verdict": verdict, "recorded": recorded, "classes": [[n] for n in true], "found": found,
        "positions": [7] * len(found), "error": "", "credible_set": explanations, "oracle": None,
        "gross": {"name": "", "settings": {}},
    }  # fmt: skip
    return judge([{**row, **answer, **more}], {NAME: own})["said"].item()


@pytest.mark.parametrize(("expected", "given"), [
    ("no answer", {"verdict": None, "error": "refused"}),
    ("right name", {"verdict": "named", "found": ["thermal_bias"]}),
    ("right name", {"verdict": "gross_error", "found": [BUMPED], "true": [],
                    "gross": {"name": BUMPED, "settings": {"position": 7}}}),
    ("family or set", {"verdict": "narrowed", "found": ["warm_up"], "explanations": [
        {"names": ["warm_up"], "posterior": 0.5}, {"names": ["thermal_bias"], "posterior": 0.4}]}),
    ("family or set", {"verdict": "named", "found": ["warm_up"], "recorded": False}),
    ("family or set", {"verdict": "unknown", "explanations": [
        {"names": ["thermal_bias", "lag"], "posterior": 0.5},
        {"names": ["thermal_curve"], "posterior": 0.45}]}),
    ("unknown", {"verdict": "unknown", "explanations": [
        {"names": ["thermal_bias"], "posterior": 0.5},
        {"names": ["hysteresis"], "posterior": 0.45}]}),
    ("other name", {"verdict": "named", "found": ["warm_up"]}),
    # What a log has by itself is neither right nor wrong.
    ("nothing", {"verdict": "named", "found": ["warm_up"], "own": ["warm_up"]}),
    ("other name", {"verdict": "named", "found": ["cubic_scale"], "recorded": False}),
    ("other name", {"verdict": "gross_error", "found": [BUMPED]}),
    ("noise", {"verdict": "noise_model", "found": ["coloured_noise"]}),
    ("learned", {"verdict": "learned", "found": ["learned"]}),
    ("nothing", {"verdict": "no_effect"}),
])  # fmt: skip
def test_what_an_answer_says(campaigns, expected, given):
    assert said(campaigns[0], **given) == expected


def test_where_the_logs_are_changes_no_number():
    moved = CONFIG.model_copy(update={"public_folder": "elsewhere"})
    assert moved.fingerprint == CONFIG.fingerprint
