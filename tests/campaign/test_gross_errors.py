"""Gross errors: what is recognised, how it is undone, and what is refused."""

import re

import gross
import numpy as np
import pytest
from campaign_helpers import made, unaided

import accelstudy as acs
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON, STANDARD_GRAVITY
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.format import write_campaign
from accelstudy.campaign.gross_errors.recognition import EXCHANGES, GROSS_ERRORS, recognise
from accelstudy.campaign.header import LogLayout
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.leveling.angles import angles_of
from accelstudy.schemes import get_scheme
from accelstudy.sensors.conversion import Conversion, conversion_of
from accelstudy.sensors.frames import parse_frame
from accelstudy.sensors.models import get_model

CLEAN = acs.simulate_campaign(n_samples=50, yaw="random")
BLIND = unaided(CLEAN)
GRAVITY_20 = acs.simulate_campaign(scheme="fibonacci-20", approach="gravity")


# --- what is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize("wrong", [{"force": 1 / STANDARD_GRAVITY}, {"angle": 0.9},
                                   {"angle": np.pi / 200}, {"force": 1e-4}])  # fmt: skip
def test_usual_wrong_units_are_refused(wrong, tmp_path):
    """In memory, too, where very small forces ended in an error of NumPy's arrays."""
    spoiled, written = gross.unit(CLEAN, **wrong), tmp_path / "written"
    write_campaign(spoiled, written, plausible=False)
    refused = "look like|, not in gon|nowhere near"
    with pytest.raises(InputError, match=refused):
        write_campaign(spoiled, tmp_path / "refused")
    for campaign in (spoiled, written):
        with pytest.raises(InputError, match=refused):
            acs.calibrate(campaign)
        with pytest.raises(InputError, match=refused):
            acs.advise(campaign, tilt_accuracy=1e-4)
    assert not (tmp_path / "refused").exists()


# --- recognition ---------------------------------------------------------------------------------

TEMPERATURE = {"temperature": (10.0, 40.0), "temperature_order": "ABBA"}
DESIGNS = {
    "plain": {"scheme": "faces-edges-18"},
    "symmetric": {"scheme": "mclaren-24", "sigma": 0.01},
    "repeated": {"scheme": "faces-6", "repeats": 4, "order": "random", "effects": ("warm_up",)},
    "hot": {"scheme": "dodecahedron-20", "effects": ("thermal_bias",), "size": 3.0, **TEMPERATURE},
    "clipped": {"scheme": "fibonacci-24", "effects": ("saturation",), "size": 2.0},
    "turned": {"scheme": "rings-24", "effects": ("mounting_rotation",), "size": 5.0},
    "many": {"scheme": "fibonacci-50", "repeat_first": 10, "effects": ("cubic_scale",),
             "size": 9.0},
}  # fmt: skip
"""Campaigns without a gross error, some with effects that are far too large for any sensor."""


@pytest.fixture(scope="module")
def designs():
    return {name: acs.simulate_campaign(seed=7, **how) for name, how in DESIGNS.items()}


def exchanged(campaign, rows, places):
    order = np.arange(campaign.n_positions)
    order[rows] = places
    return campaign.with_arrays(forces=campaign.forces[order])


@pytest.mark.parametrize("design", DESIGNS)
def test_nothing_is_recognised_where_nothing_is_wrong(design, designs):
    assert recognise(designs[design]) is None
    assert recognise(unaided(designs[design]), attitude=False) is None


@pytest.mark.parametrize("design", DESIGNS)
def test_all_axes_and_units_are_recognised_and_undone(design, designs):
    """Each exchange of the axes and unit of the angles in some designs, those of forces in all."""
    right, k = designs[design], [*DESIGNS].index(design)
    some = [(m.T @ (1, 2, 3)).astype(int) for m in EXCHANGES[k :: len(DESIGNS)]]
    wrong = [("axis_error", shown, gross.axes(right, *shown)) for shown in some]
    for force in (0.1019716212978, 101.9716212978, 9.80665):
        wrong.append(("unit_error", force, gross.unit(right, force=force)))
    angle = (0.9, 0.015707963267949)[k % 2]
    wrong.append(("unit_error", angle, gross.unit(right, angle=angle)))
    for name, setting, spoiled in wrong:
        found, said = recognise(spoiled), f"{name} {setting}"
        assert found is not None, said
        assert found.name == name, said
        np.testing.assert_allclose(found.corrected.forces, right.forces, rtol=1e-9, err_msg=said)
        np.testing.assert_allclose(found.corrected.angles, right.angles, rtol=1e-9, err_msg=said)


