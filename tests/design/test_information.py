"""What positions tell of parameters, against normal equations and draws."""

import numpy as np
import pytest

from accelstudy.design.information import Information, rank_of
from accelstudy.leveling.error import TiltError

RNG = np.random.default_rng(1)
UNITS = 10.0 ** RNG.uniform(-4, 4, 8)
ROWS, MORE = (RNG.standard_normal((n, 3, 8)) * UNITS for n in (9, 5))


def covariance(rows, estimated):
    design = rows.reshape(-1, 8)[:, estimated] / UNITS[estimated]
    return np.linalg.inv(design.T @ design) / np.outer(UNITS[estimated], UNITS[estimated])


def relative(matrix, columns):
    return matrix * np.outer(UNITS[columns], UNITS[columns])


def test_information_of_sessions_adds_and_is_that_of_the_normal_equations():
    columns = [0, 2, 5, 6]
    both = np.concatenate([ROWS, MORE])
    errors = Information.of(ROWS, MORE).errors(columns)
    found = relative((errors @ errors.T)[np.ix_(columns, columns)], columns)
    np.testing.assert_allclose(found, relative(covariance(both, columns), columns), atol=1e-12)
    one, other = Information.of(ROWS), Information.of(MORE)
    together = Information.of(one.rows, other.rows).errors(columns)
    np.testing.assert_allclose(together @ together.T, errors @ errors.T, rtol=1e-9)


def test_what_is_neglected_shifts_the_estimates_and_is_missing():
    """Noise-free sessions of sensors with a neglected parameter, estimated by least squares."""
    estimated, sizes = [0, 1, 2, 3], np.array([0.3, 2.0]) / UNITS[[6, 7]]
    design, neglected = (ROWS.reshape(-1, 8)[:, at] for at in (estimated, [6, 7]))
    errors = Information.of(ROWS).errors(estimated, [6, 7], sizes)
    for j in (0, 1):
        scaled = np.linalg.lstsq(design / UNITS[estimated], sizes[j] * neglected[:, j])[0]
        shift = scaled / UNITS[estimated]
        np.testing.assert_allclose(errors[estimated, 4 + j], shift, rtol=1e-9)
        assert errors[6 + j, 4 + j] == -sizes[j]
        assert errors[7 - j, 4 + j] == 0


@pytest.mark.parametrize("noise", [0.0, 1e-10])
def test_what_is_not_determined_is_told_whatever_the_units(noise):
    rows = ROWS.copy().reshape(-1, 8)
    rows[:, 7] = UNITS[7] * (rows[:, 1] / UNITS[1] - rows[:, 4] / UNITS[4] + noise * rows[:, 0])
    information = Information.of(rows)
    rank, _, involved = rank_of(rows)
    assert rank == 7
    assert np.flatnonzero(involved).tolist() == [1, 4, 7]
    assert not information.determined
    assert information.errors(range(8)) is None
    assert information.errors([0, 1, 4]) is not None


def test_what_a_further_position_brings():
    before, more = ROWS.reshape(-1, 8), MORE
    covariance = np.linalg.inv(before.T @ before)
    weight = RNG.standard_normal((3, 5))
    weight = weight.T @ weight / np.outer(UNITS[:5], UNITS[:5])
    information = Information.of(before)
    grown, fallen = information.gain(more), information.gain(more, weight)
    for rows, log, square in zip(more, grown, fallen, strict=True):
        after = np.linalg.inv(before.T @ before + rows.T @ rows)
        logs = [np.linalg.slogdet(each / np.outer(UNITS, UNITS))[1] for each in (covariance, after)]
        assert log == pytest.approx(logs[0] - logs[1], rel=1e-9)
        fall = np.sum(weight * (covariance - after)[:5, :5])
        assert square == pytest.approx(fall, rel=1e-9)


def test_the_tilt_error_of_draws():
    """Noise of unit weight, and neglected parameters of some sizes, by least squares."""
    estimated, neglected, sizes = [0, 2, 3], [5, 6], 0.4 / UNITS[[5, 6]]
    root = RNG.standard_normal((2, 4, 8)) / UNITS
    error = TiltError(np.zeros(8), np.zeros(2), np.zeros((2, 8)), root.swapaxes(1, 2) @ root)
    left = {"bent": ([5], sizes[0]), "bumped": ([6], sizes[1])}
    tilt = Information.of(ROWS).tilt(error, estimated, left)
    design, lacking = ROWS.reshape(-1, 8)[:, estimated], ROWS.reshape(-1, 8)[:, neglected]
    values = sizes * RNG.standard_normal((100_000, 2))
    seen = RNG.standard_normal((100_000, len(design))) + values @ lacking.T
    found = np.zeros((100_000, 8))
    scale = UNITS[estimated]
    found[:, estimated] = seen @ np.linalg.pinv(design / scale).T / scale
    found[:, neglected] = -values
    squares = error.squares(found)
    np.testing.assert_allclose(np.sqrt(squares.mean(axis=0)), tilt.rms, rtol=0.01)
    assert [*tilt.squares] == ["noise", "bent", "bumped"]
    assert Information.of(ROWS[:, :1, :2].repeat(4, 2)).tilt(error, estimated) is None
