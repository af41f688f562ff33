"""The efficiency of schemes, compared with the best possible set of as many positions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd

from accelstudy.design.continuous import continuous_optimum
from accelstudy.design.criteria import get_criterion
from accelstudy.design.search import optimal_design
from accelstudy.design.spaces import Constraints, Sphere
from accelstudy.design.task import Task
from accelstudy.schemes import Scheme

CRITERIA = ("D", "A", "I")


def efficiency_table(
    tasks: Iterable[Task], schemes: Iterable[Scheme], positions: Iterable[int], seed: int
) -> pd.DataFrame:
    """Efficiency of schemes and of I-optimal designs by each criterion.

    Parameters
    ----------
    tasks : calibrations for which all of them are judged
    schemes : Schemes
    positions : numbers of positions of the designs
    seed : int, of the search for the designs

    Returns
    -------
    DataFrame
        For each task, scheme and criterion: approach, model, scheme, title, status, n, criterion,
        efficiency (0 where the scheme does not determine the model; `reason` says why), rms_roll
        and rms_pitch (rad, NaN likewise), and least_rms, the lower bound for any n positions
        of the rms of roll and pitch together (I only).
    """
    schemes = list(schemes)
    tables = [_of_task(task, schemes, positions, seed) for task in tasks]
    return pd.concat(tables, ignore_index=True)


def _of_task(
    task: Task, schemes: list[Scheme], positions: Iterable[int], seed: int
) -> pd.DataFrame:
    criteria = {name: get_criterion(name, task) for name in CRITERIA}
    # For shares that sum to one position; n positions have n times the information.
    bounds = {
        name: continuous_optimum(task, criterion, Sphere(), Constraints(), 1).bound
        for name, criterion in criteria.items()
    }
    designs = [
        Scheme(
            f"I-optimal {n}",
            f"{n} I-optimal",
            optimal_design(task, criteria["I"], n, seed=seed, bounded=False).directions,
            "generated",
            "accelstudy design",
        )
        for n in positions
    ]
    rows: list[Mapping[str, object]] = []
    for scheme in [*schemes, *designs]:
        n, reason = scheme.n_positions, task.missing(scheme.directions)
        roll, pitch = (np.nan, np.nan) if reason else task.rms_tilt(scheme.directions)
        for name, criterion in criteria.items():
            share = 0.0
            if not reason:
                value = float(criterion.value(task.normal(scheme.directions) / n))
                share = min(1.0, criterion.efficiency(value, bounds[name]))
            rows.append(
                {
                    "model": task.model.name,
                    "approach": task.approach.name,
                    "scheme": scheme.name,
                    "title": scheme.title,
                    "status": scheme.status,
                    "n": n,
                    "criterion": name,
                    "efficiency": share,
                    "rms_roll": roll,
                    "rms_pitch": pitch,
                    "least_rms": float(np.exp(bounds["I"] / 2) / np.sqrt(n)),
                    "reason": reason,
                }
            )
    return pd.DataFrame(rows)
