"""Batches of campaigns: configuration, one bad campaign among good ones, public data, summary."""

import json
import re
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from calling import refused
from campaign_helpers import simulated_campaign
from log_helpers import session, write
from page_helpers import assert_sound, text_of
from places import ROOT
from snakemake_helpers import jobs, one_line, remains, run_workflow, snakemake

from accelstudy.basics.units import MGON
from accelstudy.campaign.batch.config import CampaignEntry, parse_batch
from accelstudy.campaign.batch.overview import (
    CAMPAIGN_COLUMNS,
    PARAMETER_COLUMNS,
    counts,
    summarise_campaigns,
)
from accelstudy.campaign.batch.run import run_task
from accelstudy.campaign.format import read_campaign, write_campaign
from accelstudy.campaign.importing.public import public_data
from accelstudy.files.reading import read_layer
from accelstudy.files.tables import read_origin, read_table

NINE = "bias-scale-nonorthogonality"
TRUTH = {"b_x": 0.05, "s_y": 3e-4, "alpha_zx": 7e-4}


run = partial(run_workflow, "campaigns")


def succeed(*arguments, **options):
    result = run(*arguments, **options)
    assert result.returncode == 0, result.stdout
    return result.stdout


def calibrated(text):
    """Campaigns that a run has calibrated."""
    return set(re.findall(r"^Job \d+: Calibrate (\S+)$", text, re.MULTILINE))


def task_of(**entry):
    """The one campaign of a batch."""
    (task,) = parse_batch({"batch": "b", "campaigns": [entry]}).tasks()
    return task


def summarised(folder, results, batch="b"):
    """Tables of campaigns and of parameters, and the page, of results in folders."""
    paths = [folder / name for name in ("c.parquet", "p.parquet", "overview.html")]
    summarise_campaigns(batch, results, *paths, {"config_hash": "0", "seed": None})
    return read_table(paths[0]), read_table(paths[1]), paths[2].read_text(encoding="utf-8")


def write_log(folder):
    """Path of a log of 14 holds."""
    folder.mkdir(exist_ok=True)
    return write(folder, session(holds=14, still=300, moving=100)[0])


