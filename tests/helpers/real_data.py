"""Diagnoses of public measurements, and what the page about them says of each."""

from dataclasses import replace
from functools import cache

import numpy as np
from places import DATA

from accelstudy.basics.wording import number, probability, words
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.public import import_settings, public_file
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.words import verdict_lines
from accelstudy.diagnosis.result import Diagnosis
from accelstudy.sensors.models import get_model

NINE = get_model("bias-scale-nonorthogonality")
WHITE, UNKNOWN = "white", "not given"
DIAGNOSED = [
    ("ck-explorer", ""),
    *((f"mpu9150-{i}", "") for i in range(3)),
    *(("xsens-mti", sigma) for sigma in ("", WHITE, UNKNOWN)),
    *((f"innalabs-{n}", "") for n in (24, 31, 49)),
    ("mpu6050", ""),
]
LONGEST = "lis3dh-phone"


@cache
def imported(name):
    return import_log(public_file(name, DATA), import_settings(name))[0]


@cache
def diagnosed(name: str, sigma: str = "") -> Diagnosis:
    campaign = imported(name)
    if sigma == WHITE:
        campaign = replace(campaign, sigma_force=0.000296, sigma_dof=None)
    elif sigma == UNKNOWN:
        campaign = replace(campaign, sigma_force=None, sigma_dof=None)
    return diagnose(campaign, NINE)


def told(name, variant=""):
    """The line of a diagnosis in the table of the page, and the lines of its verdict."""
    d = diagnosed(name, variant)
    sigma = d.campaign.sigma_force
    shown = "" if sigma is None else number(1e3 * float(np.mean(sigma)))
    given = f"{shown}, {variant or 'Allan'}" if shown else UNKNOWN
    size = probability(None if d.global_test is None else d.global_test.p_value)
    pattern = probability(d.detection.p_value if d.detection.p_family else None)
    verdict = f"`{d.verdict}`" + "".join(f": {words(f.name)}" for f in d.found)
    cells = (f"`{name}`", d.campaign.n_positions, d.base.redundancy, given, size, pattern, verdict)
    return [f"| {' | '.join(map(str, cells))} |", *verdict_lines(d)[:-1]]
