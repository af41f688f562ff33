"""The table of the optimal schemes.

python tests/helpers/optimal_schemes.py        # searches all of them anew, in minutes
"""

import json

from accelstudy.approaches import get_approach
from accelstudy.design.criteria import get_criterion
from accelstudy.design.search import Search
from accelstudy.design.task import Task
from accelstudy.schemes.optimal import TABLE
from accelstudy.sensors.models import get_model

SIZES = {"D": range(10, 41), "I": (*range(9, 41), 45, 50, 60, 70, 80, 100, 120)}
TASK = Task(get_model("bias-scale-nonorthogonality"), get_approach("gravity"))
DECIMALS = 6


def searched(name, n):
    """Positions that are found, their efficiency, and the bound of the criterion."""
    criterion = get_criterion(name, TASK)
    search = Search(TASK, criterion)
    directions = (search.optimum(n).round(DECIMALS) + 0.0).tolist()
    return {
        "efficiency": round(search.efficiency(directions), 5),
        "bound": round(search.bound(n), 5),
        "directions": directions,
    }


def line(n, entry):
    return f'  "{n}": {json.dumps(entry)}'


if __name__ == "__main__":
    families = []
    for name, sizes in SIZES.items():
        lines = [line(n, searched(name, n)) for n in sizes]
        families.append(f'"{name}": {{\n' + ",\n".join(lines) + "\n}")
    TABLE.write_text("{" + ",\n".join(families) + "}\n", encoding="utf-8")
