"""What the documentation says of files is what studies, calibrations and batches write.

`make docs` checks the rest: links, anchors, and the files, commands and options that pages name.
"""

import inspect
import json
import re
from datetime import datetime
from importlib import import_module

import griffe
import numpy as np
from places import ROOT
from study_helpers import grid, make_study, run_study

import accelstudy
from accelstudy.approaches import get_approach
from accelstudy.campaign.batch.overview import CAMPAIGN_COLUMNS, PARAMETER_COLUMNS
from accelstudy.campaign.calibration.applying import calibration_of
from accelstudy.campaign.calibration.assessment import assess
from accelstudy.campaign.calibration.document import (
    assessed_positions,
    calibration_document,
    json_text,
    quality_document,
)
from accelstudy.campaign.calibration.export import export
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.of_type import TypeFile, TypicalParameter
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.epochs.history import compare, history_of
from accelstudy.epochs.output import comparison_document, history_document, history_table
from accelstudy.lots.calibrated import CalibratedLot
from accelstudy.lots.evidence import AnythingOdds, SensorEvidence
from accelstudy.lots.lot import Lot
from accelstudy.lots.mixture import Anything
from accelstudy.lots.output import lot_document
from accelstudy.lots.passes import Pass
from accelstudy.sensors.models import get_model
from accelstudy.study.sensitivity import sensitivity_table, shapley_table

SENSITIVITY = {"base_samples": 2, "resamples": 2, "roll_gon": 10, "pitch_gon": 0}
IN_ALL = {"schema_version", "verdict"}
"""Keys that the head of the page describes, for all files."""
PROVENANCE = {"config_hash": "0123456789abcdef", "seed": 1}


def described(page):
    """Keys or columns of each file of which a page of the reference has a table, in order."""
    files = {}
    text = (ROOT / f"docs/reference/{page}.md").read_text(encoding="utf-8")
    for section in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        cells = re.findall(r"^\| (`.+?`) \|", section, re.MULTILINE)
        names = re.findall("`([^`]+)`", " ".join(cells))
        if first := re.search("first columns are those of `(.+)` up to `(.+)`", section):
            shared = files[first[1]]
            names = [*shared[: shared.index(first[2]) + 1], *names]
        files[re.search("`([^`]+)`", section)[1]] = names
    return files


def test_each_column_of_a_study_is_described(tmp_path):
    said = described("tables")
    keys = {"grids": [grid(replicates=20)], "sensitivity": SENSITIVITY}
    written = run_study(tmp_path, **keys)
    study, summary = make_study(**keys), written["summary"]
    written["sensitivity"] = sensitivity_table(study, summary)
    written["shapley"] = shapley_table(study, summary, written["correlations"])
    for name, table in written.items():
        file = "estimates/*.parquet" if name == "estimates" else f"{name}.parquet"
        assert said[file] == list(table), name


def test_each_key_of_a_calibration_is_described():
    campaign, _ = simulate_campaign(CampaignSettings(scheme="fibonacci-12"))
    fit = fit_campaign(campaign, get_model("bias-scale"), get_approach("robot"))
    assessment = assess(fit)
    document = {**calibration_document(fit), "quality": quality_document(assessment)}
    one = calibration_of(json.loads(json_text(document)))
    history = history_of([one] * 3, [datetime(2025, month, 1) for month in (1, 2, 3)])
    written = {
        "calibration.json": set(_keys(document)),
        "comparison.json": set(_keys(comparison_document(compare(one, one), 1.0))),
        "history.json": set(_keys(history_document(history))),
        "history.parquet": set(history_table(history)),
        "lot.json": {*_keys(_lot()), "files"},
        "type.yaml": {
            *TypeFile.model_fields,
            *(f"parameters.{n}" for n in TypicalParameter.model_fields),
        },
        "positions.parquet": set(assessed_positions(assessment)),
        "campaigns.parquet": set(CAMPAIGN_COLUMNS),
        "parameters.parquet": set(PARAMETER_COLUMNS),
    }
    said = {name: set(columns) for name, columns in described("file-formats").items() if columns}
    assert {name: said[name] | IN_ALL for name in written} == {
        name: keys | IN_ALL for name, keys in written.items()
    }
    assert said.keys() - written == {"calibration.h", "calibration.params"}


def test_each_name_of_an_exported_calibration_is_described():
    settings = CampaignSettings(scheme="fibonacci-24", temperature=(10, 40), vibration=(0, 1))
    effects = ("thermal_bias(tau=60)", "thermal_curve", "vibration_rectification", "warm_up")
    model = get_model(f"bias-scale+{'+'.join(effects)}")
    fit = fit_campaign(simulate_campaign(settings)[0], model, get_approach("robot"))
    calibration = calibration_of(calibration_document(fit))
    code = export(calibration, "c").split("*/", 1)[1]
    (signature,) = re.findall(r"void (accel_calibrate\(.*\))", code)
    words = set(re.findall(r"\w+", signature)) - {"const", "3"}
    names = {word.removesuffix("_60") for word in words}
    lines = [line.split("\t") for line in export(calibration, "px4").splitlines() if line[0] != "#"]
    first = {re.sub(r"[YZ](?=OFF|SCALE)", "X", re.sub(r"_[12]$", "_0", line[2])) for line in lines}
    said = described("file-formats")
    assert set(said["calibration.h"]) == names
    assert set(said["calibration.params"]) == first


def _lot():
    """Content of lot.json, of sensors that lack the same."""
    name, anything = "thermal_bias", Anything()
    each = [SensorEvidence(c, 0.5, {name: 20.0}, {}, ((name,),), {}, 9, np.zeros(1)) for c in "abc"]
    odds = np.array([[20.0], *[[0.0]] * 1000])
    for _ in each:
        anything.add((name,), odds)
    one = Pass(tuple(each), anything, lambda i: AnythingOdds((name,), odds))
    model, effects = get_model("bias-scale"), tuple((found, None) for _, found in one.found)
    lot = Lot((one, one), model, effects)
    return lot_document(CalibratedLot(lot, model, [None] * 3, get_approach("robot"), {}))


def _keys(document):
    """Keys as the page has them: those of blocks that it takes apart stand behind a dot."""
    for key, value in document.items():
        if key != "quality":
            yield key
        listed = key in ("parameters", "effects") and isinstance(value[0], dict)
        inner = value[0] if listed else value
        if listed or key in ("affine", "quality"):
            yield from (f"{key}.{each}" for each in inner)


def test_the_reference_says_what_the_kinds_of_keywords_mean(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "docs/hooks")
    path = ROOT / "accelstudy/verbs/calibrations.py"
    module = griffe.visit("accelstudy.verbs.calibrations", path, path.read_text(encoding="utf-8"))
    import_module("meanings").Meanings().on_object(obj=module["diagnose"])
    said = module["diagnose"].docstring.value
    assert "\nmodel : str\n    A model: one that `accelstudy models` lists" in said
    assert said == inspect.getdoc(accelstudy.diagnose)