@pytest.mark.parametrize("design", DESIGNS)
def test_exchanged_rows_are_recognised_and_put_back(design, designs):
    """Some rows, blocks of rows, and a table that slipped by a row."""
    right, rng = designs[design], np.random.default_rng(3)
    whole = [np.arange(right.n_positions)] if design == "many" else []
    for count in (2, 3, 6):
        whole.append(rng.choice(right.n_positions, count, replace=False))
        whole.append(np.arange(count) + rng.integers(right.n_positions - count + 1))
    for wrong in whole:
        campaign = exchanged(right, wrong, np.roll(wrong, 1))
        if np.abs(campaign.forces - right.forces).max() < 0.06:
            continue  # repeats
        found = recognise(campaign)
        assert found is not None, (design, wrong)
        assert found.name == "row_order"
        slipped = np.all(np.diff(wrong) == 1) and len(wrong) > 2
        said = "stand in the row below theirs" if slipped else "are exchanged"
        assert design == "repeated" or said in found.reason
        assert (f", … {said}" in found.reason) == (len(wrong) > 40)
        # Which of two repeats is which does not show, and is all the same.
        assert np.abs(found.corrected.forces - right.forces).max() < 0.06, (design, wrong)


@pytest.mark.parametrize("step", [1, -1])
def test_a_row_that_was_lost_shifts_all_others(designs, step):
    """What belongs to the last row in place stands nowhere, and its position is left out."""
    right = designs["symmetric"]
    lost, lone = (0, -1) if step > 0 else (-1, 0)
    forces = np.roll(right.forces, -step, axis=0)
    forces[lone] = -right.forces[lone]
    found = recognise(right.with_arrays(forces=forces))
    assert [name for name, _ in found.names] == ["row_order", "outlier_position"]
    assert f"in the row {'above' if step > 0 else 'below'} theirs" in found.reason
    assert found.errors[-1].left_out == (right.positions[lost],)
    np.testing.assert_allclose(
        found.corrected.forces, np.delete(right.forces, lost, axis=0), atol=0.06
    )


def test_roll_and_pitch_are_exchanged_in_the_axes_of_the_log(designs):
    """With z up, one of both has the other sign than in frd."""
    right = designs["plain"]
    for frame, sign in {"frd": 1, "flu": -1, "rfu": 1}.items():
        log = LogLayout(columns={"fx": 0, "fy": 1, "fz": 2}, frame=frame)
        wrong = right.with_arrays(angles=sign * right.angles[:, ::-1])
        found = recognise(wrong.with_header(log=log))
        assert found.reason == "roll and pitch of the robot are exchanged"
        np.testing.assert_allclose(found.corrected.angles, right.angles, rtol=1e-9)


def test_degrees_for_gon_show_at_small_tilts():
    """Biases and scales then explain most of a tenth; one in five positions may be bumped."""
    right = acs.simulate_campaign(scheme="fibonacci-150", repeat_first=0, seed=7)
    steep = right.positions[np.abs(right.angles).max(axis=1) > 60 * GON]
    wrong = gross.unit(right.without(dict.fromkeys(steep.tolist(), "steep")), angle=0.9)
    bumps = np.outer(np.arange(wrong.n_positions) % 5 == 2, (3, -12, 8))
    bumped = recognise(wrong.with_arrays(forces=wrong.forces + bumps)).errors[0]
    assert recognise(wrong).reason == bumped.reason == "the robot's angles are in degrees"


def test_degrees_for_gon_show_on_a_base_that_is_not_level():
    right = acs.simulate_campaign(scheme="fibonacci-30", yaw="random", effects="base_tilt", size=2)
    assert recognise(right) is None
    assert recognise(gross.unit(right, angle=0.9)).reason == "the robot's angles are in degrees"


def test_a_wrong_sign_of_an_axis_may_be_that_of_the_robots_angle(designs):
    right = designs["plain"]
    for angle, signs in {"pitch": (1, -1), "roll": (-1, 1)}.items():
        found = recognise(right.with_arrays(angles=right.angles * signs))
        assert f"or the robot's {angle} has the other sign" in found.reason


COUNTS = {
    "scales and offsets": ([0.005, 0.0065, 0.0055], [2600.0, 1500.0, 2010.0]),
    "scales": ([0.003, 0.006, 0.0045], [0.0, 0.0, 0.0]),
    "offsets": ([0.005, 0.005, 0.005], [2600.0, 1500.0, 2010.0]),
}


