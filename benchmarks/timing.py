"""Processor time of works that take turns, and how it is shown."""

from time import process_time

import numpy as np


def in_turns(works, rounds):
    """Seconds of processor time of each work, {name: (rounds,)}.

    One round goes before that is not counted: it compiles, and fills caches.
    """
    seconds = {name: [] for name in works}
    for number in range(rounds + 1):
        for name, work in works.items():
            start = process_time()
            work()
            if number:
                seconds[name].append(process_time() - start)
    return {name: np.array(values) for name, values in seconds.items()}


def median(values):
    """Median, to three digits."""
    return short(np.median(values))


def spread(values):
    """Median and range."""
    return f"{median(values)} ({short(np.min(values))} – {short(np.max(values))})"


def short(value):
    """Three digits at most, thousands apart."""
    if value >= 1000:
        digits = 10 ** (len(str(int(value))) - 3)
        return f"{round(value / digits) * digits:,}".replace(",", " ")
    return f"{value:.2g}" if value < 10 else f"{value:.0f}"


def table(*rows):
    """Markdown table; the first row is its head."""
    head, *rest = [f"| {' | '.join(map(str, row))} |" for row in rows]
    return "\n".join([head, "|" + "---|" * len(rows[0]), *rest])
