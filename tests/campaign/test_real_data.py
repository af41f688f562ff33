"""The page about public measurements says what a diagnosis of them says."""

import re

import numpy as np
import pytest
from golden import kept_of
from places import DATA, ROOT, needs_data
from real_data import DIAGNOSED, LONGEST, WHITE, diagnosed, imported, told
from scipy import optimize

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import shown_unit
from accelstudy.basics.wording import amount, number, words
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.public import import_settings, public_data, public_file
from accelstudy.effects import get_effect
from accelstudy.sensors.models import get_model

PAGE = (ROOT / "docs/guides/real-data.md").read_text(encoding="utf-8")
FLAT = " ".join(PAGE.split())
NINE = get_model("bias-scale-nonorthogonality")

pytestmark = needs_data

QUOTED = [("ck-explorer", ""), ("xsens-mti", WHITE)]
"""Diagnoses whose sentences stand on the page; of the others there is the row of the table."""
TOO_SMALL = ["mpu6050-static", "ferraris", "ferraris-annotated"]


def limit_rows():
    """The table of upper limits: largest typical size, Xsens, and worst of the MPU-9150."""
    sensors = ["xsens-mti"], [f"mpu9150-{i}" for i in range(3)]
    limits = [
        [{limit.name: limit.value for limit in diagnosed(name).upper_limits} for name in names]
        for names in sensors
    ]
    for effect in limits[0][0]:
        known = get_effect(effect)
        unit = known.parameters[0].unit
        values = max(known.typical), *(max(one[effect] for one in ones) for ones in limits)
        shown = [f"{amount(value, unit)} {shown_unit(unit)}" for value in values]
        yield f"| {words(effect)} | {' | '.join(shown)} |"


@pytest.mark.parametrize(("name", "variant"), DIAGNOSED)
def test_the_table_tells_the_diagnosis(name, variant):
    row, *lines = told(name, variant)
    assert row in PAGE
    if (name, variant) in QUOTED:
        assert all(line in FLAT for line in lines)


def test_the_table_tells_of_the_phone_what_the_golden_set_keeps():
    """Of a log in the hand, whose diagnosis takes longer than all others."""
    row, *lines = kept_of("logs")[f"{LONGEST}-diagnosed"].splitlines()
    assert row in PAGE
    assert all(line in FLAT for line in lines)


def test_the_table_has_no_other_rows():
    assert len(re.findall(r"^\| `[a-z0-9-]+` \| \d", PAGE, re.MULTILINE)) == len(DIAGNOSED) + 1


def test_upper_limits():
    assert list(limit_rows()) == re.findall(r"^\| [a-z ]+ \| [\d.]+ .*\|$", PAGE, re.MULTILINE)


def test_what_a_fit_of_its_own_says_of_the_even_nonlinearity():
    """F tests of the norm, by a solver that shares nothing with the command."""
    forces, g = imported("ck-explorer").forces, 9.80665

    def squares(*forms):
        def misclosures(p):
            t = np.array([[p[0], p[1], p[2]], [0, p[3], p[4]], [0, 0, p[5]]])
            felt = forces - p[6:9]
            for k, form in enumerate(forms, 3):
                felt = felt - p[3 * k : 3 * k + 3] * form
            return np.linalg.norm(felt @ t.T, axis=1) - g

        start = np.r_[1.0, 0, 0, 1, 0, 1, np.zeros(3 + 3 * len(forms))]
        return 2 * optimize.least_squares(misclosures, start).cost

    n, base = len(forces), squares()

    def f_test(form):
        return number((base / squares(form) - 1) * (n - 12) / 3)

    even, asymmetric = forces**2 / g, 2 * np.maximum(forces, 0) - forces
    terms = f"F = {f_test(even)}, three scale asymmetries {f_test(asymmetric)}"
    assert f"three quadratic terms beside the nine parameters have {terms}" in FLAT
    assert f"three cubic terms {f_test(forces**3 / g**2)}" in FLAT
    before, after = (number(1e3 * float(np.sqrt(each / n))) for each in (base, squares(even)))
    assert f"goes from {before} to {after} mm/s²" in FLAT
    d = diagnosed("ck-explorer")
    (y,) = (value for name, value, *_ in d.found[0].parameters if name == "k2_y")
    assert f"the y axis reads {number(-1e3 * y * g)} mm/s² less" in FLAT
    (part,) = d.certain
    posteriors = {one.names: one.posterior for one in d.credible_set}
    assert f"has a posterior of {number(posteriors['scale_asymmetry',])}" in FLAT
    assert f"an even nonlinearity is certain ({number(part.posterior)})" in FLAT


def test_how_firmly_the_blocks_were_held():
    path = public_file("ck-explorer", DATA)
    blocks = 9.80665 * np.loadtxt(path, delimiter=",", skiprows=1).reshape(160, 100, 3)
    sd = np.sqrt(np.mean(blocks.var(axis=1, ddof=1), axis=1))
    off = blocks - blocks.mean(axis=1, keepdims=True)
    beside = np.sum(off[:, 1:] * off[:, :-1], axis=1) / np.sum(off**2, axis=1)
    order, correlated = np.argsort(sd), beside.mean(axis=1)
    assert f"an sd of {number(sd.min())} to {number(sd.max())} m/s²" in FLAT
    assert f"correlated by {number(correlated[order[-20:]].mean())}, in" in FLAT
    assert f"the 20 quietest by {number(correlated[order[:20]].mean())}" in FLAT
    accuracy = import_log(path, import_settings("ck-explorer"))[1].noise.accuracy
    assert f"Allan deviation, {number(accuracy.ratio)} times" in FLAT


def variances_taken(d):
    """Variances of the axes, beside their mean."""
    variances = d.frame.solution.variances[0, :3]
    return variances / variances.mean()


def test_the_y_axis_of_the_innalabs():
    d = diagnosed("innalabs-49")
    y = d.campaign.forces[:, 1] / d.campaign.gravity
    carried = np.abs(y) > 0.8
    residuals = 1e3 * d.base.misclosures[:, 0]
    many, few = (number(float(np.sqrt(np.mean(residuals[r] ** 2)))) for r in (carried, ~carried))
    assert f"the {np.count_nonzero(carried)} in which y carries more than 0.8 g" in FLAT
    assert f"leave {many} mm/s² rms, the others {few}" in FLAT
    x, y_taken, z = (number(v) for v in variances_taken(d))
    assert f"variances are taken as {x}, {y_taken} and {z} of the mean" in FLAT
    down = residuals[y < -0.95]
    assert f"from {number(down.min())} to {number(down.max())} mm/s²" in FLAT


@pytest.mark.parametrize("name", TOO_SMALL)
def test_what_cannot_be_diagnosed_is_said(name):
    with pytest.raises(InputError) as error:
        diagnosed(name)
    assert str(error.value).split(": ")[1] in FLAT


def test_what_is_invisible_to_all():
    hidden = {diagnosed(name, variant).invisible for name, variant in DIAGNOSED}
    (names,) = hidden
    assert all(words(name) in PAGE for name in names)


def test_every_public_measurement_is_on_the_page():
    for name, data in public_data().items():
        if data.settings is not None:
            assert f"`{name}`" in PAGE
