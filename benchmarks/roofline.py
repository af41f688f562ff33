"""How near drawing and solving come to what plain loops reach on the same core."""

import re

import numpy as np

from accelstudy.adjustment.equations import equations_of
from accelstudy.approaches import get_approach
from accelstudy.kernel import calibrate as kernel
from accelstudy.kernel.compiled import Compiled
from accelstudy.kernel.lanes import LANES, Code, Variable, fma
from accelstudy.kernel.writing import KernelFunction, text_of
from problem import APPROACHES, BLOCK, MODEL, NOISE, drawn, ideal_session
from timing import in_turns, table

ROUNDS = 45


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


def run():
    """{approach: {what: (rounds,) of a speed, or of a part}}."""
    return {name: measure(name) for name in APPROACHES}


def measure(name):
    """Speeds of drawing and of solving by one approach, and of loops that do nothing else."""
    approach, ideal = get_approach(name), ideal_session()
    observed = drawn(ideal, approach)
    block = kernel.calibrate(MODEL, approach, observed)
    per = operations(text_of(KernelFunction(equations_of(MODEL.trace, approach, False))))
    n, iterations = len(ideal.forces), block.iterations.mean()
    work = per["group"] + n * per["observe"]
    work += iterations * (per["iteration"] + n * per["position"])
    normals = n * (5 if approach.uses_angles else 3)
    rng = np.random.default_rng(1)
    loop, loop_operations = plain_loop()
    works = {
        "draw": lambda: ideal.draw(NOISE, BLOCK, rng, angles=approach.uses_angles),
        "normals": lambda: rng.standard_normal(BLOCK * normals),
        "solve": lambda: kernel.calibrate(MODEL, approach, observed),
        "loop": loop,
    }
    seconds = in_turns(works, ROUNDS)
    return {
        "draw": BLOCK * normals / seconds["draw"] / 1e6,
        "normals": BLOCK * normals / seconds["normals"] / 1e6,
        "solve": BLOCK * work / seconds["solve"] / 1e9,
        "loop": loop_operations / seconds["loop"] / 1e9,
        "part": seconds["draw"] / (seconds["draw"] + seconds["solve"]),
    }


def tables(result):
    """One row for each approach."""
    head = ["", "10⁶ normals/s drawn", "NumPy's normals alone", "10⁹ operations/s solved"]
    head += ["multiply-adds in registers", "drawing's part of the time"]
    rows = [
        [
            name,
            *(f"{np.median(speeds[key]):.3g}" for key in ("draw", "normals", "solve", "loop")),
            f"{np.median(speeds['part']):.0%}",
        ]
        for name, speeds in result.items()
    ]
    return table(head, *rows)
