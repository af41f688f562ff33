"""The study of hidden effects: its configuration, its campaigns and seeds, and its jobs."""

import pytest

from accelstudy.basics.errors import InputError
from accelstudy.effects import effect_names, effects_without
from accelstudy.files.reading import overlay
from studies.hidden import campaigns, study
from studies.hidden.baselines import METHODS
from studies.hidden.campaigns import parse_hidden, read_rows, row_of, run
from studies.hidden.physics.generate import Case
from studies.hidden.study import removed

TINY = {
    "study": "tiny",
    "seed": 3,
    "designs": ["spread-24", "snub-24"],
    "sigma": "given",
    "baselines_every": 1,
    "one": {"kinds": ["hysteresis"], "sizes": [100], "campaigns": 2},
    "removed": {"kinds": ["bias_drift"], "sizes": [400], "campaigns": 1},
}
CONFIG = parse_hidden(TINY)


QUIET = CONFIG.model_copy(update={"baselines_every": 0})


# --- the configuration ---------------------------------------------------------------------------


def test_a_kind_that_no_session_can_show():
    config = parse_hidden(overlay(TINY, {"one": {"kinds": ["thermal_bias"]}, "designs": "snub-24"}))
    with pytest.raises(
        InputError, match=r"one\.kinds: no session of the study can show thermal_bias"
    ):
        config.campaigns()


# --- campaigns and seeds --------------------------------------------------------------------------


def seeds(content, seed=3):
    campaigns = parse_hidden(content).campaigns()
    return {(case.name, k): tuple(case.seed(seed, k).generate_state(4)) for case, k in campaigns}


def test_a_further_kind_and_further_campaigns_change_no_seed():
    before = seeds(TINY)
    after = seeds(overlay(TINY, {"one": {"kinds": ["hysteresis", "settling"], "campaigns": 20},
                                 "nothing": {"campaigns": 4}}))  # fmt: skip
    assert before.items() <= after.items()
    assert len(set(after.values())) == len(after) > len(before)
    assert not {*before.values()} & {*seeds(TINY, 4).values()}


def test_a_family_that_is_taken_out():
    case = Case("removed", "spread-24", "robot", True, ("bias_drift",), (100.0,))
    assert {"bias_drift", "warm_up"} <= set(removed(case))
    with effects_without(removed(case)):
        assert not {"bias_drift", "warm_up"} & set(effect_names())
    assert {"bias_drift", "warm_up"} <= set(effect_names())


# --- jobs ----------------------------------------------------------------------------------------


def rows(config):
    """Truths and answers of the campaigns of a study."""
    return [row_of(config, case, k) for case, k in config.job("0000")]


@pytest.fixture(scope="module")
def told():
    return rows(CONFIG)


def test_truths_and_answers(told):
    assert [row["error"] for row in told] == [""] * 3
    *one, removed = sorted(told, key=lambda row: row["set"])
    assert [row["verdict"] for row in one] == ["named"] * 2
    assert [row["found"] for row in one] == [["hysteresis"]] * 2
    assert "bias_drift" not in str([removed["found"], removed["credible_set"]])


def test_a_second_run_writes_the_same(told, tmp_path, monkeypatch):
    """As a study that was broken off and goes on."""
    monkeypatch.setattr(study, "JOB", 1)
    run(CONFIG, "0000", tmp_path / "campaigns.jsonl")
    assert repr(read_rows([tmp_path / "campaigns.jsonl"])) == repr(told[:1])


def test_the_diagnosis_sees_the_campaign_only(monkeypatch):
    seen = []
    monkeypatch.setattr(campaigns, "diagnose", lambda *given, **more: seen.append((given, more)))
    rows(QUIET)
    for (campaign, _), more in seen:
        assert list(more) == ["seed"]
        for word in ("hysteresis", "bias_drift", "removed"):
            assert word not in repr(campaign)
    assert len(seen) == 3


def test_what_fails_or_cannot_be_made_is_a_row_with_its_error(monkeypatch):
    def refuse(campaign, *_, **__):
        raise InputError("too few positions") if campaign.angles is None else KeyError("x")

    monkeypatch.setattr(campaigns, "diagnose", refuse)
    errors = [row["error"] for row in rows(QUIET)]
    assert len(errors) == 3
    assert set(errors) <= {"refused: too few positions", "KeyError: 'x'"}

    def blind(case, seed):
        raise InputError("cannot see it")

    monkeypatch.setattr(study, "generate", blind)
    failed = rows(CONFIG)
    assert [row["error"] for row in failed] == ["refused: cannot see it"] * 3
    assert [row["what"] for row in failed].count("hysteresis") == 2
    assert all(row["methods"] == {key: [False, []] for key in METHODS} for row in failed)


def test_simpler_methods(told):
    """λ = 100 is plain to all of them."""
    (methods, *_) = [row["methods"] for row in told if row["set"] == "one"]
    assert set(methods) == {*METHODS}
    assert all(detected for detected, _ in methods.values())
    assert methods["chi2 omnibus"][1] == []
    named = [names[0] for name, (_, names) in methods.items() if name != "chi2 omnibus"]
    assert named == ["hysteresis"] * 4