BATCH = {
    "batch": "bench",
    "campaigns": [{"campaign": "campaigns/*", "approach": "gravity"},
                  {"campaign": "campaigns/aided"},  # takes the robot's angles, as it has them
                  {"campaign": "campaigns/aided", "name": "six", "model": "bias-scale",
                   "approach": "gravity", "gravity": {"value_mps2": 9.8}},
                  {"log": "log.parquet", "name": "session", "import": {"rate_hz": 100},
                   "gravity": {"value_mps2": 9.81}}],
}  # fmt: skip
NAMES = ["plain", "spoilt", "aided", "six", "session"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A finished batch: two good campaigns, one of which has a robot, a bad one, and a log."""
    folder = tmp_path_factory.mktemp("batch")
    for seed, name in enumerate(("plain", "aided", "spoilt"), start=1):
        write_campaign(simulated_campaign(TRUTH, seed=seed), folder / "campaigns" / name)
    table = folder / "campaigns" / "spoilt" / "positions.csv"
    lines = table.read_text(encoding="utf-8").splitlines()
    lines[5] = re.sub(r",[^,]+", ",x", lines[5], count=1)
    table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    write_log(folder)
    (folder / "printed.txt").write_text(succeed(folder, BATCH), encoding="utf-8")
    return folder


# --- a batch -------------------------------------------------------------------------------------


def test_a_bad_campaign_stops_no_other(made):
    results = made / "results" / "bench"
    table = read_table(results / "campaigns.parquet").set_index("campaign")
    assert table.index.tolist() == NAMES
    assert table["status"].tolist() == ["ok", "failed", "ok", "ok", "ok"]
    spoilt = table.loc["spoilt"]
    assert spoilt["error"].startswith("campaigns/spoilt/positions.csv: fx: position 5: ")
    assert np.isnan(spoilt["sigma0"])
    assert remains(made) == []
    printed = (made / "printed.txt").read_text(encoding="utf-8")
    one_line(printed, f"not calibrated: spoilt: {spoilt['error']}")
    one_line(printed, "4 of 5 campaigns calibrated: results/bench/overview.html")
    log = (results / "logs" / "campaigns" / "spoilt.log").read_text(encoding="utf-8")
    assert spoilt["error"] in log


def test_the_tables_have_what_each_calibration_says(made, monkeypatch):
    monkeypatch.chdir(made)  # where the pattern of folders is looked up
    results, tables = made / "results" / "bench", {}
    for name, columns in (("campaigns", CAMPAIGN_COLUMNS), ("parameters", PARAMETER_COLUMNS)):
        path = results / f"{name}.parquet"
        tables[name] = read_table(path).set_index("campaign")
        assert read_table(path).dtypes.astype(str).to_dict() == columns
        expected = parse_batch(read_layer(made / "tiny.yaml")).fingerprint
        assert read_origin(path)["config_hash"] == expected
    good = tables["campaigns"][lambda each: each["status"] == "ok"]
    assert good["model"].tolist() == [NINE, NINE, "bias-scale", NINE]
    assert good["approach"].tolist() == ["gravity", "robot", "gravity", "gravity"]
    assert good["kind"].tolist() == 3 * ["campaign"] + ["log"]
    assert good["redundancy"].tolist() == [15, 63, 18, 5]
    assert good["gravity_mps2"].tolist() == [9.80665, 9.80665, 9.8, 9.81]
    assert good["sigma_priori_mps2"].iloc[0] == 0.002
    assert good["held_out_roll_rad"].notna().tolist() == [False, True, False, False]
    for name, row in good.iterrows():
        path = results / "campaigns" / name / "calibration.json"
        content = json.loads(path.read_text(encoding="utf-8"))
        quality, test = content["quality"], content["quality"]["global_test"]
        assert row["sigma0"] ** 2 == pytest.approx(test["statistic"] / test["dof"])
        assert row["tilt_pitch_rad"] == pytest.approx(quality["tilt_rms_mgon"]["pitch"] * MGON)
        expected = {
            "accepted": test["accepted"], "verdict": quality["verdict"],
            "rms_norm_residual_mps2": content["rms_norm_residual_mps2"],
            "held_out_mps2": quality["held_out"]["rms_mps2"],
            "sigma_source": content["sigma_source"],
        }  # fmt: skip
        assert row[[*expected]].to_dict() == expected
        told = tables["parameters"].loc[name].set_index("parameter")
        values = {each["name"]: each["value"] for each in content["parameters"]}
        assert told["value"].to_dict() == values
        np.testing.assert_allclose(told["sigma_posteriori"] / told["sigma_priori"], row["sigma0"])
    assert told.loc[["b_x", "s_x", "alpha_zx"], "unit"].tolist() == ["m/s^2", "1", "rad"]


def test_the_overview(made):
    results = made / "results" / "bench"
    page = (results / "overview.html").read_text(encoding="utf-8")
    assert "5 campaigns: 4 calibrated" in page
    marks = (">spoilt<", ">plain<", ">aided<", ">six<", ">session<")  # failures first
    order = [page.index(mark) for mark in marks]
    assert order == sorted(order)
    links = re.findall(r'href="([^"]+)"', page)
    assert len(links) == 5  # four reports and one picture of a log
    for link in links:
        assert (results / link).is_file()
    assert "held out roll, pitch" in text_of(page)
    assert_sound(page)
    use = "accelstudy apply results/bench/campaigns/plain/calibration.json LOG "
    assert f"{use}--out results-bench-campaigns-plain-leveled.csv" in text_of(page)


def test_a_calibration_that_no_sensor_has_is_not_among_the_calibrated(made, tmp_path):
    """One of 103 400 mgon of tilt error was counted as calibrated."""
    folders = [tmp_path / name for name in ("plain", "spoilt", "aided")]
    for folder in folders:
        shutil.copytree(made / "results/bench/campaigns" / folder.name, folder)
    for folder, state in ((folders[0], "rejected"), (folders[2], "implausible")):
        path = folder / "calibration.json"
        content = json.loads(path.read_text(encoding="utf-8"))
        content["quality"] |= {"state": state, "verdict": f"Why it is {state}."}
        path.write_text(json.dumps(content), encoding="utf-8")
    table, _, page = summarised(tmp_path, folders, "doubt")
    assert counts(table) == "1 of 3 campaigns calibrated, 1 implausible"
    assert "3 campaigns: 1 calibrated, 1 implausible, 1 not calibrated." in text_of(page)
    before, after = page.split("<h2>Calibrated</h2>")
    assert "Why it is implausible." in before
    assert 'href="aided/report.html"' in before
    assert "aided" not in after
    assert "plain ✗ REJECTED" in text_of(after)
    assert "accelstudy diagnose campaigns/plain --model" in text_of(after)
    assert "--approach gravity --out campaigns-plain-diagnosis" in text_of(after)


# --- what runs again -----------------------------------------------------------------------------


def test_a_second_run_does_nothing(made):
    results = made / "results"
    before = {path: path.stat().st_mtime_ns for path in results.rglob("*")}
    assert "Nothing to be done" in succeed(made, BATCH)
    assert {path: path.stat().st_mtime_ns for path in results.rglob("*")} == before


@pytest.fixture(scope="module")
def changed(made, tmp_path_factory):
    """The batch, run again with one campaign mended and one spoilt."""
    folder = Path(shutil.copytree(made, tmp_path_factory.mktemp("changed") / "copy"))
    campaigns = folder / "campaigns"
    shutil.copyfile(campaigns / "plain/positions.csv", campaigns / "spoilt/positions.csv")
    (campaigns / "plain/campaign.yaml").unlink()
    return folder / "results" / "bench", succeed(folder, BATCH)


def test_only_what_changed_runs_again(changed, made):
    results, text = changed
    assert calibrated(text) == {"plain", "spoilt"}
    assert jobs(text) == {"calibrate": 2, "overview": 1}
    one_line(text, "4 of 5 campaigns calibrated")
    before, after = (
        read_table(folder / "campaigns.parquet").set_index("campaign")
        for folder in (made / "results/bench", results)
    )
    assert after.loc["spoilt", "sigma0"] == before.loc["plain", "sigma0"]

    # And so would one more, and a log that is calibrated otherwise.
    folder = results.parents[1]
    shutil.copytree(folder / "campaigns/spoilt", folder / "campaigns/another one")
    entries = [*BATCH["campaigns"][:3], {**BATCH["campaigns"][3], "model": "bias-scale"}]
    plan = succeed(folder, {**BATCH, "campaigns": entries}, "--dry-run")
    assert set(re.findall("Calibrate (\\S+)", plan)) == {"another-one", "session"}


def test_a_campaign_that_got_worse_leaves_nothing_old(changed):
    results, text = changed
    one_line(text, "not calibrated: plain: campaigns/plain/campaign.yaml: no such file")
    remaining = {path.name for path in (results / "campaigns/plain").iterdir()}
    assert remaining <= {"status.json", ".snakemake_timestamp"}


# --- configuration -------------------------------------------------------------------------------


def test_the_bundled_batch():
    batch = parse_batch(read_layer(ROOT / "config" / "campaigns.yaml"))
    sources = [task.source for task in batch.tasks()]
    assert set(sources) <= {*public_data()}
    assert len(set(sources)) >= 5
    assert parse_batch({"batch": "b", "campaigns": [{"campaign": "a"}]}).public_folder == (
        "resources/public"
    )


def test_settings_of_public_data_can_be_overlaid():
    entry = {"public": "mpu6050", "name": "slow", "import": {"threshold_mps2": 0.2}}
    task = task_of(**entry)
    assert (task.name, task.settings.name, task.settings.unit) == ("slow", "slow", "counts")
    assert task.settings.threshold_mps2 == 0.2
    assert CampaignEntry.model_validate(task.as_params()) == task


def test_a_job_leaves_to_the_format_of_a_log_what_nobody_said(tmp_path):
    """Axes of ROS were taken for frd, since the job had all settings as if they were given."""
    path = write_log(tmp_path / "log")
    names = {f"f{axis}": f"linear_acceleration.{axis}" for axis in "xyz"}
    pd.read_parquet(path).rename(columns=names).to_parquet(path)
    task = CampaignEntry.model_validate(
        task_of(log=str(path), **{"import": {"rate_hz": 100}}).as_params()
    )
    run_task(task, tmp_path / "out")
    assert read_campaign(tmp_path / "out/campaign").log.frame == "flu"


def test_patterns(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("b", "a", "c d"):
        (tmp_path / "all" / name).mkdir(parents=True)
    (tmp_path / "all" / "file.csv").touch()
    (tmp_path / "[1].csv").touch()
    content = {"batch": "b", "campaigns": [{"campaign": "all/*"}, {"campaign": "./all/a/"}]}
    tasks = parse_batch(content).tasks()
    assert [task.name for task in tasks] == ["b", "c-d", "a"]
    assert [task.source for task in tasks] == ["all/b", "all/c d", "all/a"]
    content["campaigns"] = [{"log": "all/*"}, {"log": "[1].csv", "name": "one"}]
    assert [task.source for task in parse_batch(content).tasks()] == ["all/file.csv", "[1].csv"]


@pytest.mark.parametrize(("change", "message"), [
    ({"campaigns": []}, "campaigns: must not be empty, not []"),
    ({"campaigns": [{}]}, "campaigns.0: give exactly one of campaign, log, public"),
    ({"campaigns": [{"campaign": "a", "import": {}}]}, "campaigns.0: import: goes with log"),
    ({"campaigns": [{"log": "a", "import": {"rate": 100}}]},
     "campaigns.0.import.rate: unknown key; did you mean 'rate_hz'?"),
    ({"campaigns": [{"public": "xsens"}]}, "campaigns.0: unknown public data 'xsens'; did you"),
    ({"campaigns": [{"public": "ferraris-sections"}]}, "hold no forces"),
    ({"campaigns": [{"log": "a", "model": "six"}]}, "campaigns.0.model: unknown model 'six'"),
    ({"approach": "gravty"}, "unknown approach 'gravty'; did you mean 'gravity'?"),
    ({"campaigns": [{"campaign": "no/*"}]}, "campaigns.0: no folder matches no/*"),
    ({"campaigns": [{"campaign": "x/a"}, {"log": "y/a.csv"}]},
     "campaigns: x/a and y/a.csv are both named 'a'; give one another `name`"),
])  # fmt: skip
def test_one_line_for_a_wrong_key(change, message):
    content = {"batch": "b", "campaigns": [{"campaign": "a"}], **change}
    with refused(message, start="batch.yaml: "):
        parse_batch(content, "batch.yaml")


def test_the_workflow_says_it(tmp_path):
    without = snakemake(tmp_path, "--snakefile", ROOT / "workflow/campaigns.smk", "--cores", 1)
    wrong = run(tmp_path, {"batch": "b", "campaigns": [{"campain": "a"}]})
    for result, said in (
        (without, "no campaigns; name them with --configfile"),
        (wrong, "tiny.yaml: campaigns.0.campain: unknown key; did you mean 'campaign'"),
    ):
        assert result.returncode != 0
        assert "Traceback" not in result.stdout
        one_line(result.stdout, said)
    assert not (tmp_path / "results").exists()


# --- without Snakemake ---------------------------------------------------------------------------


def test_where_all_failed_the_page_says_why(tmp_path):
    """What a page shows is escaped."""
    task = task_of(campaign=str(tmp_path / "<i>&"))
    assert task.name == "i-"
    assert "no such folder" in run_task(task, tmp_path / "out")
    campaigns, parameters, page = summarised(tmp_path, [tmp_path / "out"])
    assert campaigns.dtypes.astype(str).to_dict() == CAMPAIGN_COLUMNS
    assert parameters.empty
    assert "Calibrated" not in page
    assert "<i>" not in page
    assert "&lt;i&gt;&amp;: no such folder" in page


def test_an_error_that_nobody_has_foreseen_stops_no_other(tmp_path, monkeypatch):
    """Nor what was written before it, half a calibration, is left."""
    write_campaign(simulated_campaign({"b_x": 0.05}), tmp_path / "campaign")
    task = task_of(campaign=str(tmp_path / "campaign"))

    def broken(calibration, folder, place):
        (folder / "report.html").write_text("half")
        (folder / "figures").mkdir()
        raise ZeroDivisionError("a\nb")

    monkeypatch.setattr("accelstudy.campaign.batch.run.Calibration.write", broken)
    error = run_task(task, tmp_path / "out", log="results/b/logs/campaigns/campaign.log")
    assert error == (
        "internal error, please report it (ZeroDivisionError: a b); the log has the details: "
        "results/b/logs/campaigns/campaign.log"
    )
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["status.json"]
    status = json.loads((tmp_path / "out/status.json").read_text(encoding="utf-8"))
    assert (status["status"], status["error"]) == ("failed", error)
