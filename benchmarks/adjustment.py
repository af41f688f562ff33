"""How many calibrations per second: the batched adjustment against loops over SciPy.

    python benchmarks/adjustment.py

Each opponent is written as a careful user of `scipy.optimize.least_squares` would write it: the
residual function works on all positions at once, the start is the ideal sensor, and MINPACK's
Levenberg-Marquardt does the rest. All run in this process on one thread, on the same simulated
sessions (9 parameters, 24 positions), in turns, so that what else the machine does hits all alike.
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # read when NumPy is imported

from time import perf_counter  # noqa: E402

import numpy as np  # noqa: E402
from scipy.optimize import least_squares  # noqa: E402

from accelstudy.adjustment import calibrate  # noqa: E402
from accelstudy.approaches import get_approach  # noqa: E402
from accelstudy.leveling import specific_force  # noqa: E402
from accelstudy.models import get_model  # noqa: E402
from accelstudy.schemes import get_scheme  # noqa: E402
from accelstudy.simulation import Noise, session  # noqa: E402
from accelstudy.units import MGON, STANDARD_GRAVITY  # noqa: E402

REPETITIONS = 9
BLOCK = 500
"""Sessions that the batched adjustment solves together."""
LOOP = 100
"""Sessions of the block that a loop solves in one repetition."""
AGREEMENT = 0.02
"""Largest difference of two estimates, in standard deviations."""

MODEL = get_model("bias-scale-nonorthogonality")
NOISE = Noise()
TRUTH = MODEL.vector(
    {
        **{"b_x": 0.05, "b_y": 0.01, "b_z": 0.03, "s_x": 200e-6, "s_y": 200e-6, "s_z": 200e-6},
        **{"alpha_yz": 12 * MGON, "alpha_zy": 12 * MGON, "alpha_zx": 44 * MGON},
    }
)


def axes(x):
    """T of eq. (4) of Thalmann & Neuner (2018)."""
    return np.array([[1.0, -x[6], x[7]], [0.0, 1.0, -x[8]], [0.0, 0.0, 1.0]])


def body_force(x, l):
    """f_b of the sensor's output, (n, 3): eq. (5) solved for it."""
    return (l - x[:3]) / (1 + x[3:6]) @ axes(x).T


def body_force_derivatives(x, l):
    """∂f_b/∂x, (n, 3, 9)."""
    f_a = (l - x[:3]) / (1 + x[3:6])
    by_bias = -axes(x) / (1 + x[3:6])
    result = np.zeros((len(l), 3, 9))
    result[:, :, :3] = by_bias
    result[:, :, 3:6] = by_bias * f_a[:, None]
    result[:, 0, 6] = -f_a[:, 1]
    result[:, 0, 7] = f_a[:, 2]
    result[:, 1, 8] = -f_a[:, 2]
    return result


def fit_gravity(forces, angles, analytic):
    """|f_b| − g by ordinary least squares."""

    def residuals(x):
        f_b = body_force(x, forces)
        return (np.sqrt(np.sum(f_b * f_b, axis=1)) - STANDARD_GRAVITY) / NOISE.sigma_force

    def derivatives(x):
        f_b = body_force(x, forces)
        unit = f_b / np.sqrt(np.sum(f_b * f_b, axis=1, keepdims=True))
        by_x = np.einsum("ni,nij->nj", unit, body_force_derivatives(x, forces))
        return by_x / NOISE.sigma_force

    jac = derivatives if analytic else "2-point"
    return least_squares(residuals, np.zeros(9), jac, method="lm").x


def fit_robot(forces, angles, analytic):
    """f_b − f(φ, θ) by least squares, weighted with its covariance matrix at the read angles."""
    roll, pitch = angles.T
    reference = np.stack(specific_force(roll, pitch, STANDARD_GRAVITY), axis=-1)
    by_angles = STANDARD_GRAVITY * np.array(
        [
            [np.zeros_like(roll), np.cos(pitch)],
            [-np.cos(pitch) * np.cos(roll), np.sin(pitch) * np.sin(roll)],
            [np.cos(pitch) * np.sin(roll), np.sin(pitch) * np.cos(roll)],
        ]
    )
    covariance = NOISE.sigma_force**2 * np.eye(3) + NOISE.sigma_angle**2 * np.einsum(
        "ian,jan->nij", by_angles, by_angles
    )
    whitening = np.linalg.inv(np.linalg.cholesky(covariance))

    def residuals(x):
        return np.einsum("nij,nj->ni", whitening, body_force(x, forces) - reference).ravel()

    def derivatives(x):
        return (whitening @ body_force_derivatives(x, forces)).reshape(-1, 9)

    jac = derivatives if analytic else "2-point"
    return least_squares(residuals, np.zeros(9), jac, method="lm").x


def speed(work, n):
    """Fits per second, and what the work returned."""
    start = perf_counter()
    result = work()
    return n / (perf_counter() - start), result


def compare(name, fit):
    """Run the batched adjustment and both loops in turns, and print their speeds."""
    approach = get_approach(name)
    ideal = session(MODEL, TRUTH, get_scheme("mclaren-24").directions)
    observed = ideal.draw(NOISE, BLOCK, np.random.default_rng(1))

    def loop(analytic):
        sessions = zip(observed.forces[:LOOP], observed.angles[:LOOP], strict=True)
        return np.array([fit(f, a, analytic) for f, a in sessions])

    ways = {
        "batched": (lambda: calibrate(MODEL, approach, observed), BLOCK),
        "SciPy": (lambda: loop(analytic=False), LOOP),
        "SciPy, analytic Jacobian": (lambda: loop(analytic=True), LOOP),
    }
    calibrate(MODEL, approach, observed)  # traces the equations and generates the code
    speeds = {way: [] for way in ways}
    results = {}
    for _ in range(REPETITIONS):
        for way, (work, n) in ways.items():
            fits_per_second, results[way] = speed(work, n)
            speeds[way].append(fits_per_second)

    batched = results["batched"]
    assert batched.converged.all()
    print(f"{name}: 9 parameters, 24 positions, blocks of {BLOCK}")
    print(f"  {'':26}{'fits/s (median)':>16}   batched is faster by (range)   difference/σ")
    for way, values in speeds.items():
        line = f"  {way:26}{np.median(values):16,.0f}"
        if way != "batched":
            ratio = np.array(speeds["batched"]) / values
            difference = np.abs(results[way] - batched.parameters[:LOOP])
            largest = (difference / batched.sigma_priori[:LOOP]).max()
            assert largest < AGREEMENT, f"{way} disagrees by {largest:.3f} σ"
            spread = f"({ratio.min():.1f} - {ratio.max():.1f})"
            line += f"{np.median(ratio):15.1f} {spread:16}{largest:12.4f}"
        print(line)


if __name__ == "__main__":
    compare("gravity", fit_gravity)
    compare("robot", fit_robot)
