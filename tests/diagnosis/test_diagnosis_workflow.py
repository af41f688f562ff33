"""The workflow of a diagnosis: all is made, once, and what cannot be used is said in a line."""

import json
import shutil
from functools import partial
from pathlib import Path

import pytest
import yaml
from snakemake_helpers import ENVIRONMENT, jobs, one_line, remains, run_workflow

TINY = {
    "campaign": {
        "name": "tiny",
        "seed": 7,
        "scheme": "fibonacci-18",
        "order": "random",
        "effects": ["thermal_bias: 0.003, -0.002, 0.001"],
        "temperature": [20, 40],
        "temperature_order": "ABBA",
    },
}


run = partial(run_workflow, "diagnose")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("diagnosed")
    result = run(folder, TINY)
    assert result.returncode == 0, result.stdout
    return folder


def test_all_is_made(made):
    results = made / "results" / "tiny"
    diagnosis = results / "diagnosis"
    document = json.loads((diagnosis / "diagnosis.json").read_text(encoding="utf-8"))
    assert document["verdict"] == "named"
    assert document["effects"][0]["name"] == "thermal_bias"
    files = {path.name for path in diagnosis.iterdir() if not path.name.startswith(".")}
    assert files == {
        "calibration.json", "diagnosis.json", "report.html", "model.yaml", "positions.parquet",
        "figures",
    }  # fmt: skip
    for name in ("evidence", "gap", "location", "residuals"):
        assert (diagnosis / "figures" / f"{name}.svg").stat().st_size > 1000
        assert (diagnosis / "figures" / f"{name}.png").stat().st_size > 1000
    assert {path.name for path in (results / "campaign").iterdir()} >= {
        "campaign.yaml", "positions.csv",
    }  # fmt: skip
    truth = yaml.safe_load((results / "truth.yaml").read_text(encoding="utf-8"))
    assert truth["effects"][0]["name"] == "thermal_bias"
    log = (results / "logs" / "diagnose.log").read_text(encoding="utf-8")
    # With two temperatures a curve would be the same.
    assert "The model lacks thermal bias or thermal curve." in log
    assert remains(made) == []


def test_only_another_unit_of_angles_makes_the_page_again(made, monkeypatch):
    assert jobs(run(made, TINY, "--dry-run").stdout) == {}
    monkeypatch.setitem(ENVIRONMENT, "ACCELSTUDY_ANGLE_UNIT", "deg")
    assert jobs(run(made, TINY, "--dry-run").stdout) == {"diagnose": 1}


def test_a_campaign_that_is_too_small(made, tmp_path):
    """For the model, so that the campaign that is there is diagnosed again, and that fails."""
    folder = Path(shutil.copytree(made, tmp_path / "copy"))
    shutil.rmtree(folder / "results/tiny/diagnosis")
    model = "bias+scale+nonorthogonality+cross_coupling+cubic_scale"
    result = run(folder, {**TINY, "model": model, "approach": "gravity"})
    assert result.returncode != 0
    assert "Traceback" not in result.stdout
    assert "Simulate" not in result.stdout
    one_line(result.stdout, "error: tiny: 18 positions leave no redundancy", "more positions")
    assert not (folder / "results/tiny/diagnosis").exists()
    assert remains(folder) == []
