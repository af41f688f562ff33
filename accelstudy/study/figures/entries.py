"""Which figures there are: of what, of which studies, and what draws each.

Importing this is quick, as the workflow does it whenever it starts; what draws is imported where a
figure is drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, TypeAlias

from accelstudy.study.figures.factors import FACTORS, NOISES, factor_note, varies

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from accelstudy.study.config import StudyConfig

Tables: TypeAlias = "Mapping[str, pd.DataFrame]"

TABLES = ("cells", "summary", "correlations", "leveling", "quantiles", "sensitivity", "shapley")
"""What a figure may ask for."""


def _always(study: StudyConfig) -> bool:
    return True


def _of_the_paper(study: StudyConfig) -> bool:
    return study.paper


def _no_note(study: StudyConfig) -> str:
    return ""


@dataclass(frozen=True)
class FigureEntry:
    """A figure.

    Attributes
    ----------
    name, title, category : str
    drawn_by : str, module of this package and function in it, as ``module:function``; it takes the
        tables, the study and `settings`
    tables : tuple of str, those of `TABLES` that it draws
    when : callable, whether a study has this figure
    caption : str, name of the caption, by default that of the figure; figures of one kind share one
    note : callable, what the caption says of this study beside that
    angles : bool, whether it shows angles, whose unit the caption then explains
    settings : mapping of str to anything
    """

    name: str
    title: str
    category: str
    drawn_by: str
    tables: tuple[str, ...] = ()
    when: Callable[[StudyConfig], bool] = _always
    caption: str = ""
    note: Callable[[StudyConfig], str] = _no_note
    angles: bool = True
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "caption", self.caption or self.name)

    @property
    def draw(self) -> Callable[..., Figure]:
        """The function that draws it."""
        return resolve_name(f"{__package__}.{self.drawn_by}")


def all_figures() -> Iterator[FigureEntry]:
    """All figures that a study can have."""
    yield from _paper()
    yield from _study()


def _paper() -> Iterator[FigureEntry]:
    yield FigureEntry(
        "figure-2",
        "Figure 2: accuracy of roll and pitch over the attitude",
        "Paper",
        "accuracy:accuracy_over_attitude",
        when=_of_the_paper,
    )
    yield FigureEntry(
        "figure-3",
        "Figure 3: accuracy of roll and pitch over the sensor noise",
        "Paper",
        "accuracy:accuracy_over_noise",
        when=_of_the_paper,
    )
    yield FigureEntry(
        "figure-4",
        "Figure 4: total effects of the forces on roll and pitch",
        "Paper",
        "force_effects:effects_of_forces",
        tables=("sensitivity",),
        when=_of_the_paper,
    )
    for approach, suffix, kind in (
        ("gravity", "", "gravity-based"),
        ("robot", "-robot", "robot-aided"),
    ):
        for number, output in ((5, "roll"), (6, "pitch")):
            yield FigureEntry(
                f"figure-{number}{suffix}",
                f"Figure {number}: total effects on {output}, {kind} calibration",
                "Paper",
                "total_effects:effects_over_roll",
                tables=("sensitivity",),
                when=_of_the_paper,
                settings={"output": output, "approach": approach},
            )
    yield FigureEntry(
        "shapley",
        "Shapley effects on roll and pitch, gravity-based calibration",
        "Paper",
        "shapley:shapley",
        tables=("shapley",),
        when=_of_the_paper,
    )
    yield FigureEntry(
        "figure-7",
        "Figure 7: errors and standard deviations of the two calibrations",
        "Paper",
        "paper_cells:errors_and_sigmas",
        tables=("summary", "quantiles"),
        when=_of_the_paper,
    )
    yield FigureEntry(
        "figure-8",
        "Figure 8: correlations of the parameters of the two calibrations",
        "Paper",
        "paper_cells:correlations",
        tables=("correlations",),
        when=_of_the_paper,
        angles=False,
    )
    yield FigureEntry(
        "table-1",
        "Table 1: published calibrations and what they determine",
        "Paper",
        "table_1:published_calibrations",
        tables=("summary", "leveling"),
        when=lambda study: study.presets is not None,
    )


def _study() -> Iterator[FigureEntry]:
    yield FigureEntry(
        "closed-forms",
        "Monte Carlo against closed forms and linear theory",
        "Study",
        "linear_theory:monte_carlo_against_theory",
        tables=("summary",),
        angles=False,
    )
    yield FigureEntry(
        "leveling-overview",
        "Tilt error that each calibration leaves",
        "Study",
        "leveling_overview:tilt_errors",
        tables=("cells", "leveling"),
        when=lambda study: not any(varies(study, noise) for noise in NOISES),
    )
    for factor in FACTORS:
        yield FigureEntry(
            f"sweep-{factor.name}",
            f"Standard deviations and tilt error over the {factor.title}",
            "Study",
            "sweep:over_factor",
            tables=("cells", "summary", "leveling"),
            when=partial(varies, factor=factor),
            caption="sweep",
            note=partial(factor_note, factor=factor),
            settings={"factor": factor},
        )
    yield FigureEntry(
        "rare-events",
        "Tails of the tilt error, and calibrations that fail",
        "Study",
        "rare_events:rare_events",
        tables=("cells", "quantiles"),
        when=lambda study: study.keep == "summary",
    )
