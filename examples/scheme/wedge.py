"""New schemes: a box on a wedge, which is turned on a table."""

# --8<-- [start:scheme]
import numpy as np

from accelstudy.schemes import register


@register(
    "wedge-N",
    title="on a wedge",
    status="generated",
    source="a box on a wedge of 45°, turned on a table in N steps, on its bottom and on its top",
    names=("wedge-8",),
)
def on_wedge(steps):
    """Gravity in the axes of the box: N steps with its bottom on the wedge, N with its top."""
    azimuth = 2 * np.pi * np.arange(steps) / steps
    ring = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.ones(steps)])
    return np.concatenate([ring, ring * [1, 1, -1]])


# --8<-- [end:scheme]


# --8<-- [start:sides]
@register(
    "wedge-sides-N",
    title="on a wedge and on all sides",
    status="generated",
    source="as wedge-N, and the box on each of its six sides without the wedge",
    names=("wedge-sides-8",),
)
def on_wedge_and_sides(steps):
    """Those of `on_wedge`, then the six sides."""
    return np.concatenate([on_wedge(steps), np.eye(3), -np.eye(3)])


# --8<-- [end:sides]
