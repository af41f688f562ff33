import numpy as np

from accelstudy.basics.angles import wrapped


def test_angles_wrap_to_half_a_turn_either_way():
    angles = np.array([[0.0, 0.5], [np.pi - 1e-9, -np.pi], [3.5 * np.pi, -4.2]])
    found = wrapped(angles)
    np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * angles), atol=1e-14)
    assert np.all((found >= -np.pi) & (found < np.pi))
    assert wrapped(np.pi) == -np.pi
