"""Whether the stated errors of rare tilt errors are those over seeds, and their shares those drawn.

    python benchmarks/rare.py [SEEDS]       # 100 seeds: some minutes of one core

Prints the stated over the actual standard error of quantiles, 5000 calibrations each, and how many
of two million plain calibrations lie beyond the quantile of 10⁻³.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from accelstudy.study.cells import study_cells
from accelstudy.study.config import read_study
from accelstudy.study.monte_carlo.followed import TILTS, cell_tilt_error, tilts
from accelstudy.study.monte_carlo.replicates import blocks
from accelstudy.study.rare import rare_tilts
from timing import short, table

CONFIG = Path(__file__).parents[1] / "config" / "config.yaml"
SHARES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
DRAWN_FOR = (1e-2, 1e-4, 1e-6)
REPLICATES, PLAIN = 5000, 2_000_000


def cells(noise):
    """The set-ups of figures 7 and 8, compiled, with other noise of the forces."""
    for cell in study_cells(read_study(CONFIG)):
        if cell.name.startswith("bias-scale-nonorthogonality/mclaren-24/"):
            own = replace(cell.noise, sigma_force=noise)
            yield replace(cell, compiled=True, noise=own, replicates=REPLICATES)


def main(seeds):
    """Print both tables."""
    leveling = read_study(CONFIG).leveling.model_dump()
    rows = []
    for noise in (0.002, 0.3):
        for cell in cells(noise):
            each = [rare_tilts(cell, s, leveling, DRAWN_FOR).quantile(SHARES) for s in range(seeds)]
            values, errors = (np.array([one[i] for one in each]) for i in range(2))
            scatter = np.nanstd(values, axis=0, ddof=1)
            ratio = np.sqrt(np.nanmean(errors**2, axis=0)) / scatter
            for name, row in zip(TILTS, ratio, strict=True):
                rows.append([cell.approach, f"{1e3 * noise:g} mm/s²", name, *map(short, row)])
    print(table(["approach", "noise", "angle", *(f"{share:g}" for share in SHARES)], *rows))

    cell = next(cells(0.3))
    tail = rare_tilts(replace(cell, replicates=100_000), 1, leveling, DRAWN_FOR)
    bounds = tail.quantile(SHARES)[0][:, 1]
    error, beyond, count = cell_tilt_error(cell, leveling), np.zeros(len(TILTS), int), 0
    for pair in blocks(replace(cell, replicates=PLAIN), 2, 0, PLAIN):
        chosen = pair.simulated.estimates[pair.simulated.converged]
        beyond += (tilts(error, chosen) > bounds[:, None]).sum(axis=1)
        count += len(chosen)
    print(f"\n{cell.approach}, 300 mm/s²: {beyond} of {count} beyond, {1e-3 * count:.0f} expected")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
