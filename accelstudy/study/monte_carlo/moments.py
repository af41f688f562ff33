"""Counts, means and co-moments of calibrations, merged in one fixed order.

A sum of floats depends on the order of its terms. So the chunks of a cell are merged as the leaves
of one binary tree, in which the number of a chunk alone fixes its place. The result is the same to
the last bit, whichever job made which chunks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Moments:
    """The calibrations of some chunks of a cell, summed up.

    The q quantities are those of `accelstudy.study.monte_carlo.followed.Followed`; u of them are
    errors.

    Attributes
    ----------
    simulated, converged : int
    redundancy : int
    mean : (q,) array, over the converged calibrations; 0 if there are none
    comoment : (q, q) array, Σ (x − mean)(x − mean)ᵀ over them
    inside : (u,) int array, how many of their nominal 95 % intervals hold the truth
    correlation_sum : (u, u) array, of the correlations from Σ_xx
    first : (q,) array, the first of them; NaN if there are none
    """

    simulated: int
    converged: int
    redundancy: int
    mean: Array
    comoment: Array
    inside: NDArray[np.int64]
    correlation_sum: Array
    first: Array

    def merged(self, later: Moments) -> Moments:
        """Merge with those of chunks that come after (Chan, Golub & LeVeque 1983)."""
        n = self.converged + later.converged
        step = later.mean - self.mean
        weight = later.converged / n if n else 0.0
        return Moments(
            simulated=self.simulated + later.simulated,
            converged=n,
            redundancy=self.redundancy,
            mean=self.mean + weight * step,
            comoment=self.comoment
            + later.comoment
            + (weight * self.converged) * np.outer(step, step),
            inside=self.inside + later.inside,
            correlation_sum=self.correlation_sum + later.correlation_sum,
            first=self.first if self.converged else later.first,
        )


def moments_of(
    values: Array,
    simulated: int,
    redundancy: int,
    inside: NDArray[np.int64],
    correlation_sum: Array,
) -> Moments:
    """Moments of one chunk from the quantities of its converged calibrations, (R, q)."""
    n, q = values.shape
    mean = values.mean(axis=0) if n else np.zeros(q)
    centred = values - mean
    return Moments(
        simulated=simulated,
        converged=n,
        redundancy=redundancy,
        mean=mean,
        comoment=centred.T @ centred,
        inside=inside,
        correlation_sum=correlation_sum,
        first=values[0] if n else np.full(q, np.nan),
    )


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


_VALUES = pa.list_(pa.float64())

MOMENTS = pa.schema(
    {
        "cell": pa.dictionary(pa.int32(), pa.string()),
        "first": pa.int64(),
        "chunks": pa.int64(),
        "simulated": pa.int64(),
        "converged": pa.int64(),
        "redundancy": pa.int64(),
        "mean": _VALUES,
        "comoment": _VALUES,
        "inside": pa.list_(pa.int64()),
        "correlation_sum": _VALUES,
        "first_values": _VALUES,
    }
)
"""One row per node; matrices row by row."""


def moments_table(cell: str, tree: Tree) -> pa.Table:
    """Rows of one cell."""
    nodes = tree.nodes
    each = [node.moments for node in nodes]
    return pa.table(
        {
            "cell": pa.array([cell] * len(nodes), MOMENTS.field("cell").type),
            "first": [node.first for node in nodes],
            "chunks": [node.chunks for node in nodes],
            "simulated": [moments.simulated for moments in each],
            "converged": [moments.converged for moments in each],
            "redundancy": [moments.redundancy for moments in each],
            "mean": [moments.mean for moments in each],
            "comoment": [moments.comoment.ravel() for moments in each],
            "inside": [moments.inside for moments in each],
            "correlation_sum": [moments.correlation_sum.ravel() for moments in each],
            "first_values": [moments.first for moments in each],
        },
        schema=MOMENTS,
    )


def read_nodes(table: pa.Table) -> Iterator[tuple[str, Node]]:
    """Cell and node of each row."""
    for row in table.to_pylist():
        mean, inside = np.array(row["mean"]), np.array(row["inside"])
        q, u = len(mean), len(inside)
        moments = Moments(
            simulated=row["simulated"],
            converged=row["converged"],
            redundancy=row["redundancy"],
            mean=mean,
            comoment=np.reshape(row["comoment"], (q, q)),
            inside=inside,
            correlation_sum=np.reshape(row["correlation_sum"], (u, u)),
            first=np.array(row["first_values"]),
        )
        yield row["cell"], Node(row["first"], row["chunks"], moments)
