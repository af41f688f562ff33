"""How all figures look: sizes, fonts, and one colour for each thing wherever it occurs.

Matplotlib is loaded where something is drawn, so that a file with a figure is imported quickly.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.arrays import Array
from accelstudy.basics.plugins import cached_lookup
from accelstudy.basics.units import display_unit, recorded_unit, to_display, to_si, unit_label
from accelstudy.effects import Parameter, effect_names, get_effect
from accelstudy.sensors.models import NINE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from matplotlib.lines import Line2D
    from matplotlib.ticker import Locator

MM = 1 / 25.4
"""One millimetre in inches."""
COLUMN = 85 * MM
"""Width of a journal's column, inches."""
FULL = 175 * MM
"""Width of a journal's page, inches."""
DPI = 300

Style = dict[str, Any]
"""Keyword arguments of an artist."""

INK = "#222222"
MISSING = "#E6E6E6"
"""Background of what does not exist."""

# Okabe & Ito's colours for the groups of parameters, and two others for the approaches.
APPROACH_COLOURS = {"gravity": "#4A4A4A", "robot": "#C2247A"}
APPROACH_MARKERS = {"gravity": "o", "robot": "s"}
ANGLE_COLOURS = {"roll": "#0072B2", "pitch": "#D55E00"}
GROUPS = {
    "force": ("force", "#0072B2"),
    "bias": ("bias", "#009E73"),
    "scale": ("scale", "#E69F00"),
    "nonorthogonality": ("non-orthogonality", "#D55E00"),
    "cross_axis_misalignment": ("cross-axis", "#56B4E9"),
    "quadratic_scale": ("quadratic", "#8A8A2B"),
    "cubic_scale": ("cubic", "#7F5539"),
    "gravity": ("gravity", "#4A4A4A"),
}
"""Group of parameters (an effect, or what else varies): its label and its colour."""

# Nobody can tell two dozen colours apart, so effects beyond the registered models share the colour
# of their cause. These differ from all others for normal and for red-green blind eyes.
CAUSES = {
    "rig": "#332288",
    "course": "#5C0A1E",
    "sensor": "#99CC66",
}

TITLES = {"bias-scale": "6: bias, scale", NINE: "9: + non-orthogonality"}
"""Short titles of models; others are named by what they add to these."""


def in_style() -> AbstractContextManager[None]:
    """Draw in the look of all figures, as `figures.mplstyle` has it, within a ``with`` block."""
    from matplotlib import style

    # A matplotlibrc of the user would make other figures, or none, where it asks for LaTeX.
    return style.context(["default", Path(__file__).with_name("figures.mplstyle")])


def approach_colour(approach: str) -> str:
    """Colour of an approach."""
    return APPROACH_COLOURS.get(approach, "#0072B2")


def approach_marker(approach: str) -> str:
    """Marker of an approach."""
    return APPROACH_MARKERS.get(approach, "D")


def group_label(group: str) -> str:
    """Return the label of a group of parameters."""
    return GROUPS.get(group, (group.replace("_", " "), ""))[0]


def group_colour(group: str) -> str:
    """Colour of a group of parameters: its own, or that of the effect's cause."""
    if group in GROUPS:
        return GROUPS[group][1]
    return CAUSES[cause(group)] if group in effect_names() else "#999999"


def cause(effect: str) -> str:
    """Cause of an effect: the rig, the course of time and temperature, or else the sensor alone."""
    found = get_effect(effect)
    if found.part == "rig":
        return "rig"
    return "course" if found.is_course else "sensor"


@cached_lookup
def _parameters() -> dict[str, tuple[str, Parameter]]:
    known = {
        parameter.name: (effect, parameter)
        for effect in effect_names()
        for parameter in get_effect(effect).parameters
    }
    for axis in "xyz":
        known[f"f_{axis}"] = ("force", Parameter(f"f_{axis}", "m/s^2", f"$f_{axis}$"))
    known["g"] = ("gravity", Parameter("g", "m/s^2", "$g$"))
    return known


def _parameter(name: str) -> tuple[str, Parameter]:
    """Group and parameter of a name; a learned effect has as many as its function needs."""
    if learned := re.fullmatch(r"h_(\w+)_(\d+)", name):
        return "learned", Parameter(name, "1", f"$h_{{{learned[1]},{learned[2]}}}$")
    return _parameters()[name]


def group_of(parameter: str) -> str:
    """Group of a parameter: the effect it belongs to, "force" or "gravity"."""
    return _parameter(parameter)[0]


def symbol(parameter: str) -> str:
    """Return the symbol of a parameter (mathtext)."""
    return _parameter(parameter)[1].symbol


