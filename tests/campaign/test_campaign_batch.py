"""Batches of campaigns: one bad campaign among good ones, the tables, the overview."""

import json
import re

import numpy as np
import pandas as pd
import pytest
from calling import succeed
from campaign_helpers import simulated_campaign
from page_helpers import assert_sound, text_of

import accelstudy as acs
from accelstudy.campaign.batch import COLUMNS, PARAMETERS
from accelstudy.campaign.format import write_campaign

NINE = "bias-scale-nonorthogonality"
TRUTH = {"b_x": 0.05, "s_y": 3e-4, "alpha_zx": 7e-4}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A batch: two good campaigns, one of which has a robot, a bad one, one in a wrong unit."""
    folder = tmp_path_factory.mktemp("batch")
    for seed, name in enumerate(("plain", "aided", "spoilt", "wrong"), start=1):
        write_campaign(simulated_campaign(TRUTH, seed=seed), folder / "campaigns" / name)
    spoilt = folder / "campaigns/spoilt/positions.csv"
    lines = spoilt.read_text(encoding="utf-8").splitlines()
    lines[5] = re.sub(r",[^,]+", ",x", lines[5], count=1)
    spoilt.write_text("\n".join(lines) + "\n", encoding="utf-8")
    wrong = pd.read_csv(folder / "campaigns/wrong/positions.csv")
    wrong.loc[[3, 8], ["fx", "fy", "fz"]] = wrong.loc[[8, 3], ["fx", "fy", "fz"]].to_numpy()
    wrong.to_csv(folder / "campaigns/wrong/positions.csv", index=False)
    pattern, out = folder / "campaigns/*", folder / "out"
    said = succeed("batch", pattern, "--approach", "robot", "--out", out)
    return folder, said


def test_a_bad_campaign_stops_no_other(made):
    folder, said = made
    table = pd.read_parquet(folder / "out/campaigns.parquet").set_index("campaign")
    assert [*table.index] == ["aided", "plain", "spoilt", "wrong"]
    assert [*table["state"]] == ["accepted", "accepted", "not calibrated", "implausible"]
    error = table.loc["spoilt", "error"]
    assert "spoilt/positions.csv: fx: position 5: " in error
    assert f"warning: not calibrated: spoilt: {error}\n" in said.stderr
    assert "2 of 4 campaigns calibrated, 1 implausible\n" in said.stdout
    assert {path.name for path in (folder / "out/each").iterdir()} == {"aided", "plain", "wrong"}


def test_the_tables_have_what_each_calibration_says(made):
    folder, _ = made
    campaigns = pd.read_parquet(folder / "out/campaigns.parquet").set_index("campaign")
    parameters = pd.read_parquet(folder / "out/parameters.parquet").set_index("campaign")
    assert ["campaign", *campaigns] == [*COLUMNS]
    assert ["campaign", *parameters] == ["campaign", "parameter", *PARAMETERS]
    for name in ("aided", "plain"):
        row, told = campaigns.loc[name], parameters.loc[name].set_index("parameter")
        content = json.loads((folder / f"out/each/{name}/calibration.json").read_text("utf-8"))
        quality = content["quality"]
        assert (row["model"], row["approach"], row["redundancy"]) == (NINE, "robot", 63)
        assert row["tilt_pitch_mgon"] == quality["tilt_rms_mgon"]["pitch"]
        assert row["held_out_roll_mgon"] == quality["held_out"]["rms_roll_mgon"]
        test = quality["global_test"]
        ratio = row["sigma_posteriori_mps2"] / row["sigma_priori_mps2"]
        assert ratio**2 == pytest.approx(test["statistic"] / test["dof"])
        assert told["value"].to_dict() == {p["name"]: p["value"] for p in content["parameters"]}
        np.testing.assert_allclose(told["sigma_posteriori"] / told["sigma_priori"], ratio)
        assert told.loc[["b_x", "s_x"], "unit"].tolist() == ["m/s^2", "1"]


def test_the_overview(made):
    """A calibration of 103 400 mgon of tilt error was counted as calibrated."""
    folder, _ = made
    page = (folder / "out/report.html").read_text(encoding="utf-8")
    places = [page.index(f">{name}<") for name in ("spoilt", "wrong", "aided", "plain")]
    assert places == sorted(places)
    links = re.findall(r'href="([^"]+)"', page)
    assert len(links) == 3
    assert all((folder / "out" / link).is_file() for link in links)
    assert "tilt error left in roll / pitch" in text_of(page)
    assert f"accelstudy apply {folder}/out/each/aided/calibration.json LOG " in text_of(page)
    assert f"accelstudy diagnose {folder}/campaigns/wrong --model" in text_of(page)
    assert_sound(page)


def test_a_batch_in_python(made):
    folder, _ = made
    other = simulated_campaign(TRUTH, seed=9).with_header(name="plain")
    batch = acs.batch([folder / "campaigns/plain", other])
    assert (batch.state, [*batch.calibrations]) == ("accepted", ["plain-1", "plain-2"])
    assert batch.verdict == "2 of 2 campaigns calibrated"
    assert batch.to_frame()["sigma_source"].tolist() == ["a priori"] * 2
    assert len(batch.parameters) == 18
    batch.plot()


def test_what_a_page_shows_is_escaped(made, tmp_path):
    folder, _ = made
    batch = acs.batch([folder / "campaigns/plain", str(tmp_path / "<i>&")])
    batch.save(tmp_path / "out")
    page = (tmp_path / "out/report.html").read_text(encoding="utf-8")
    assert (batch.state, [*batch.failed]) == ("not calibrated", ["i-"])
    assert "<i>" not in page
    assert "&lt;i&gt;&amp;: no such folder" in page
