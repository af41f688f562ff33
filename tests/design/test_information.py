"""What positions tell of parameters, against normal equations and draws."""

import numpy as np
import pytest

from accelstudy.design.information import Information, rank_of

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


def test_parameters_that_are_unknown_beside_others():
    inside = covariance(ROWS, np.arange(8))[3:, 3:]
    beside = Information.of(ROWS).beside(3)
    errors = beside.errors(range(5))
    columns = np.arange(3, 8)
    np.testing.assert_allclose(
        relative(errors @ errors.T, columns), relative(inside, columns), atol=1e-12
    )
    assert beside.conditions == 24


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
    assert np.flatnonzero(information.undetermined(range(8))).tolist() == [1, 4, 7]
    assert information.errors(range(8)) is None
    assert information.errors([0, 1, 4]) is not None
    assert not information.undetermined([0, 1, 4]).any()
    assert rank_of(rows)[0] == 7
