"""The study of hidden effects: its configuration, its cells and seeds, and its jobs."""

import numpy as np
import pytest
from calling import refused
from places import ROOT

from accelstudy.basics.errors import InputError
from accelstudy.effects import effect_names, effects_without
from accelstudy.files.reading import overlay, read_layer
from accelstudy.files.tables import read_table
from studies.hidden import campaigns, diagnosing
from studies.hidden.baselines import METHODS, run_baselines
from studies.hidden.campaigns import KEY
from studies.hidden.cells import Cell, chunks, number_of_chunks, planned, study_cells, write_plan
from studies.hidden.config import KINDS, parse_hidden
from studies.hidden.diagnosing import run_chunk
from studies.hidden.physics.generate import Case

TINY = {
    "study": "tiny",
    "seed": 3,
    "designs": ["spread-24", "snub-24"],
    "sigma": "given",
    "baselines_every": 1,
    "one": {"kinds": ["hysteresis"], "sizes": [100], "campaigns": 2},
    "removed": {"kinds": ["bias_drift"], "sizes": [400], "campaigns": 1},
}
PROVENANCE = {"config_hash": "0", "seed": 3}


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    """Configuration and campaigns of the tiny study."""
    path, config = tmp_path_factory.mktemp("plan") / "plan.json", parse_hidden(TINY)
    write_plan(config, path)
    return config, list(planned(path, 0))


def paths(folder):
    return {name: folder / f"{name}.parquet" for name in ("truths", "outcomes", "seconds")}


# --- the configuration ---------------------------------------------------------------------------


WRONG = [
    (
        {"nothing": {"campaigns": 1, "campaign": 3}},
        "nothing.campaign: unknown key; did you mean 'campaigns'?",
    ),
    ({"designs": "spread-25"}, "designs: unknown design 'spread-25'; did you mean 'spread-24'?"),
    ({"approaches": ["robots"]}, "approaches: unknown approach 'robots'; did you mean 'robot'?"),
    ({"one": {"kinds": ["warmup"], "sizes": [25], "campaigns": 1}}, "one.kinds: unknown kind"),
    ({"one": {"sizes": [-1], "campaigns": 1}}, "one.sizes.0: must be greater than 0"),
    ({"one": {"sizes": [25], "campaigns": 0}}, "one.campaigns: must be from 1 to"),
    ({"sigma": "known"}, "sigma: must be 'given' or 'not given', not 'known'"),
    ({"model": "nine"}, "model: unknown model 'nine'"),
    ({"one": None, "removed": None}, "no campaigns; give at least one of nothing, two"),
]


@pytest.mark.parametrize(("change", "said"), WRONG)
def test_a_wrong_key_is_one_line(change, said):
    with refused(start=f"my.yaml: {said}"):
        parse_hidden({**TINY, **change}, "my.yaml")


def test_a_kind_that_no_session_can_show():
    config = parse_hidden(overlay(TINY, {"one": {"kinds": ["thermal_bias"]}, "designs": "snub-24"}))
    with pytest.raises(
        InputError, match=r"one\.kinds: no session of the study can show thermal_bias"
    ):
        study_cells(config)


def test_the_full_study():
    """What the study promises: enough campaigns of each kind, in enough designs."""
    content = read_layer(ROOT / "studies/hidden/config/hidden-effects.yaml")
    config = parse_hidden(
        {**content, "outside": None, "unforeseen": None, "two": None}
    )  # to plan them takes long
    cells = study_cells(config)
    null = [cell for cell in cells if cell.case.set == "null"]
    assert sum(cell.count for cell in null) >= 12000
    assert len({cell.case.design for cell in null}) >= 8
    assert len(null) == len(config.places)
    counts = {}
    for cell in cells:
        if cell.case.set == "one":
            key = cell.what, cell.size
            counts[key] = counts.get(key, 0) + cell.count
    assert set(counts.values()) == {30}
    assert {size for _, size in counts} == {6, 10.5, 16, 25, 40, 60, 100, 400}
    # Those that have a formula of their own for this study; gravity_error is invisible everywhere.
    visible = {*KINDS["one"][0]} - {"gravity_error"}
    assert len(visible) >= 23
    assert {what for what, _ in counts} >= visible
    assert len({cell.name for cell in cells}) == len(cells)


def test_the_small_study_overlays_the_full_one():
    content = overlay(
        read_layer(ROOT / "studies/hidden/config/hidden-effects.yaml"),
        read_layer(ROOT / "studies/hidden/config/hidden-smoke.yaml"),
    )
    config = parse_hidden(content)
    assert config.campaigns < 40
    assert number_of_chunks(config) == 1


# --- cells and seeds -----------------------------------------------------------------------------


def entropy(cells):
    return {
        (cell.name, k): tuple(cell.seed(3, k).generate_state(4))
        for cell in cells
        for k in range(cell.count)
    }


def test_a_further_cell_and_further_campaigns_change_no_seed():
    before = entropy(study_cells(parse_hidden(TINY)))
    more = overlay(TINY, {"one": {"kinds": ["hysteresis", "settling"], "campaigns": 20},
                          "nothing": {"campaigns": 4}})  # fmt: skip
    after = entropy(study_cells(parse_hidden(more)))
    assert before.items() <= after.items()
    assert len(set(after.values())) == len(after) > len(before)


