"""A learned function: its table, its figure, and what is said of it."""

import numpy as np
import pytest
from campaign_helpers import made
from closed_forms import roll_and_pitch
from usual import NINE, G

from accelstudy.basics.units import MGON
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.figures import AXES, shape_figure
from accelstudy.diagnosis.report.words import verdict_lines
from accelstudy.effects import get_effect
from accelstudy.schemes import get_scheme

SIGMA, N = 2e-3, 40


def plain_campaign(rng):
    """A session of a robot and an ideal sensor."""
    f = -G * rng.permutation(get_scheme(f"fibonacci-{N}").directions)
    sigma_angle = 10 * MGON
    return made(
        f + SIGMA * rng.standard_normal((N, 3)),
        G,
        SIGMA,
        angles=roll_and_pitch(f) + sigma_angle * rng.standard_normal((N, 2)),
        sigma_angle=sigma_angle,
        time=60.0 * np.arange(N),
        temperature=rng.uniform(10, 40, N),
        yaw=rng.uniform(-np.pi, np.pi, N),
    ), f


# --- one campaign, and all that is said of it ---------------------------------------------------

SWING, PHASE = 8e-3, 0.4


@pytest.fixture(scope="module")
def learned():
    """The bias of x and y depends on the yaw, once per turn."""
    campaign, _ = plain_campaign(np.random.default_rng(5))
    turn = np.sin(np.asarray(campaign.yaw) + PHASE)[:, None]
    swings = turn * np.array([SWING, 0.7 * SWING, 0])
    changed = campaign.with_arrays(forces=campaign.forces + swings)
    return diagnose(changed, NINE)


def test_the_table_is_the_function_of_the_model(learned):
    effect = get_effect(learned.found[0].spec)
    values = dict(zip(learned.extended_model.parameter_names, learned.final.solution.parameters,
                      strict=False))  # fmt: skip
    table = learned.shape.function
    grid = np.array(table["coordinate"])
    at = type("Hold", (), {"yaw": grid})
    p = [values[parameter.name] for parameter in effect.parameters]
    for axis, added in zip("xyz", effect.output((0, 0, 0), p, G, at, np), strict=True):
        assert table["value"][axis] == pytest.approx(added, abs=1e-12)
    for axis, size in zip("xyz", (SWING, 0.7 * SWING, 0.0), strict=True):
        missed = table["value"][axis] - size * np.sin(grid + PHASE)
        assert np.abs(missed / table["sigma"][axis]).max() < 4
    assert table["unit"] == "m/s^2"


def test_what_was_learned_is_said(learned):
    shape = learned.shape
    assert (learned.verdict, learned.shape.place) == ("learned", ("yaw", "bias"))
    assert learned.found[0].posterior > 0.7
    assert learned.confirmation.confirmed
    assert learned.variances["extended"] < 2 < learned.variances["base"]
    assert verdict_lines(learned)[0] == (
        "The model lacks something that has no name here: the bias of x and y depends on the yaw."
    )
    assert shape.axes == ("x", "y")
    # σ of an amplitude from 40 positions is 0.45 mm/s².
    sizes = {"x": 2 * SWING, "y": 1.4 * SWING}
    assert shape.extents == pytest.approx(sizes, abs=3.6e-3)
    text = " ".join(verdict_lines(learned))
    said = " and ".join(f"{1e3 * size:.1f} ({axis})" for axis, size in shape.extents.items())
    assert f"goes up and down by {said} mm/s²." in text
    assert "mgon with the function of the yaw" in text


def test_the_figure_has_units_and_the_colours_of_the_axes(learned):
    panels = shape_figure(learned.shape).axes
    assert [panel.lines[1].get_color() for panel in panels] == [AXES[i][0] for i in "xyz"]
    assert [panel.get_ylabel() for panel in panels] == [f"bias of {i}\nh / (mm/s²)" for i in "xyz"]
    assert panels[-1].get_xlabel() == "yaw / gon"
    assert [panel.get_title(loc="right") for panel in panels] == ["", "", "no part of it shows"]
