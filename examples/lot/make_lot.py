"""Write campaigns of fifty sensors of one type, and of the next one: a simulation of a delivery.

The bias of the type follows the temperature. Three sensors have something of their own.
"""

import numpy as np

import accelstudy as acs

SENSORS = 50
TYPE = {  # mean of the type, and scatter from sensor to sensor
    "nonorthogonality": ([1.0e-3, -5.0e-4, 8.0e-4], 1.0e-4),  # rad
    "thermal_bias": ([1.5e-4, -1.0e-4, 2.0e-4], 3.0e-5),  # m/s²/K
}
OWN = {
    12: "quadratic_scale: 0.004, -0.003, 0.005",
    27: "hysteresis: 0.012, 0.010, -0.012",  # m/s²
    41: "bias_drift: 8e-6, -9e-6, 7e-6",  # m/s²/s
}

rng = np.random.default_rng(2026)
for number in range(1, SENSORS + 2):
    effects = []
    for name, (mean, scatter) in TYPE.items():
        drawn = rng.normal(mean, scatter)
        effects.append(f"{name}: " + ", ".join(f"{value:.3g}" for value in drawn))
    if number in OWN:
        effects.append(OWN[number])
    next_one = number > SENSORS
    campaign = acs.simulate_campaign(
        name="next" if next_one else f"sensor-{number}",
        seed=number,
        approach="gravity",
        scheme="faces-6" if next_one else "fibonacci-24",
        order="random",
        temperature=(22, 23) if next_one else (10, 40),
        temperature_order="random",
        effects=effects,
    )
    acs.write_campaign(campaign, "next" if next_one else f"sensors/{number}")