def in_shown_unit(values: ArrayLike, unit: str) -> tuple[Array, str]:
    """Convert values in the unit of a table into what people see; the values and their unit."""
    if unit != recorded_unit("rad"):
        return np.asarray(values, dtype=float), unit_label(unit)
    return to_display(to_si(values, unit, "rad"), "rad"), display_unit("rad")


def sort_groups(groups: Iterable[str]) -> list[str]:
    """Groups in the order of `GROUPS`, those that are not in it last."""
    found = set(groups)
    return [name for name in GROUPS if name in found] + sorted(found - set(GROUPS))


def model_title(model: str) -> str:
    """Short title of a model; an extension of one of `TITLES` is named by what it adds."""
    if model in TITLES:
        return TITLES[model]
    known = max(
        (name for name in TITLES if model.startswith((f"{name}-", f"{name}+"))),
        key=len,
        default=None,
    )
    if known is None:
        return " + ".join(map(_part_title, model.split("+"))) if "+" in model else model
    parameters, added = TITLES[known].split(":")[0], model.removeprefix(known)[1:]
    parts = added.split("+") if "(" in added or "+" in added else added.split("-")
    return " + ".join([parameters, *map(_part_title, parts)])


def _part_title(part: str) -> str:
    """Name an effect as words, with the number of its setting."""
    plain = part.replace("_", " ").replace("crossaxis", "cross-axis")
    return re.sub(r"\((?:\w+=)?", " (", plain)


def new_figure(width: float, height_mm: float) -> Figure:
    """Make an empty figure, `width` in inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height_mm * MM), layout="constrained")


def log_ticks(axis: Axis, low: float, high: float, *, few: bool = False) -> None:
    """Ticks of a logarithmic axis from `low` to `high`: some or very few, all of them labelled."""
    from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

    if high / low > 100:
        locator: Locator = LogLocator(numticks=9)
    elif high / low > (10 if few else 4):
        locator = LogLocator(subs=(1, 3) if few else (1, 2, 5))
    else:
        locator = MaxNLocator(2 if few else 4, steps=[1, 2, 2.5, 5, 10])
    axis.set_major_locator(locator)
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def legend_columns(labels: Iterable[str], width: float = FULL) -> int:
    """Number of columns of a legend that fit the width of a figure, inches."""
    import matplotlib as mpl
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    size = FontProperties(size=mpl.rcParams["legend.fontsize"]).get_size_in_points()
    # Handle and spaces take about as much as seven letters m.
    extents = [TextPath((0, 0), label, size=size).get_extents().width for label in labels]
    columns = [extent + 7 * size for extent in extents]
    room = 72 * (width - 5 * MM)
    return len(columns) if sum(columns) < room else max(1, int(room / max(columns)))


def say_empty(ax: Axes, text: str = "no estimable cell") -> None:
    """Write into axes why they are empty."""
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", color="#777777",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 2})  # fmt: skip


def matrix(
    ax: Axes,
    rows: Sequence[str],
    columns: Sequence[str],
    values: Array,
    texts: NDArray[np.str_],
    **colours: Any,
) -> AxesImage:
    """Draw a matrix as fields with texts; its rows and columns have titles.

    Where a value is NaN there is no field.
    """
    ax.grid(False)
    ax.tick_params(length=0)
    ax.set_xticks(range(len(columns)), columns)
    ax.set_yticks(range(len(rows)), rows)
    image = ax.imshow(values, interpolation="none", **colours)
    font: Style = {"ha": "center", "va": "center", "fontsize": 6.5, "in_layout": False}
    for (i, j), ink in np.ndenumerate(inks_on(image, values)):
        ax.text(j, i, str(texts[i, j]), color=ink, **font)
    return image


def inks_on(image: AxesImage, values: ArrayLike) -> NDArray[np.str_]:
    """Colours of texts on the fields of an image that show `values`: those of more contrast.

    Contrast is that of WCAG 2.2, (L₁ + 0.05) / (L₂ + 0.05) of the relative luminances.
    """
    from matplotlib.colors import to_rgb

    def luminance(colours: ArrayLike) -> Array:
        rgb = np.asarray(colours, dtype=float)[..., :3]
        linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
        return np.asarray(linear @ (0.2126, 0.7152, 0.0722)) + 0.05

    fields = luminance(image.to_rgba(np.asarray(values)))
    return np.where(fields**2 < 1.05 * luminance(to_rgb(INK)), "white", INK)


def approach_handles(approaches: Iterable[str], **options: Any) -> list[Line2D]:
    """Entries of a legend, one for each approach."""
    from matplotlib.lines import Line2D

    style: Style = {"linestyle": "", **options}
    return [
        Line2D(
            [],
            [],
            label=name,
            **{"marker": approach_marker(name), **style},
            color=approach_colour(name),
        )
        for name in approaches
    ]
