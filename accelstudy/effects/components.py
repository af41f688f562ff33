"""The components on which the formulas of effects work: numbers, arrays or symbols."""

from __future__ import annotations

from typing import Any

AXES = ("x", "y", "z")
ANGLES = {"roll": r"\phi", "pitch": r"\theta"}
"""Angles of a robot, and their symbols."""

# Numbers, arrays or symbols, whatever the namespace `xp` works on.
Number = Any
Vector = tuple[Number, Number, Number]
Matrix = tuple[Vector, Vector, Vector]

ZERO_VECTOR: Vector = (0, 0, 0)
ZERO_MATRIX: Matrix = (ZERO_VECTOR, ZERO_VECTOR, ZERO_VECTOR)


def multiply(matrix: Matrix, vector: Vector) -> Vector:
    """Multiply a matrix with a vector, by components."""
    x, y, z = (sum(a * v for a, v in zip(row, vector, strict=True)) for row in matrix)
    return x, y, z


def cross(a: Vector, b: Vector) -> Vector:
    """Return a × b."""
    (x, y, z), (u, v, w) = a, b
    return y * w - z * v, z * u - x * w, x * v - y * u
