"""Counts, means and co-moments of calibrations, merged in one fixed order.

A sum of floats depends on the order of its terms. So the chunks of a cell are merged as the leaves
of one binary tree, in which the number of a chunk alone fixes its place. The result is the same to
the last bit, whichever job made which chunks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Moments:
    """The calibrations of some chunks of a cell, summed up.

    Of R replicates there are k numbers x, which are 0 where a calibration did not converge, and
    the same numbers y of linear theory, 0 where it is not used. `Averaged` names them.

    Attributes
    ----------
    simulated, converged : int
    redundancy : int
    centre : (u,) array, about which errors are taken; the same in all chunks of a cell
    difference, linear : (k,) arrays, means of x − y and of y
    squares : (3, k) array
        Σ of (x − y)², (x − y) y and y² about the means.
    linear_converged : (k,) array, Σ y over the converged replicates
    apart : (3, s, b) array
        Of the quantities that have quantiles: the number of converged replicates, Σ d and Σ d² of
        their differences d from linear theory, by the quantile of linear theory next to them.
    correlation_sum : (u, u) array, of the correlations from Σ_xx
    first : (q,) array, quantities of the first calibration that converged; NaN if there is none
    """

    simulated: int
    converged: int
    redundancy: int
    centre: Array
    difference: Array
    linear: Array
    squares: Array
    linear_converged: Array
    apart: Array
    correlation_sum: Array
    first: Array

    def merged(self, later: Moments) -> Moments:
        """Merge with those of chunks that come after (Chan, Golub & LeVeque 1983)."""
        n = self.simulated + later.simulated
        weight = later.simulated / n if n else 0.0
        steps = later.difference - self.difference, later.linear - self.linear
        outer = np.stack([steps[0] * steps[0], steps[0] * steps[1], steps[1] * steps[1]])
        return replace(
            self,
            simulated=n,
            converged=self.converged + later.converged,
            difference=self.difference + weight * steps[0],
            linear=self.linear + weight * steps[1],
            squares=self.squares + later.squares + (weight * self.simulated) * outer,
            linear_converged=self.linear_converged + later.linear_converged,
            apart=self.apart + later.apart,
            correlation_sum=self.correlation_sum + later.correlation_sum,
            first=self.first if self.converged else later.first,
        )


def paired_moments(x: Array, y: Array, converged: NDArray[np.bool_]) -> dict[str, Array]:
    """Means, squares and `linear_converged` of `Moments` from numbers (R, k) of one chunk."""
    apart, n = x - y, max(len(x), 1)
    difference, linear = apart.sum(axis=0) / n, y.sum(axis=0) / n
    apart -= difference
    centred = y - linear
    squares = [np.einsum("rk,rk->k", *pair) for pair in ((apart, apart), (apart, centred))]
    squares.append(np.einsum("rk,rk->k", centred, centred))
    return {
        "difference": difference,
        "linear": linear,
        "squares": np.stack(squares),
        "linear_converged": y[converged].sum(axis=0),
    }


def apart_by_quantile(differences: Array, expected: Array, edges: Array) -> Array:
    """Sums of differences from linear theory, (3, b), by its quantiles; see `Moments.apart`.

    differences, expected : (R,), a quantity minus that of linear theory, and the latter
    edges : (b − 1,), quantiles of linear theory at `EDGES`; NaN where they are not known
    """
    if not np.isfinite(edges).all():
        return np.zeros((3, len(edges) + 1))
    place = np.searchsorted(edges, expected)
    powers = np.ones(len(place)), differences, differences**2
    return np.stack([np.bincount(place, each, len(edges) + 1) for each in powers])


@dataclass(frozen=True)
class Node:
    """Moments of the chunks `first` to `first + chunks − 1`.

    `chunks` is a power of two of which `first` is a multiple.
    """

    first: int
    chunks: int
    moments: Moments


class Tree:
    """The fewest nodes that cover the chunks added so far."""

    def __init__(self, nodes: Iterable[Node] = ()) -> None:
        self.nodes: list[Node] = []
        for node in nodes:
            self.add(node)

    def add(self, node: Node) -> None:
        """Add the next node; siblings are merged into their parent.

        Raises
        ------
        ValueError
            If it does not begin where the last one ends.
        """
        if self.nodes and node.first != self.nodes[-1].first + self.nodes[-1].chunks:
            raise ValueError(f"chunk {node.first} does not follow those before it")
        while (
            self.nodes
            and self.nodes[-1].chunks == node.chunks
            and self.nodes[-1].first % (2 * node.chunks) == 0
        ):
            last = self.nodes.pop()
            node = Node(last.first, 2 * node.chunks, last.moments.merged(node.moments))
        self.nodes.append(node)

    @property
    def total(self) -> Moments:
        """Moments of all chunks."""
        first, *rest = (node.moments for node in self.nodes)
        for moments in rest:
            first = first.merged(moments)
        return first


LOWER = (1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.025, 0.05, 0.25)
PROBABILITIES = np.array([*LOWER, 0.5, *(1 - p for p in reversed(LOWER))])
"""Probabilities of the quantiles of a study."""
_NORMAL = special.ndtri(PROBABILITIES)
EDGES = special.ndtr((_NORMAL[1:] + _NORMAL[:-1]) / 2)
"""Probabilities between them."""

_VALUES = pa.list_(pa.float64())

_SUMS = ("difference", "linear", "squares", "linear_converged", "apart", "correlation_sum")
_ARRAYS = ("centre", *_SUMS, "first")
_COUNTS = ("simulated", "converged", "redundancy")

MOMENTS = pa.schema(
    {
        "cell": pa.dictionary(pa.int32(), pa.string()),
        "node": pa.int64(),
        "chunks": pa.int64(),
        **dict.fromkeys(_COUNTS, pa.int64()),
        **dict.fromkeys(_ARRAYS, _VALUES),
    }
)
"""One row per node, which begins with the chunk `node`; arrays row by row."""


def moments_table(cell: str, tree: Tree) -> pa.Table:
    """Rows of one cell."""
    nodes = tree.nodes
    each = [node.moments for node in nodes]
    return pa.table(
        {
            "cell": pa.array([cell] * len(nodes), MOMENTS.field("cell").type),
            "node": [node.first for node in nodes],
            "chunks": [node.chunks for node in nodes],
            **{name: [getattr(moments, name) for moments in each] for name in _COUNTS},
            **{name: [getattr(moments, name).ravel() for moments in each] for name in _ARRAYS},
        },
        schema=MOMENTS,
    )


def read_nodes(table: pa.Table) -> Iterator[tuple[str, Node]]:
    """Cell and node of each row."""
    for row in table.to_pylist():
        arrays: dict[str, Any] = {name: np.array(row[name]) for name in _ARRAYS}
        k, u = len(arrays["difference"]), len(arrays["centre"])
        shapes = {"squares": (3, k), "correlation_sum": (u, u), "apart": (3, -1, len(EDGES) + 1)}
        arrays |= {name: arrays[name].reshape(shape) for name, shape in shapes.items()}
        moments = Moments(**arrays, **{name: row[name] for name in _COUNTS})
        yield row["cell"], Node(row["node"], row["chunks"], moments)
