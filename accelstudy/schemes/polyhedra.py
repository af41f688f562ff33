"""Faces, edges and corners of the cube, and vertices of other polyhedra."""

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.positions.points import corners, cyclic_permutations, edges, faces
from accelstudy.schemes.registry import register

GOLDEN_RATIO = (1 + np.sqrt(5)) / 2
# Rotation by Euler angles xyz of (15°, 25°, 35°). It is written out because every job lists the
# schemes, and scipy.spatial would take longer to import than all else here.
_GENERIC = np.array(
    [
        [0.742403876506104, -0.46443208696509053, 0.4828450276703281],
        [0.5198367907256845, 0.853978855082683, 0.02213201481317717],
        [-0.4226182617406994, 0.23456971600980442, 0.8754260980655929],
    ]
)


def generic(directions: Array) -> Array:
    """Turn directions by Euler angles xyz of (15°, 25°, 35°), away from all their symmetries.

    Polyhedra that are aligned with the axes cannot determine cubic terms from the norm of gravity,
    and roll is undefined for a vertex on the x axis.
    """
    return directions @ _GENERIC.T


register(
    "faces-6",
    title="faces",
    status="standard",
    source="Lötters et al. (1998), Sensors and Actuators A 68, 221-228",
)(faces)


@register(
    "faces-edges-18",
    title="faces + edges",
    status="standard",
    source="Shin & El-Sheimy (2002), ZfV 127, 41-50; Skog & Händel (2006); Syed et al. (2007); "
    "Fong et al. (2008); Qureshi & Golnaraghi (2017)",
)
def faces_edges() -> Array:
    """The 18 positions most often used in the field."""
    return np.vstack([faces(), edges()])


@register(
    "faces-edges-corners-26",
    title="faces + edges + corners",
    status="standard",
    source="Syed et al. (2007), Meas. Sci. Technol. 18, 1897-1907, with the corners",
)
def faces_edges_corners() -> Array:
    """The 18 positions and the corners."""
    return np.vstack([faces(), edges(), corners()])


@register(
    "rhombicuboctahedron-24",
    title="rhombicuboctahedron",
    status="generated",
    source="vertices of the rhombicuboctahedron",
)
def rhombicuboctahedron() -> Array:
    """The 24 vertices, aligned with the axes and yet 30° off the roll pole.

    Because they are aligned, they cannot determine cubic terms from the norm of gravity. A rotation
    would cure that, and change their fourth moment.
    """
    return cyclic_permutations(1, 1, 1 + np.sqrt(2))


@register(
    "icosahedron-12",
    title="icosahedron",
    status="generated",
    source="vertices of the icosahedron, a spherical 5-design",
)
def icosahedron() -> Array:
    """The 12 vertices in a generic orientation.

    No smaller set has the sphere's moments up to degree 4, on which the cofactors of the nine
    parameters depend. They lie on only six axes, too few for further parameters.
    """
    return generic(cyclic_permutations(0, 1, GOLDEN_RATIO))


@register(
    "dodecahedron-20",
    title="dodecahedron",
    status="generated",
    source="vertices of the dodecahedron, a spherical 5-design",
)
def dodecahedron() -> Array:
    """The 20 vertices in a generic orientation."""
    inner = cyclic_permutations(0, 1 / GOLDEN_RATIO, GOLDEN_RATIO)
    return generic(np.vstack([corners(), inner]))


@register(
    "icosidodecahedron-30",
    title="icosidodecahedron",
    status="stand-in",
    source="vertices of the icosidodecahedron for the 30 positions of Lv et al. (2016), "
    "SII 2016, 373-378",
)
def icosidodecahedron() -> Array:
    """The 30 vertices in a generic orientation, 9.7° off the roll pole.

    Aligned with the axes six of them are faces, two of these on the pole.
    """
    inner = cyclic_permutations(1, GOLDEN_RATIO, GOLDEN_RATIO**2)
    return generic(np.vstack([faces(), inner]))
