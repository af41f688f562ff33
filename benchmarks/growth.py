"""What a calibration by compiled code costs over positions, parameters and replicates."""

import numpy as np

from accelstudy.approaches import get_approach
from accelstudy.kernel import calibrate as kernel
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from problem import APPROACHES, BLOCK, MODEL, SCHEME, drawn, ideal_session
from timing import in_turns, short, table

ROUNDS = 9
SCHEMES = [f"fibonacci-{n}" for n in (12, 24, 48, 96, 192, 384)]
MODELS = [
    *("bias-scale", "bias-scale-nonorthogonality", "bias-scale-nonorthogonality-quadratic"),
    "bias-scale-nonorthogonality-quadratic-cubic",
]
COUNTS = [1, 4, 16, 64]
"""Blocks of replicates."""


def run():
    """{(panel, approach): (x, (len(x), rounds) µs per calibration)}."""
    found = {}
    for name in APPROACHES:
        approach = get_approach(name)
        panels = {
            "positions": {get_scheme(s).n_positions: (MODEL, s, 4) for s in SCHEMES},
            "parameters": {m.n_parameters: (m, "fibonacci-48", 4) for m in map(get_model, MODELS)},
            "replicates": {BLOCK * count: (MODEL, SCHEME, count) for count in COUNTS},
        }
        for panel, works in panels.items():
            seconds = in_turns({x: work(approach, *of) for x, of in works.items()}, ROUNDS)
            each = [1e6 * seconds[x] / (BLOCK * blocks) for x, (*_, blocks) in works.items()]
            found[panel, name] = np.array([*works]), np.array(each)
    return found


def work(approach, model, scheme, blocks):
    """Draw and calibrate so many blocks."""
    ideal = ideal_session(model, scheme)

    def do():
        for number in range(blocks):
            kernel.calibrate(model, approach, drawn(ideal, approach, number))

    return do


def tables(found):
    """One table for each panel."""
    texts = []
    for panel in ("positions", "parameters", "replicates"):
        x = found[panel, APPROACHES[0]][0]
        rows = [
            [f"{name}, µs each", *(short(y) for y in np.median(found[panel, name][1], axis=1))]
            for name in APPROACHES
        ]
        texts.append(table([panel, *x], *rows))
    return "\n\n".join(texts)
