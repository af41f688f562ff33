"""Sketches: quantiles of any number of values from counts in buckets, with bounded memory.

A bucket is the sign, the exponent and the first `BITS` bits of the mantissa of a number. So its
width is a thousandth of the values in it. The counts are integers: they do not depend on the order
in which values are counted and sketches are merged. The sketches of libraries (KLL, t-digest) are
random or depend on that order, so they cannot be used here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

BITS = 10
RELATIVE_ERROR = 2.0**-BITS
"""Bound of the relative error of a quantile: 0.1 %. Where values are dense, it is far smaller."""
LEAST = 2.0**-60
"""Smaller values count as zero; the quantities of a study, in SI, are larger by orders."""

_SHIFT = 52 - BITS
_ORIGIN = int(np.float64(LEAST).view(np.int64)) >> _SHIFT

SKETCHES = pa.schema(
    {
        "cell": pa.dictionary(pa.int32(), pa.string()),
        "quantity": pa.dictionary(pa.int32(), pa.string()),
        "name": pa.dictionary(pa.int32(), pa.string()),
        "bucket": pa.int32(),
        "count": pa.int64(),
    }
)
"""One row per bucket that is not empty; `Sketch.edges` gives the edges of a bucket."""

Key = tuple[str, str]
"""Quantity and name, as of `accelstudy.study.monte_carlo.followed`."""


class Sketch:
    """Counts of values in buckets.

    Parameters
    ----------
    lowest : int, number of the first bucket; negative for negative values, 0 for zero
    counts : (k,) int array, of this bucket and those that follow
    """

    def __init__(self, lowest: int = 0, counts: Counts | None = None) -> None:
        self.lowest = lowest
        self.counts = np.zeros(0, np.int64) if counts is None else counts

    @classmethod
    def of(cls, values: ArrayLike) -> Sketch:
        """Return the sketch of some values."""
        sketch = cls()
        sketch.add(values)
        return sketch

    @property
    def total(self) -> int:
        """Number of values."""
        return int(self.counts.sum())

    def add(self, values: ArrayLike) -> None:
        """Count values, none of them NaN."""
        buckets = _bucket(np.ravel(np.asarray(values, dtype=float)))
        if len(buckets):
            lowest = int(buckets.min())
            self._add(lowest, np.bincount(buckets - lowest).astype(np.int64))

    def merge(self, other: Sketch) -> None:
        """Add the counts of another sketch."""
        if len(other.counts):
            self._add(other.lowest, other.counts)

    def _add(self, lowest: int, counts: Counts) -> None:
        if not len(self.counts):
            self.lowest, self.counts = lowest, counts.copy()
            return
        first = min(self.lowest, lowest)
        end = max(self.lowest + len(self.counts), lowest + len(counts))
        if end - first > len(self.counts):
            grown = np.zeros(end - first, np.int64)
            grown[self.lowest - first :][: len(self.counts)] = self.counts
            self.lowest, self.counts = first, grown
        self.counts[lowest - first :][: len(counts)] += counts

    def quantile(self, probabilities: ArrayLike) -> Array:
        """Quantiles, as `numpy.quantile` defines them, within `RELATIVE_ERROR`; NaN if empty."""
        wanted = np.asarray(probabilities, dtype=float)
        if not self.total:
            return np.full(wanted.shape, np.nan)
        rank = wanted * (self.total - 1)
        below = np.floor(rank)
        low, high = self._ordered(below), self._ordered(np.ceil(rank))
        return low + (rank - below) * (high - low)

    def share_below(self, values: ArrayLike) -> Array:
        """Share of the values below given ones; values are taken as evenly spread in a bucket."""
        low, high = self.edges()
        upto = np.cumsum(self.counts) / self.total
        return np.interp(
            np.asarray(values, dtype=float), np.append(low[0], high), np.append(0.0, upto)
        )

    def _ordered(self, rank: Array) -> Array:
        """Values by their rank; values are taken as evenly spread in a bucket."""
        upto = np.cumsum(self.counts)
        at = np.searchsorted(upto, rank, side="right")
        share = (rank - (upto[at] - self.counts[at]) + 0.5) / self.counts[at]
        low, high = self.edges()
        return low[at] + share * (high[at] - low[at])

    def edges(self) -> tuple[Array, Array]:
        """Lower and upper edge of each bucket, (k,) each."""
        number = self.lowest + np.arange(len(self.counts))
        near, far = _edge(np.abs(number)), _edge(np.abs(number) + 1)
        return np.where(number > 0, near, -far), np.where(number < 0, -near, far)

    def occupied(self) -> tuple[Array, Counts]:
        """Middle and count of each bucket that is not empty."""
        held = np.flatnonzero(self.counts)
        low, high = self.edges()
        return (low[held] + high[held]) / 2, self.counts[held]


def _bucket(values: Array) -> Counts:
    number = (np.abs(values).view(np.int64) >> _SHIFT) - (_ORIGIN - 1)
    np.maximum(number, 0, out=number)
    return np.where(values < 0, -number, number)


def _edge(number: Counts) -> Array:
    """Lower edge of the bucket of a positive number."""
    return ((number - 1 + _ORIGIN) << _SHIFT).view(np.float64)


def sketch_table(cell: str, sketches: Mapping[Key, Sketch]) -> pa.Table:
    """Rows of the sketches of one cell."""
    held = {key: np.flatnonzero(sketch.counts) for key, sketch in sketches.items()}
    sizes = [len(buckets) for buckets in held.values()]
    pairs = zip(held.values(), sketches.values(), strict=True)
    numbers = [(buckets + sketch.lowest, sketch.counts[buckets]) for buckets, sketch in pairs]

    def coded(codes: ArrayLike, labels: list[str]) -> pa.DictionaryArray:
        return pa.DictionaryArray.from_arrays(pa.array(codes, pa.int32()), pa.array(labels))

    which = np.repeat(np.arange(len(sizes)), sizes)
    empty = np.zeros(0, np.int64)
    return pa.table(
        {
            "cell": coded(np.zeros(len(which)), [cell]),
            "quantity": coded(which, [quantity for quantity, _ in held]),
            "name": coded(which, [name for _, name in held]),
            "bucket": np.concatenate([empty, *(number for number, _ in numbers)]),
            "count": np.concatenate([empty, *(count for _, count in numbers)]),
        },
        schema=SKETCHES,
    )


def merged_sketches(tables: Iterable[pa.Table]) -> dict[Key, Sketch]:
    """Sketches of one cell from rows of `sketch_table` of its parts, in any order."""
    sketches: dict[Key, Sketch] = {}
    for table in tables:
        rows = table.to_pandas()
        for key, group in rows.groupby(["quantity", "name"], observed=True, sort=False):
            buckets = group["bucket"].to_numpy(np.int64)
            lowest = int(buckets.min())
            counts = np.zeros(int(buckets.max()) - lowest + 1, np.int64)
            counts[buckets - lowest] = group["count"].to_numpy()
            sketches.setdefault((str(key[0]), str(key[1])), Sketch()).merge(Sketch(lowest, counts))
    return sketches
