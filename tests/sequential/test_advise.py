"""`accelstudy advise`: from the first position on, with conflicts, while the table grows."""

import re
import shutil
from itertools import product

import numpy as np
import pytest
from calling import succeed
from campaign_helpers import made

from accelstudy.adjustment import calibrate
from accelstudy.approaches import get_approach
from accelstudy.basics.units import GON, MGON
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.format import read_campaign
from accelstudy.leveling.angles import specific_force
from accelstudy.leveling.attitudes import attitude
from accelstudy.leveling.error import error_in_use
from accelstudy.schemes import get_scheme
from accelstudy.sensors.frames import parse_frame
from accelstudy.sensors.models import get_model
from accelstudy.sequential.advisor import advise as advice_for
from accelstudy.sequential.choice import candidate_positions
from accelstudy.sequential.promise import Promise
from accelstudy.simulation.sessions import Noise, session

MODEL = "bias-scale-nonorthogonality"
WANTED = ("--tilt-accuracy", "10mgon", "--tilt-range", "30gon")


def advise(folder, *options):
    return succeed("advise", folder, *WANTED, *options).output


@pytest.fixture(scope="module")
def sessions(tmp_path_factory):
    """Whole sessions, of which tests show the first positions."""
    folder = tmp_path_factory.mktemp("sessions")
    common = ("--scheme", "fibonacci-30", "--order", "random", "--seed", 4)
    for name, options in {
        "gravity": ("--approach", "gravity"),
        "robot": ("--approach", "robot"),
        "warm": ("--approach", "robot", "--temperature", "15:40", "--effect", "thermal_bias"),
    }.items():
        succeed("simulate-campaign", "--out", folder / name, *common, *options)
    return folder


@pytest.fixture
def begun(sessions, tmp_path):
    """Make a session that has come to its n-th position, some of them bumped."""

    def make(n, name="gravity", bumped=()):
        folder = tmp_path / "session"
        folder.mkdir(exist_ok=True)
        shutil.copy(sessions / name / "campaign.yaml", folder)
        rows = (sessions / name / "positions.csv").read_text(encoding="utf-8").splitlines()
        for i in bumped:
            cells = rows[i].split(",")
            at = rows[0].split(",").index("fx")
            cells[at : at + 3] = [str(1.004 * float(cell)) for cell in cells[at : at + 3]]
            rows[i] = ",".join(cells)
        (folder / "positions.csv").write_text("\n".join(rows[: n + 1]) + "\n", encoding="utf-8")
        return folder

    return make


# --- from the first position to the last ---------------------------------------------------------


def test_a_session_without_a_table_is_one_without_positions(begun):
    """The golden set has what is said from the first position to the last, word by word."""
    folder = begun(0)
    with_header_only = advise(folder)
    (folder / "positions.csv").unlink()
    assert advise(folder) == with_header_only


def test_the_next_position_is_worth_more_than_others(begun):
    measured = read_campaign(begun(14), running=True)
    promise, model = Promise(1 * MGON, 30 * GON), get_model(MODEL)
    directions = candidate_positions("cube")
    advice = advice_for(measured, model, get_approach("gravity"), promise, directions)
    before = fit_campaign(measured, model, get_approach("gravity"))
    error_of = error_in_use(model, before.parameters, 30 * GON, before.gravity, measured.hold)

    def after(direction):
        """Mean variance of roll and pitch with one position more, without noise."""
        observed = before.solution.observed
        force = model.sense(-before.gravity * direction[None], before.parameters)
        more = np.concatenate([observed.forces, force[None]], axis=1)
        result = calibrate(
            model, before.approach, type(observed)(more, 0.002, None, 0.0, before.gravity)
        )
        return np.mean(error_of.rms_of_all(result.cofactors[0]) ** 2)

    variances = np.array([after(direction) for direction in directions])
    chosen = np.flatnonzero((directions == advice.next).all(axis=1))[0]
    whole = np.mean(error_of.rms_of_all(before.covariance) ** 2)
    assert whole - variances[chosen] > 0.98 * (whole - variances.min())


# --- the noise -----------------------------------------------------------------------------------


def test_what_depends_on_more_than_the_attitude(begun):
    model = ("--model", f"{MODEL}+thermal_bias")
    text = advise(begun(0, "warm"), *model)
    assert re.search("not determined yet: .* and b_T_z", text)
    assert "to go: cannot be told, as it depends on the conditions" in text
    text = advise(begun(30, "warm"), *model)
    assert "YOU CAN STOP" in text
    # Without the effect most positions disagree. It is not they that are wrong.
    text = advise(begun(30, "warm"))
    assert "in conflict with" not in text
    assert "or the model lacks an effect" in text
    assert "YOU CAN STOP" not in text


# --- conflicts -----------------------------------------------------------------------------------


