"""The norm of the specific force written out by hand, independent of the package.

An ideal sensor along u reads |f| = g. To first order a change δf of its output changes |f| by u·δf,
so that the nine parameters show as u_i, u_i² and u_i u_j, and an effect on axis i as u_i times what
it adds there.
"""

import numpy as np

SHOWN = {
    "quadratic_scale": lambda u, g: g * u**3,
    "cubic_scale": lambda u, g: g * u**4,
    "scale_asymmetry": lambda u, g: g * u * np.abs(u),
}
"""Derivatives of |f| by the parameters of the three axes: k f²/g, k f³/g² and k |f|."""


def nine(u):
    """Derivatives of |f| by the parameters of bias, scale and non-orthogonality, (n, 9)."""
    x, y, z = u.T
    return np.column_stack([u, u**2, x * y, x * z, y * z])
