"""How many calibrations per second each way makes, and by how much the compiled code is faster."""

import numpy as np

from accelstudy.approaches import get_approach
from problem import APPROACHES, BLOCK, drawn, ideal_session
from processes import fresh
from timing import in_turns, short, spread, table
from ways import WAYS

PROCESSES, ROUNDS = 3, 3
"""A process has its own places in memory, on which speed depends: so several are asked."""


def run():
    """Speeds {approach: {way: (rounds,) calibrations/s}}, and differences {approach: {way: σ}}."""
    speeds, differences = {}, {}
    for name in APPROACHES:
        results = [fresh(measure, name) for _ in range(PROCESSES)]
        ways = results[0][0]
        speeds[name] = {way: np.concatenate([rates[way] for rates, _ in results]) for way in ways}
        differences[name] = results[0][1]
    return speeds, differences


def measure(name):
    """Speeds and differences of all ways that are installed, by one approach."""
    approach, ideal = get_approach(name), ideal_session()
    ways = {way: WAYS.get(way)(approach) for way in WAYS.names() if not WAYS.get(way).missing()}

    def work(way):
        def do():
            for number in range(max(1, way.calibrations // BLOCK)):
                way.solve(drawn(ideal, approach, number).first(way.calibrations))

        return do

    seconds = in_turns({name: work(way) for name, way in ways.items()}, ROUNDS)
    rates = {name: way.calibrations / seconds[name] for name, way in ways.items()}

    first = drawn(ideal, approach)
    reference, sigma = ways["compiled"].solve(first)
    differences = {}
    for name, way in ways.items():
        estimates = way.solve(first.first(way.calibrations))[0]
        n = len(estimates)
        differences[name] = np.max(np.abs(estimates - reference[:n]) / sigma[:n])
        if not differences[name] <= way.difference:  # a NaN, too
            raise RuntimeError(f"{name}: estimates differ by {differences[name]:.3g} σ")
    return rates, differences


def tables(result):
    """One row for each way; what is not installed says so."""
    speeds, differences = result
    head, rows = ["way"], []
    for name in APPROACHES:
        head += [f"{name}: calibrations/s", "compiled is faster by", "difference, σ"]
    slowest = {way: np.median(rates) for way, rates in speeds[APPROACHES[0]].items()}
    for way in sorted(WAYS.names(), key=lambda way: -slowest.get(way, 0.0)):
        row = [WAYS.get(way).title]
        for name in APPROACHES:
            if way not in speeds[name]:
                row += [f"not measured: {WAYS.get(way).missing()}", "", ""]
                continue
            rates = speeds[name][way]
            ratio = "" if way == "compiled" else spread(speeds[name]["compiled"] / rates)
            apart = "" if way == "compiled" else f"{differences[name][way]:.0e}"
            row += [short(np.median(rates)), ratio, apart]
        rows.append(row)
    return table(head, *rows)