def test_chunks_hold_each_campaign_once():
    content = overlay(TINY, {"nothing": {"campaigns": 30}})
    cells = study_cells(parse_hidden(content))
    whole = {(cell.name, k) for cell in cells for k in range(cell.count)}
    for number in (1, 2, 7):
        parts = chunks(cells, number)
        got = [
            (Cell(Case(**case)).name, k)
            for part in parts
            for case, first, stop in part
            for k in range(first, stop)
        ]
        assert len(got) == len(whole)
        assert set(got) == whole
        sizes = [sum(stop - first for _, first, stop in part) for part in parts]
        assert max(sizes) - min(sizes) <= 1


def test_two_effects_mean_different_things():
    config = parse_hidden({"study": "t", "seed": 1, "designs": "snub-24", "approaches": "robot",
                           "two": {"sizes": 40, "campaigns": 300}})  # fmt: skip
    pairs = {frozenset(cell.case.effect) for cell in study_cells(config)}
    assert len(pairs) > 50
    assert frozenset(["cross_axis_misalignment", "mounting_rotation"]) not in pairs


def test_a_family_that_is_taken_out():
    cell = Cell(Case("removed", "spread-24", "robot", True, ("bias_drift",), (100.0,)), 1)
    assert {"bias_drift", "warm_up"} <= set(cell.removed)
    with effects_without(cell.removed):
        assert not {"bias_drift", "warm_up"} & set(effect_names())
    assert {"bias_drift", "warm_up"} <= set(effect_names())


# --- jobs ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def whole(plan, tmp_path_factory):
    """The tiny study in one chunk."""
    folder = tmp_path_factory.mktemp("whole")
    run_chunk(*plan, paths(folder), PROVENANCE)
    return folder


def test_truths_and_outcomes(whole):
    truths, outcomes, seconds = (read_table(path) for path in paths(whole).values())
    assert len(truths) == 3
    pd_keys = [table[KEY].to_numpy().tolist() for table in (truths, outcomes, seconds)]
    assert pd_keys[0] == pd_keys[1] == pd_keys[2]
    assert set(outcomes["error"]) == {""}
    one = outcomes[truths["set"] == "one"]
    assert one["verdict"].tolist() == ["named", "named"]
    assert one["found"].tolist() == ['["hysteresis"]'] * 2
    (removed,) = outcomes[truths["set"] == "removed"].to_dict("records")
    assert "bias_drift" not in removed["found"] + removed["credible_set"]
    assert (seconds["seconds"] > 0).all()


def test_a_second_run_gives_the_same_bytes(plan, whole, tmp_path):
    """As a study that was broken off and goes on; only the times differ."""
    run_chunk(*plan, paths(tmp_path), PROVENANCE)
    for name in ("truths", "outcomes"):
        assert paths(tmp_path)[name].read_bytes() == paths(whole)[name].read_bytes()


def test_the_diagnosis_sees_the_campaign_only(plan, whole, monkeypatch, tmp_path):
    seen = []
    monkeypatch.setattr(diagnosing, "judge", lambda *given, **more: seen.append((given, more)))
    run_chunk(*plan, paths(tmp_path), PROVENANCE)
    truths = read_table(paths(whole)["truths"])
    for (campaign, _), more in seen:
        assert list(more) == ["seed"]
        for word in ("hysteresis", "bias_drift", "removed"):
            assert word not in repr(campaign)
    assert len(seen) == len(truths)


def test_what_fails_is_a_row_with_its_error(plan, monkeypatch, tmp_path):
    def refuse(campaign, *_, **__):
        raise InputError("too few positions") if campaign.angles is None else KeyError("x")

    monkeypatch.setattr(diagnosing, "judge", refuse)
    run_chunk(*plan, paths(tmp_path), PROVENANCE)
    outcomes = read_table(paths(tmp_path)["outcomes"])
    assert len(outcomes) == 3
    assert set(outcomes["error"]) <= {"refused: too few positions", "KeyError: 'x'"}
    assert (outcomes["error"] != "").all()


def test_what_cannot_be_made_is_a_row_with_its_error(plan, monkeypatch, tmp_path):
    def refuse(case, seed):
        raise InputError("cannot see it")

    monkeypatch.setattr(campaigns, "generate", refuse)
    run_chunk(*plan, paths(tmp_path), PROVENANCE)
    run_baselines(*plan, tmp_path / "baselines.parquet", PROVENANCE)
    answers = read_table(tmp_path / "baselines.parquet")
    assert len(answers) == 3 * len(METHODS)
    assert not answers["detected"].any()
    assert set(answers["error"]) == {"refused: cannot see it"}
    truths, outcomes, _ = (read_table(path) for path in paths(tmp_path).values())
    assert outcomes["error"].tolist() == ["refused: cannot see it"] * 3
    assert truths["what"].tolist().count("hysteresis") == 2


def test_simpler_methods(plan, tmp_path):
    config, campaigns = plan
    path = tmp_path / "baselines.parquet"
    one = [(cell, k) for cell, k in campaigns if cell.case.set == "one"]
    run_baselines(config, one[:1], path, PROVENANCE)
    table = read_table(path).set_index("method")
    assert set(table.index) == {"chi2 omnibus", "known sigma", "F test", "BIC forward", "lasso"}
    assert table["detected"].all()  # λ = 100 is plain to all of them
    named = table["found"].drop("chi2 omnibus")
    assert named.str.startswith('["hysteresis"').all()


def test_seeds_depend_on_the_seed_of_the_study():
    cell = Cell(Case("null", "snub-24", "robot", True), 2)
    states = [cell.seed(s, k).generate_state(2) for s in (1, 2) for k in (0, 1)]
    assert len(np.unique(states, axis=0)) == 4
