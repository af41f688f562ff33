"""How many calibrations per second: the adjustment against what one would use instead.

    python benchmarks/adjustment.py [FIGURE]

All ways do the whole of it on the same sessions: draw, solve, standard deviations a posteriori. All
run in this process on one thread, in turns, and processor time is taken, so that what else the
machine does hits all alike. The loops are written as a careful user of
`scipy.optimize.least_squares` would write them: the residual function works on all positions at
once, the start is the ideal sensor, and MINPACK's Levenberg-Marquardt does the rest. FIGURE is a
file for the figure of the cost over positions, parameters and replicates.
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # read when NumPy is imported

import re  # noqa: E402
import sys  # noqa: E402
from time import process_time  # noqa: E402

import numpy as np  # noqa: E402
from scipy.optimize import least_squares  # noqa: E402

from accelstudy.adjustment import calibrate  # noqa: E402
from accelstudy.adjustment.block import Block  # noqa: E402
from accelstudy.adjustment.calibration import equations_of  # noqa: E402
from accelstudy.approaches import get_approach  # noqa: E402
from accelstudy.kernel import calibrate as kernel  # noqa: E402
from accelstudy.kernel.adjustment import KernelCode  # noqa: E402
from accelstudy.kernel.compiled import Compiled  # noqa: E402
from accelstudy.kernel.lanes import LANES, Code, Variable, fma  # noqa: E402
from accelstudy.leveling import specific_force  # noqa: E402
from accelstudy.models import get_model  # noqa: E402
from accelstudy.schemes import get_scheme  # noqa: E402
from accelstudy.simulation import Noise, session  # noqa: E402
from accelstudy.units import MGON, STANDARD_GRAVITY  # noqa: E402

REPETITIONS = 9
BLOCK = 500
"""Sessions that are drawn and solved together, as in a study."""
BLOCKS = 10
"""Blocks that the compiled code solves in one repetition."""
LOOP = 100
"""Sessions of a block that a loop solves in one repetition."""
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


def solved(residuals, jac):
    """Estimates and their standard deviations a posteriori, (2, 9)."""
    result = least_squares(residuals, np.zeros(9), jac, method="lm")
    m, u = result.jac.shape
    cofactors = np.linalg.inv(result.jac.T @ result.jac)
    return np.array([result.x, np.sqrt(2 * result.cost / (m - u) * np.diagonal(cofactors))])


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

    return solved(residuals, derivatives if analytic else "2-point")


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

    return solved(residuals, derivatives if analytic else "2-point")


def ideal_session(model=MODEL, scheme="mclaren-24"):
    truth = model.vector(dict(zip(MODEL.parameter_names, TRUTH, strict=True)))
    return session(model, truth, get_scheme(scheme).directions)


def in_blocks(how, approach, blocks, model=MODEL, scheme="mclaren-24"):
    """Draw and calibrate blocks; estimates and standard deviations a posteriori, (2, R, u)."""
    ideal, results = ideal_session(model, scheme), []
    for number in range(blocks):
        rng = np.random.default_rng([1, number])
        block = how(model, approach, ideal.draw(NOISE, BLOCK, rng, angles=approach.uses_angles))
        variance = block.omega / block.redundancy
        results.append([block.estimates, block.sigma_priori * np.sqrt(variance)[:, None]])
    return np.concatenate(results, axis=1)


def one_by_one(fit, analytic):
    """Draw and calibrate sessions in a loop, as `in_blocks`."""
    observed = ideal_session().draw(NOISE, BLOCK, np.random.default_rng([1, 0]))
    sessions = zip(observed.forces[:LOOP], observed.angles[:LOOP], strict=True)
    return np.stack([fit(f, a, analytic) for f, a in sessions], axis=1)


def by_numpy(model, approach, observed):
    return Block.of(calibrate(model, approach, observed))


def in_turns(works, repetitions=REPETITIONS):
    """Seconds of processor time of each work, {name: (repetitions,)}, and what it returned."""
    results = {name: work() for name, work in works.items()}  # traces and compiles
    seconds = {name: [] for name in works}
    for _ in range(repetitions):
        for name, work in works.items():
            start = process_time()
            work()
            seconds[name].append(process_time() - start)
    return {name: np.array(values) for name, values in seconds.items()}, results


def compare(name, fit):
    """Print the speeds of all ways, and by how much the compiled code is faster."""
    approach = get_approach(name)
    works = {
        "compiled": (lambda: in_blocks(kernel.calibrate, approach, BLOCKS), BLOCKS * BLOCK),
        "NumPy": (lambda: in_blocks(by_numpy, approach, 1), BLOCK),
        "SciPy loop": (lambda: one_by_one(fit, analytic=False), LOOP),
        "SciPy loop, analytic Jacobian": (lambda: one_by_one(fit, analytic=True), LOOP),
    }
    seconds, results = in_turns({way: work for way, (work, _) in works.items()})
    rates = {way: n / seconds[way] for way, (_, n) in works.items()}
    print(f"\n{name}: 9 parameters, 24 positions\n")
    print("| way | calibrations/s | compiled is faster by (range) | difference/σ |")
    print("|---|---|---|---|")
    for way, values in rates.items():
        estimates, sigma = results["compiled"][:, : len(results[way][0])]
        difference = np.max(np.abs(results[way] - [estimates, sigma])[0] / sigma)
        assert difference < AGREEMENT, f"{way} disagrees by {difference:.3f} σ"
        ratio = rates["compiled"] / values
        spread = f"{np.median(ratio):.1f} ({ratio.min():.1f} – {ratio.max():.1f})"
        print(f"| {way} | {np.median(values):,.0f} | {spread} | {difference:.1g} |")


SCHEMES = [f"fibonacci-{n}" for n in (12, 24, 48, 96, 192, 384)]
MODELS = [
    *("bias-scale", "bias-scale-nonorthogonality", "bias-scale-nonorthogonality-quadratic"),
    "bias-scale-nonorthogonality-quadratic-cubic",
]
COUNTS = [1, 4, 16, 64]


def costs():
    """What a calibration costs over positions, parameters and replicates.

    {(panel, approach): (x, µs per calibration, smallest, largest)}
    """
    found = {}
    for name in ("gravity", "robot"):
        approach = get_approach(name)

        def work(blocks, model=MODEL, scheme="mclaren-24", approach=approach):
            return lambda: in_blocks(kernel.calibrate, approach, blocks, model, scheme)

        models = [get_model(model) for model in MODELS]
        panels = {
            "positions": {get_scheme(s).n_positions: (work(4, scheme=s), 4) for s in SCHEMES},
            "parameters": {m.n_parameters: (work(4, m, "fibonacci-48"), 4) for m in models},
            "replicates": {BLOCK * count: (work(count), count) for count in COUNTS},
        }
        for panel, works in panels.items():
            seconds, _ = in_turns({x: work for x, (work, _) in works.items()})
            each = np.array([1e6 * seconds[x] / (BLOCK * works[x][1]) for x in works])
            found[panel, name] = (np.array([*works]), np.median(each, axis=1), each)
    return found


def print_costs(found):
    print("\nµs per calibration, drawn and compiled (9 parameters, 24 positions if not said)\n")
    for panel in ("positions", "parameters", "replicates"):
        x = found[panel, "gravity"][0]
        print(f"| {panel} | {' | '.join(map(str, x))} |\n|{'---|' * (len(x) + 1)}")
        for name in ("gravity", "robot"):
            print(f"| {name} | {' | '.join(f'{y:.2f}' for y in found[panel, name][1])} |")
        print()


def operations(text):
    """Floating-point operations of the code per lane: once per group, iteration and position."""
    counts, order, stack = {}, [], []
    for line in text.splitlines():
        if label := re.match(r"(head|then|after)(\d+):", line):
            if label[1] == "after":
                stack.pop()
            else:
                # What is done under a condition belongs to the loop around it.
                stack.append(label[0] if label[1] == "head" else stack[-1])
                order += [label[0]] if label[1] == "head" else []
        elif stack and not line.startswith("declare"):
            once = len(re.findall(r"= (fadd|fsub|fmul|fdiv|fneg|call .*sqrt)", line))
            counts[stack[-1]] = counts.get(stack[-1], 0) + once + 2 * line.count("@llvm.fma")
    group, observe, iteration, *positions = (counts.get(name, 0) for name in order)
    return {"group": group, "observe": observe, "iteration": iteration, "position": sum(positions)}


def plain_loop(chains=6, turns=200_000):
    """Floating-point operations per second of a loop over fused multiply-adds in registers."""
    code = Code("plain", ("turns",), ("x",))
    a, b = code.load("x", "0"), code.load("x", str(LANES))
    sums = [Variable(code, float(k)) for k in range(chains)]
    with code.loop("%turns"):
        for variable in sums:
            variable.set(fma(variable.get(), a, b))
    total = sums[0].get()
    for variable in sums[1:]:
        total = total + variable.get()
    code.store(total, "x", "0")
    function, x = Compiled(str(code), "plain", 1, 1), np.full(2 * LANES, 0.5)
    return lambda: function.call(turns, x.ctypes.data), 2 * chains * turns * LANES


def limits(name):
    """How near drawing and solving come to what plain loops reach, as a row of a table."""
    approach, ideal = get_approach(name), ideal_session()
    observed = ideal.draw(NOISE, BLOCK, np.random.default_rng(1))
    block = kernel.calibrate(MODEL, approach, observed)
    per = operations(KernelCode(equations_of(MODEL.trace, approach, False)).text)
    n, iterations = len(ideal.forces), block.iterations.mean()
    work = per["group"] + n * per["observe"]
    work += iterations * (per["iteration"] + n * per["position"])
    uses = approach.uses_angles
    normals = n * (5 if uses else 3)
    rng = np.random.default_rng(1)
    loop, loop_operations = plain_loop()
    works = {
        "draw": lambda: ideal.draw(NOISE, BLOCK, rng, angles=uses),
        "normals": lambda: rng.standard_normal(BLOCK * normals),
        "solve": lambda: kernel.calibrate(MODEL, approach, observed),
        "loop": loop,
    }
    seconds, _ = in_turns(works, 5 * REPETITIONS)
    speeds = [
        BLOCK * normals / seconds["draw"] / 1e6,
        BLOCK * normals / seconds["normals"] / 1e6,
        BLOCK * work / seconds["solve"] / 1e9,
        loop_operations / seconds["loop"] / 1e9,
    ]
    return f"| {name} | " + " | ".join(f"{np.median(speed):.3g}" for speed in speeds) + " |"


def draw_costs(found, path):
    import matplotlib.pyplot as plt

    plt.rcParams["svg.hashsalt"] = "accelstudy"
    figure, panels = plt.subplots(1, 3, figsize=(10, 3.4), layout="constrained")
    for panel, axes in zip(("positions", "parameters", "replicates"), panels, strict=True):
        for name, marker in (("gravity", "o"), ("robot", "s")):
            x, middle, each = found[panel, name]
            total = x * 1e-6 if panel == "replicates" else 1.0
            axes.plot(x, middle * total, marker, label=name, color=f"C{marker == 's':d}")
            axes.vlines(x, *(np.array([each.min(1), each.max(1)]) * total), f"C{marker == 's':d}")
            slope = np.polyfit(x, middle * total, 1, w=1 / (middle * total))
            line = np.linspace(x[0], x[-1], 200)
            axes.plot(line, np.polyval(slope, line), color=f"C{marker == 's':d}", lw=0.8)
        axes.set_xlabel(panel)
        if panel != "parameters":
            axes.set(xscale="log", yscale="log")
            axes.set_xticks(x, [f"{value}" for value in x])
            axes.minorticks_off()
    panels[0].set_ylabel("µs per calibration")
    panels[1].set(ylabel="µs per calibration (48 positions)", ylim=0)
    panels[2].set_ylabel("s for all")
    panels[0].legend(title="lines: a + b x")
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    compare("gravity", fit_gravity)
    compare("robot", fit_robot)
    print("\n| | drawn, 10⁶ normals/s | plain | solved, 10⁹ operations/s | plain |")
    print("|---|---|---|---|---|")
    print(limits("gravity"), limits("robot"), sep="\n")
    found = costs()
    print_costs(found)
    if len(sys.argv) > 1:
        draw_costs(found, sys.argv[1])
