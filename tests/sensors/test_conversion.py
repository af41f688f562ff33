"""Raw numbers to m/s², and back."""

import numpy as np

from accelstudy.sensors.conversion import conversion_of


def test_counts_and_g_come_back():
    raw = np.array([[100.0, -50.0, 7.0], [0.0, 1.0, 2.0]])
    for conversion in (conversion_of("counts", [0.1, -0.2, 0.3], 7), conversion_of("g")):
        np.testing.assert_allclose(conversion.from_si(conversion.to_si(raw)), raw, atol=1e-12)
    counts = conversion_of("counts", [0.1, -0.2, 0.3], 7)
    np.testing.assert_allclose(counts.to_si(raw)[0], [9.3, 11.4, 0.0])
    np.testing.assert_array_equal(conversion_of("g").to_si(raw), raw * 9.80665)
