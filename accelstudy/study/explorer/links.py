"""Which figures of a study show a set-up."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from accelstudy.sensors.models import PRESETS
from accelstudy.study.config import StudyConfig
from accelstudy.study.figures import figure_names
from accelstudy.study.figures.factors import FACTORS, Block, blocks

Test = Callable[[Mapping[Any, Any]], bool]


def figures_of(study: StudyConfig, cells: Sequence[Mapping[Any, Any]]) -> list[list[str]]:
    """Names of the figures that show a set-up.

    Parameters
    ----------
    study : StudyConfig
    cells : rows of the table `cells`

    Returns
    -------
    list of list of str, one for each cell
    """
    names = figure_names(study)
    tests = {name: test for name, test in _tests(study).items() if name in names}
    return [[name for name, test in tests.items() if test(cell)] for cell in cells]


def _tests(study: StudyConfig) -> dict[str, Test]:
    """Whether a figure shows a cell, by the figure's name; those nearest to one cell first."""
    settings = study.sensitivity
    paper = f"{settings.model}/{settings.scheme}/" if settings else ""
    presets = {f"{preset.model}/{preset.scheme}" for preset in PRESETS}
    tests: dict[str, Test] = {
        **dict.fromkeys(
            ("figure-7", "figure-8"),
            lambda cell: cell["cell"] == f"{paper}{cell['approach']}",
        ),
        "table-1": lambda cell: cell["cell"].rpartition("/")[0] in presets,
        "leveling-overview": lambda cell: True,
    }
    for factor in FACTORS:
        tests[f"sweep-{factor.name}"] = _drawn(blocks(study, factor))
    tests["closed-forms"] = lambda cell: bool(cell["n_converged"])
    return tests


def _drawn(found: Iterable[Block]) -> Test:
    names = {name for block in found for name in block.cells["cell"]}
    return lambda cell: cell["cell"] in names
