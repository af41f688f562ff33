"""What a diagnosis writes: files, their content, the page for every verdict, and the loop."""

import json
import re
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import gross
import numpy as np
import pandas as pd
import pytest
import yaml
from diagnosis_helpers import assert_consistent, explanation, otherwise
from leveling_helpers import leveling_error
from page_helpers import assert_sound, text_of
from stand_ins import composed
from usual import NINE, G

import accelstudy as acs
from accelstudy.adjustment import calibrate
from accelstudy.basics.units import MGON, angles_in
from accelstudy.basics.wording import number
from accelstudy.campaign.format import write_campaign
from accelstudy.diagnosis.decision.posterior import Posterior
from accelstudy.diagnosis.decision.statement import Finding, Reason, statement_of
from accelstudy.diagnosis.decision.verdict import decide
from accelstudy.diagnosis.held_out import Confirmation
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.output import Diagnosis
from accelstudy.diagnosis.report.words import verdict_lines
from accelstudy.diagnosis.result import CampaignDiagnosis, TiltErrors
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.leveling.error import attitudes_in_use
from accelstudy.simulation.sessions import Noise, session

THERMAL = "thermal_bias: 0.003, -0.002, 0.001"
CASES = {
    "named": {"effects": (THERMAL,),
              "temperature": (20.0, 40.0),
              "temperature_order": "random",
              "order": "random"},
    "gravity": {"effects": ("quadratic_scale: 0.003, 0.004, -0.003",), "approach": "gravity"},
    "no_effect": {},
    "unknown": {"effects": (THERMAL, "hysteresis: 0.03, 0.02, 0.03", "settling: 0.01",
                            "cubic_scale: 0.006, 0.005, 0.006"),
                "temperature": (20.0, 40.0),
                "temperature_order": "random"},
    "learned": {"yaw": "random", "temperature": (20.0, 40.0)},
    "noise_model": {"noise_effects": ("noise_level(kappa=4)",)},
    "gross_error": {},
}  # fmt: skip
HEADLINES = {
    "named": "The model lacks thermal bias.",
    "gravity": "The model lacks", "no_effect": "Nothing that these data can show",
    "unknown": "The model lacks", "learned": "the bias of x depends on the yaw",
    "noise_model": "its noise is not",
    "gross_error": "The data have a gross error",
}  # fmt: skip


def simulated(case, folder):
    settings = {"scheme": "fibonacci-36", "seed": 5, **CASES[case]}
    campaign = acs.simulate_campaign(name=case, **settings)
    if case == "learned":
        turn = np.sin(np.asarray(campaign.yaw))[:, None]
        campaign = campaign.with_arrays(forces=campaign.forces + turn * np.array([8e-3, 0, 0]))
    if case == "gross_error":
        campaign = gross.rows(gross.axes(campaign, 2, 1, 3), 3, 9)
    write_campaign(campaign, folder, plausible=False)
    return campaign