def test_an_outlier_position_is_named_and_to_be_repeated(begun):
    folder = begun(30, bumped=[17])
    text = advise(folder)
    assert "position 30: agrees with the others" in text
    assert "YOU CAN STOP" not in text
    entry = re.search(r"excluded: \[.*\]", text)[0]
    with (folder / "campaign.yaml").open("a", encoding="utf-8") as file:
        file.write(entry + "\n")
    assert read_campaign(folder).reasons == {17: "in conflict"}
    left_out = advise(folder)
    assert "in conflict" not in left_out
    assert "29 positions so far" in left_out
    assert "to go: about 1 position" in left_out


def test_it_never_says_enough_where_the_calibration_is_rejected():
    """Sessions of sensors with effects that the model lacks, and of a noise that is wrongly stated.

    The calibration is that of `calibrate`, and most of these sessions come to be rejected.
    """
    model, by = get_model(MODEL), get_approach("gravity")
    promise, directions = Promise(20 * MGON, 30 * GON), candidate_positions("cube")
    seen = []
    for seed, (effect, size, sigma) in enumerate(product(
        (None, "quadratic_scale", "cubic_scale"), (3e-4, 2e-3), (0.5e-3, 2e-3, 6e-3)
    )):  # fmt: skip
        sensor = get_model(MODEL + (f"+{effect}" if effect else ""))
        truth = np.zeros(sensor.n_parameters)
        truth[9:] = size
        order = np.random.default_rng(seed).permutation(26)
        whole = session(sensor, truth, get_scheme("faces-edges-corners-26").directions[order])
        drawn = whole.draw(Noise(0.002), 1, np.random.default_rng(seed))
        for n in (14, 26):
            forces = drawn.forces[0, :n]
            campaign = made(forces, sigma=sigma)
            advice = advice_for(campaign, model, by, promise, directions)
            state = fit_campaign(campaign, model, by).state
            assert advice.calibration_state == state
            assert not (advice.enough and state in ("rejected", "implausible"))
            seen.append((state == "rejected", advice.enough))
    rejected, enough = np.mean(seen, axis=0)
    assert 0.3 < rejected < 0.9
    assert enough > 0.1


def test_a_noise_that_few_holds_tell_is_taken_as_its_upper_bound():
    model, by = get_model(MODEL), get_approach("gravity")
    whole = session(model, np.zeros(9), get_scheme("faces-edges-corners-26").directions)
    forces = whole.draw(Noise(0.002), 1, np.random.default_rng(1)).forces[0]

    def advice(accuracy=12, **noise):
        campaign = made(forces, header={"sensor_noise": {"sigma_mps2": 0.002, **noise}})
        promise, directions = Promise(accuracy * MGON, 30 * GON), candidate_positions("cube")
        return advice_for(campaign, model, by, promise, directions)

    known, few, many = advice(), advice(degrees_of_freedom=8), advice(degrees_of_freedom=1e5)
    assert (known.enough, few.enough, many.enough) == (True, False, True)
    assert "known with 8 degrees of freedom" in few.summary()
    assert few.sigma_taken > 1.2 * known.sigma_taken
    np.testing.assert_allclose(few.rms / few.sigma_taken, known.rms / known.sigma_taken)
    assert many.sigma_taken == pytest.approx(known.sigma_taken, rel=0.01)


def test_a_repeat_that_disagrees_too_was_not_bumped(begun):
    folder = begun(30, bumped=[29])
    rows = (folder / "positions.csv").read_text(encoding="utf-8").splitlines()
    cells = rows[29].split(",")
    again = [cells[0].replace("29", "30"), *cells[1:]]
    (folder / "positions.csv").write_text("\n".join([*rows[:30], ",".join(again)]) + "\n")
    text = advise(folder)
    assert "once more" not in text
    assert "`accelstudy diagnose` tells what is wrong or missing" in text


# --- bad input -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("end", "counted"), [("6,12.", 5), ("6,1,2,3", 5), ("\n", 5)])
def test_a_last_line_without_an_end_may_be_cut_off_and_is_not_counted(begun, end, counted):
    folder = begun(5)
    with (folder / "positions.csv").open("a", encoding="utf-8") as file:
        file.write(end)
    text = advise(folder)
    assert f"{counted} positions so far" in text
    assert ("the last line of the table has no end yet" in text) == (end != "\n")


# --- attitudes in words --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("roll", "pitch", "frame", "expected"),
    [
        (0, 0, "frd", "roll 0 gon, pitch 0 gon (z axis straight down)"),
        (200, 0, "frd", "roll 200 gon, pitch 0 gon (z axis straight up)"),
        (30, 0, "frd", "roll 30 gon, pitch 0 gon (x axis level, y axis 30 gon down, z axis 70 gon "
         "down)"),
        (0, 40, "flu", "roll 0 gon, pitch -40 gon (x axis 40 gon up, y axis level, z axis 60 gon "
         "up)"),
    ],
)  # fmt: skip
def test_attitudes_in_words(roll, pitch, frame, expected):
    force = np.array(specific_force(roll * GON, pitch * GON, 1.0))
    assert attitude(-force, parse_frame(frame)) == expected
