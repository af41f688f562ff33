"""What a scheme can show: detectable and identifiable sizes, beside a model written by hand."""

import numpy as np
import pytest
from norm_model import SHOWN, nine
from usual import GRAVITY, NINE, G

from accelstudy.diagnosis.visibility import examine_scheme, visibilities, visibility_table
from accelstudy.effects import effect_names, effects_without
from accelstudy.schemes import get_scheme
from accelstudy.simulation.sessions import Noise

SIGMA = 0.002
LAMBDA = 17.075
"""Noncentrality at which a test of one parameter at 0.1 % has a power of 80 % (Baarda 1968)."""
OTHERS = [name for name in effect_names() if name not in (*SHOWN, *(e.name for e in NINE.effects))]


@pytest.fixture(scope="module")
def shown():
    """A scheme without a robot, beside a catalogue of three nonlinear effects."""
    with effects_without(OTHERS):
        frame = examine_scheme(get_scheme("fibonacci-36"), NINE, GRAVITY, Noise(sigma_force=SIGMA))
        return frame, visibility_table(frame)


def left_of(design, columns):
    """What a least-squares fit of a design (n, u) leaves of columns (n, k)."""
    return columns - design @ np.linalg.lstsq(design, columns, rcond=None)[0]


@pytest.fixture(scope="module")
def by_hand():
    """What nine parameters leave of the three effects, in units of the noise."""
    u = -get_scheme("fibonacci-36").directions
    return {name: left_of(nine(u), f(u, G)) / SIGMA for name, f in SHOWN.items()}


@pytest.mark.parametrize("name", SHOWN)
def test_detectable_and_identifiable_sizes_by_hand(shown, by_hand, name):
    """The worst parameter; and what the other effects cannot imitate of it."""
    row = next(row for row in visibilities(shown[0]) if row.name == name)
    left = by_hand[name]
    assert row.mdb == pytest.approx(np.sqrt(LAMBDA) / np.linalg.norm(left, axis=0).min(), rel=1e-4)
    rivals = [columns for other, columns in by_hand.items() if other != name]
    beside = [np.linalg.norm(left_of(rival, left), axis=0) for rival in rivals]
    assert row.mib == pytest.approx(np.sqrt(LAMBDA) / np.min(beside), rel=1e-4)


def test_the_nearest_effects_come_first_with_their_cosines(shown, by_hand):
    bases = {name: np.linalg.qr(columns)[0] for name, columns in by_hand.items()}
    for row in visibilities(shown[0]):
        cosines = {
            other: np.linalg.svd(bases[row.name].T @ basis, compute_uv=False)[0]
            for other, basis in bases.items()
            if other != row.name
        }
        found = dict(row.confused)
        assert list(found) == sorted(cosines, key=lambda other: -cosines[other])
        assert found == pytest.approx(cosines, abs=1e-6)


def test_the_table_says_what_shows_what_does_not_and_why(shown):
    table = shown[1].set_index("effect")
    for row in visibilities(shown[0]):
        assert float(table.loc[row.name, "MDB"]) == pytest.approx(1e6 * row.mdb, rel=5e-3)
        assert table.loc[row.name, ["status", "unit"]].tolist() == ["visible", "ppm"]
    frame = examine_scheme(get_scheme("fibonacci-36"), NINE, GRAVITY)
    table = visibility_table(frame).set_index("effect")
    for name in ("mounting_rotation", "encoder_offset"):  # which no norm can show
        assert table.loc[name, ["status", "unit"]].tolist() == ["invisible", ""]
        assert table.loc[name, ["MDB", "MIB"]].isna().all()
    assert table.loc["bias_drift", "status"] == "untestable"
    assert "'time'" in table.loc["bias_drift", "confused with"]
    assert table.loc["saturation", "with"].startswith("knee=")