RENDERED = {"named": ("residuals",), "learned": ("shape",)}
"""Figures that are rendered, by case; all others are only composed, which takes far less time."""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Diagnoses of all cases, each made once, with what was written."""
    root = tmp_path_factory.mktemp("diagnoses")

    @cache
    def get(case):
        simulated(case, root / case)
        diagnosed = acs.diagnose(root / case)
        folder = root / f"{case}-out"
        with composed(*RENDERED.get(case, ())):
            diagnosed.save(folder)
        content = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
        page = (folder / "report.html").read_text(encoding="utf-8")
        return SimpleNamespace(
            diagnosed=diagnosed, found=diagnosed.result, folder=folder, content=content, page=page
        )

    return get


@pytest.fixture(scope="module")
def named(written):
    """Diagnosis of the named effect, for what can be told of it otherwise."""
    return written("named").found


@pytest.mark.parametrize("case", CASES)
def test_every_verdict_is_written_and_told(written, case):
    one = written(case)
    content, page, out = one.content, one.page, one.folder
    assert content["verdict"] == ("named" if case == "gravity" else case)
    assert_consistent(content)
    assert HEADLINES[case] in one.diagnosed.verdict
    assert HEADLINES[case] in text_of(page)
    drawn = {path.stem for path in (out / "figures").glob("*.svg")}
    assert {"residuals", *(["evidence"] if content["posterior"] else [])} <= drawn
    assert page.count("<svg") == len(drawn)
    assert all((out / f"figures/{name}.png").stat().st_size > 1000 for name in drawn)
    assert_sound(page)
    assert "src=" not in page
    assert not list(out.rglob("*.part"))


def write_diagnosis(diagnosis, folder):
    """Write all files of a diagnosis, and return the content of diagnosis.json."""
    folder.mkdir(exist_ok=True)
    result = Diagnosis(diagnosis)
    result.write(folder, folder)
    return result.content


def told(diagnosis, folder):
    """The content of diagnosis.json, which fits its model, and the text of the page."""
    content = write_diagnosis(diagnosis, folder)
    assert_consistent(content)
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert_sound(page)
    return content, text_of(page)


@pytest.mark.usefixtures("composed")
def test_a_narrowed_diagnosis_is_told_as_a_set(named, tmp_path):
    shapes = SessionFit.of(named.frame.solution).candidates
    thermal, drift = (shapes[name][0] for name in ("thermal_bias", "thermal_curve"))
    weighed = [
        explanation(name, np.log(p), best=best)
        for name, p, best in (
            ("thermal_bias", 0.55, (thermal,)),
            ("thermal_curve", 0.4, (drift,)),
            ("unknown", 0.05, ()),
        )
    ]
    posterior = Posterior.of(weighed)
    finding = Finding(
        "narrowed", named.final, Reason(), named.finding.chosen, posterior,
        statement_of(posterior.credible_set, named.problem.singles.cosine),
    )  # fmt: skip
    diagnosis = replace(
        otherwise(named, finding), confirmation=replace(named.confirmation, names=())
    )
    content, text = told(diagnosis, tmp_path)
    (part,) = content["certain"]
    assert part["names"] == ["thermal_bias", "thermal_curve"]
    assert part["posterior"] == pytest.approx(0.95)
    assert 0 < part["purity"] < 1
    for words in (
        "➜ NARROWED The model lacks an effect of temperature: thermal bias or thermal curve.",
        "Explanations, most probable first: thermal bias (0.55) and thermal curve (0.4);",
        "whether thermal bias or thermal curve is missing",
        "takes thermal bias, and its sigmas do not allow for the others",
    ):
        assert words in text, words
    assert yaml.safe_load((tmp_path / "model.yaml").read_text("utf-8"))["models"]


@pytest.mark.usefixtures("composed")
def test_what_is_certain_of_the_unknown_is_told_and_in_the_model(named, tmp_path):
    """With its parameters, as the headline, in the calibration; the verdict has no effects."""
    others = ("hysteresis", "settling", "saturation", "cubic_scale", "quadratic_scale")
    weighed = [explanation(f"thermal_bias+{name}", np.log(0.19)) for name in others]
    posterior = Posterior.of(weighed)
    finding = Finding(
        "unknown", named.final, Reason.of("not in the catalogue"), named.finding.chosen, posterior,
        statement_of(posterior.all, named.problem.singles.cosine),
    )  # fmt: skip
    diagnosis = otherwise(named, finding, next_positions=())
    content, text = told(diagnosis, tmp_path)
    (part,), (found,) = content["certain"], named.found
    assert part["names"] == ["thermal_bias"]
    assert part["spec"] == found.spec
    assert [(q["name"], q["value"]) for q in part["parameters"]] == [
        (q.name, q.value) for q in found.parameters
    ]
    assert content["effects"] == []
    assert "The model lacks thermal bias; what is missing beside it has no name here." in text
    assert "What of it is certain?" in text
    assert "The calibration takes thermal bias, which is certain." in text
    calibration = json.loads((tmp_path / "calibration.json").read_text(encoding="utf-8"))
    assert "b_T_x" in str(calibration["parameters"])


@pytest.mark.usefixtures("composed")
@pytest.mark.parametrize(("after", "better"), [(98.0, "base"), (82.5, "extended")])
def test_a_model_that_levels_worse_is_not_advised(named, tmp_path, after, better):
    """On the page and its commands, in the terminal, and in both files for programs."""
    diagnosis = otherwise(named, leveling=TiltErrors(0.01, 82.0 * MGON, after * MGON))
    content, page = told(diagnosis, tmp_path)
    assert content["gap"]["better_for_leveling"] == better
    calibration = json.loads((tmp_path / "calibration.json").read_text(encoding="utf-8"))
    advised = "keep the base model"
    for lines in ([page], verdict_lines(diagnosis), calibration["warnings"]):
        assert any(advised in line for line in lines) == (better == "base")
    assert ("accelstudy apply" in page) == (better == "extended")


def test_noise_alone_is_blamed_only_where_it_is_probable():
    """A test of the noise fails by a drift that does not count as one, and by large noise."""
    hold = {"temperature": (15, 40), "temperature_order": "random", "vibration": (0, 2)}
    drift = acs.simulate_campaign(
        scheme="fibonacci-36", order="random", seed=2, **hold, effects=("warm_up",)
    )
    problem = diagnose(drift, NINE).problem
    vars(problem)["p_value"] = 0.5
    noise = acs.simulate_campaign(
        scheme="fibonacci-36", **hold, noise_effects=("noise_level(kappa=4)",)
    )
    for found, sure in (
        (CampaignDiagnosis(problem, drift, decide(problem, drift), Confirmation()), False),
        (diagnose(noise, NINE), True),
    ):
        assert found.verdict == "noise_model"
        assert (found.found[0].posterior >= RULES.sure) == sure
        assert ("sensor model is adequate" in verdict_lines(found)[0]) == sure
        assert any("may be an effect" in line for line in verdict_lines(found)) != sure


def test_positions_say_what_was_held_out(written):
    out, content = written("named").folder, written("named").content
    positions = pd.read_parquet(out / "positions.parquet")
    held = positions["split"] == "held-out"
    assert positions.loc[held, "position"].tolist() == content["gap"]["held_out_positions"]
    assert {"residual_x_before_mps2", "residual_z_after_mps2", "temperature_degC"} <= set(positions)


@pytest.mark.usefixtures("composed")
def test_an_outlier_position_is_left_out(tmp_path):
    campaign = simulated("no_effect", tmp_path / "c")
    campaign = gross.bumped(campaign, 8, (0.05, -0.04, 0.06))
    diagnosis = diagnose(campaign, NINE)
    content = write_diagnosis(diagnosis, tmp_path / "out")
    (effect,) = content["effects"]
    assert (effect["name"], effect["position"]) == ("outlier_position", 8)
    positions = pd.read_parquet(tmp_path / "out/positions.parquet")
    assert positions.loc[positions["split"] == "left out", "position"].tolist() == [8]
    assert np.flatnonzero(positions["residual_x_after_mps2"].isna()).tolist() == [7]


def simulated_sessions(simulated, fitted, d, count=200):
    """Variances of unit weight and tilt errors of sessions, each drawn and calibrated."""
    p = simulated.parameters[: simulated.model.n_parameters]
    f_b = simulated.model.correct(d.campaign.forces, p, G, d.frame.hold)
    directions = -f_b / np.linalg.norm(f_b, axis=1, keepdims=True)
    ideal = session(simulated.model, p, directions, G, d.frame.hold)
    noise = Noise(d.campaign.sigma_force, d.campaign.header.sigma_angle)
    drawn = ideal.draw(noise, count, np.random.default_rng(1))
    initial = fitted.parameters[: fitted.model.n_parameters]
    result = calibrate(fitted.model, d.base.approach, replace(drawn, initial=initial))
    tilts, used = attitudes_in_use(d.frame.hold, G)
    own = result.parameters[:, : fitted.model.n_parameters]
    error = leveling_error(simulated.model, p, fitted.model, own, tilts, G, used)
    return result.variance_posteriori, np.sqrt(np.mean(error.per_replicate**2))


def test_simulations_find_what_is_said_of_them(named, written, tmp_path):
    """The base model's own, and those with the effect, calibrated without it and with it."""
    base, extended = named.base, named.final.solution
    low, high = named.fits[0].simulated
    tilt = named.leveling
    for simulated, fitted, expected in (
        (base, base, tilt.promised), (extended, base, tilt.before),
        (extended, extended, tilt.after),
    ):  # fmt: skip
        variances, rms = simulated_sessions(simulated, fitted, named)
        assert rms == pytest.approx(expected, rel=0.1)
        if simulated is fitted:
            assert 0.9 < np.mean((variances > low) & (variances < high)) < 0.99
    assert [one.measured for one in named.fits] == [*named.variances.values()]
    assert tilt.promised < 0.5 * tilt.before
    left = f"Tilt error left: {number(tilt.before / MGON)} mgon as it is"
    assert left in text_of(written("named").page)
    with angles_in("deg"), composed():
        document = write_diagnosis(named, tmp_path / "deg")
    assert document["gap"]["leveling_rms_mgon"]["before"] == pytest.approx(tilt.before / MGON)
    page = (tmp_path / "deg/report.html").read_text("utf-8").partition("90° = 100 gon")[2]
    assert f"Tilt error left: {number(0.9 * tilt.before / MGON)} mdeg" in page
    assert re.findall(r"(?:[^.\w]|m)gon", page) == []


@pytest.mark.usefixtures("composed")
def test_a_figure_that_fails_takes_nothing_with_it(written, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("accelstudy.diagnosis.report.figures.evidence_figure", lambda *_: 1 / 0)
    write_diagnosis(written("named").found, tmp_path)
    assert not list(tmp_path.rglob("*.part"))
    said = "The figure 'evidence' could not be drawn (ZeroDivisionError: division by zero)."
    assert capsys.readouterr().err == f"warning: {said}\n"
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert said in page.replace("&#x27;", "'")
    assert page.count("<svg") == 1