@pytest.mark.parametrize("robot", [True, False])
@pytest.mark.parametrize("differ", COUNTS)
@pytest.mark.parametrize("columns", [(1, 0, 2), (2, 1, 0), (1, 2, 0)])
def test_columns_of_counts_are_exchanged_before_their_scales_and_offsets(differ, columns, robot):
    """It ended in "does not converge", or in scales and biases that no sensor has."""
    scale, offset = map(np.array, COUNTS[differ])
    frame = parse_frame("rfu" if robot else "frd")
    signed = frame.signs * frame.to_frd_order(scale)
    nominal = Conversion(signed, frame.to_frd_order(offset))
    ideal = -9.80665 * get_scheme("faces-edges-corners-26").directions
    noise = 0.002 * np.random.default_rng(36).standard_normal(ideal.shape)
    forces = ideal * [1.004, 0.997, 1.006] + [0.12, -0.08, 0.2] + noise
    counts = nominal.from_si(forces)[:, columns]
    layout = LogLayout(unit="counts", scale=[*scale], offset=[*offset], frame=frame.name)
    of_axes = {"scale": nominal.scale, "offset": nominal.offset}
    header = {"unit": "counts", "nominal": of_axes, "log": layout}
    angles = {"angles": angles_of(ideal), "sigma_angle": 5e-5} if robot else {}
    read = made(nominal.to_si(counts), sigma=0.002, header=header, **angles)
    found = recognise(read)
    assert re.match("axes are swapped: . is read as .*, in the counts, before", found.reason)
    np.testing.assert_allclose(found.corrected.forces, forces, atol=1e-12)
    # Readings in counts are converted, and then turned, as those of the campaign were.
    log, logged = found.corrected.header.log, counts[:, np.argsort(frame.order)]
    again = frame.to_frd(conversion_of(log.unit, log.scale, log.offset).to_si(logged))
    again = again @ found.matrix.T
    np.testing.assert_allclose(again, forces, atol=1e-12)
    fit = fit_campaign(found.corrected, get_model("bias-scale-nonorthogonality"))
    np.testing.assert_allclose(
        fit.parameters[:6], [0.12, -0.08, 0.2, 0.004, -0.003, 0.006], atol=2e-3
    )


def test_what_does_not_show_is_not_recognised(designs):
    """Repeats that were exchanged, and the axes and rows where there is no robot."""
    repeated = designs["repeated"]
    alike = np.argsort(np.linalg.norm(repeated.forces - repeated.forces[0], axis=1))[:2]
    assert recognise(exchanged(repeated, alike, alike[::-1])) is None
    for spoiled in (gross.axes(BLIND, -3, 1, 2), gross.rows(BLIND, 2, 9)):
        assert recognise(spoiled, attitude=False) is None


def test_several_gross_errors_are_undone_together(designs):
    right = designs["many"]
    wrong = gross.bumped(exchanged(right, [4, 9], [9, 4]), 21, (3, -12, 8))
    wrong = gross.unit(gross.axes(wrong, 2, -1, 3), force=0.1019716212978)
    found = recognise(wrong)
    assert {name for name, _ in found.names} == {*GROSS_ERRORS}
    assert ("outlier_position", 21) in found.names
    assert "the forces are in g" in found.reason.split("; ")
    np.testing.assert_allclose(
        found.corrected.forces, np.delete(right.forces, 20, axis=0), atol=0.06
    )
    mended = np.delete(wrong.forces, 20, axis=0) @ found.matrix.T
    np.testing.assert_allclose(np.sort(mended, axis=0), np.sort(found.corrected.forces, axis=0))


@pytest.mark.parametrize(("approach", "size"), [("robot", 19.0), ("robot", 2.0), ("gravity", 9.0)])
def test_a_position_that_no_calibration_bears_is_left_out(approach, size):
    campaign = acs.simulate_campaign(scheme="fibonacci-24", seed=12, approach=approach)
    right = diagnose(campaign, get_model("bias-scale-nonorthogonality"))
    outward = campaign.forces[16] / np.linalg.norm(campaign.forces[16])
    campaign = gross.bumped(campaign, 17, size * outward)
    found = diagnose(campaign, get_model("bias-scale-nonorthogonality"))
    assert found.verdict == "gross_error"
    assert [(named.name, named.position) for named in found.found] == [("outlier_position", 17)]
    told = re.search(r"position 17 is wrong by ([\d.]+) m/s\^2", found.reason.facts["reason"])
    assert float(told[1]) == pytest.approx(size, rel=0.05)
    np.testing.assert_allclose(found.base.parameters, right.base.parameters, atol=0.01)


def test_of_many_wrong_positions_the_first_are_named():
    campaign = acs.simulate_campaign(scheme="fibonacci-200", seed=12, approach="gravity")
    factors = np.where(np.arange(200) % 9, 1.0, 1.5)[:, None]
    campaign = campaign.with_arrays(forces=campaign.forces * factors)
    with pytest.raises(InputError, match=r"positions 1, 10, .*, 172, … are wrong by up to") as e:
        acs.calibrate(campaign)
    assert len(str(e.value)) < 400


def test_a_bias_that_no_sensor_has_is_not_taken_for_outlier_positions():
    """Its positions are far from those of a usual sensor, and yet all agree."""
    rng = np.random.default_rng(1)
    for _ in range(20):
        up = rng.standard_normal((20, 3))
        up /= np.linalg.norm(up, axis=1, keepdims=True)
        forces = STANDARD_GRAVITY * (up + np.array([0.48, 0, 0])) + 0.002 * rng.standard_normal(
            up.shape
        )
        campaign = GRAVITY_20.with_arrays(forces=forces)
        assert recognise(campaign, attitude=False) is None
