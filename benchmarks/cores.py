"""What processes side by side make, and how much of the cores they get for it."""

from multiprocessing import get_context
from time import perf_counter, process_time

import numpy as np

from accelstudy.approaches import get_approach
from problem import APPROACHES, BLOCK, drawn, ideal_session
from processes import cores_here
from timing import short, spread, table
from ways import WAYS

ROUNDS, BLOCKS = 9, 100


def run():
    """{(panel, approach): (processes, (k, rounds) calibrations/s, (k, rounds) µs of processor)}."""
    most = cores_here()
    counts = sorted({*(2**k for k in range(most.bit_length()) if 2**k <= most), most})
    return {name: side_by_side(name, counts) for name in APPROACHES}


def side_by_side(name, counts):
    """Let 1, 2, 4, … processes work at the same time, in turns."""
    context = get_context("spawn")
    ends = [context.Pipe() for _ in range(counts[-1])]
    workers = [context.Process(target=worker, args=(name, end)) for _, end in ends]
    for process in workers:
        process.start()
    pipes = [end for end, _ in ends]
    rates, costs = np.empty((2, len(counts), ROUNDS))
    for pipe in pipes:
        pipe.recv()  # is ready
    for r in range(ROUNDS):
        for k, count in enumerate(counts):
            for pipe in pipes[:count]:
                pipe.send(True)
            starts, stops, used = zip(*(pipe.recv() for pipe in pipes[:count]), strict=True)
            rates[k, r] = count * BLOCKS * BLOCK / (max(stops) - min(starts))
            costs[k, r] = 1e6 * np.mean(used) / (BLOCKS * BLOCK)
    for pipe, process in zip(pipes, workers, strict=True):
        pipe.send(False)
        process.join()
    return np.array(counts), rates, costs


def worker(name, pipe):
    """Draw and calibrate as often as asked; tell when it began and ended, and what it used."""
    approach, ideal = get_approach(name), ideal_session()
    way = WAYS.get("compiled")(approach)

    def work():
        for number in range(BLOCKS):
            way.solve(drawn(ideal, approach, number))

    work()
    pipe.send(None)
    while pipe.recv():
        start, used = perf_counter(), process_time()
        work()
        pipe.send((start, perf_counter(), process_time() - used))


def tables(result):
    """One row for each number of processes."""
    head = ["processes"]
    rows = {}
    for name, (counts, rates, costs) in result.items():
        head += [f"{name}: 10³ calibrations/s", "got cores", "µs of a core each"]
        for k, count in enumerate(counts):
            got = np.median(rates[k] * costs[k] / 1e6)
            row = rows.setdefault(count, [count])
            row += [short(np.median(rates[k]) / 1e3), short(got), spread(costs[k])]
    return table(head, *rows.values())
