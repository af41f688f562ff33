"""The Monte Carlo itself: simulate and calibrate the replicates of a cell, chunk by chunk."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from accelstudy.files.tables import parquet_writer
from accelstudy.simulation.sessions import BLOCK
from accelstudy.study.batches import Share
from accelstudy.study.cell import CHUNK, Cell
from accelstudy.study.monte_carlo.control import Control
from accelstudy.study.monte_carlo.followed import cell_tilt_error
from accelstudy.study.monte_carlo.moments import MOMENTS, Node, Tree, moments_table
from accelstudy.study.monte_carlo.replicates import Pair, chunks
from accelstudy.study.monte_carlo.sketch import SKETCHES, sketch_table
from accelstudy.study.monte_carlo.summing import CellSketches, Summed

log = logging.getLogger(__name__)


_NAME = pa.dictionary(pa.int32(), pa.string())

ESTIMATES = pa.schema(
    {
        "cell": _NAME,
        "replicate": pa.int64(),
        "parameter": _NAME,
        "unit": _NAME,
        "truth": pa.float64(),
        "estimate": pa.float64(),
        "linear_estimate": pa.float64(),
        "sigma_priori": pa.float64(),
        "omega": pa.float64(),
        "linear_omega": pa.float64(),
        "redundancy": pa.int32(),
        "iterations": pa.int32(),
        "converged": pa.bool_(),
    }
)
"""One row per cell, replicate and parameter, SI. Columns that follow from these are not stored: the
error is estimate − truth, σ̂0² = omega / redundancy, and sigma_posteriori = σ̂0 · sigma_priori
(`read_estimates` adds them). `linear_estimate` and `linear_omega` are those of linear theory of the
same noise; null without a control. Columns that repeat within a replicate need next to no space."""


def simulate_batch(
    spec: Mapping[str, Any], outputs: Mapping[str, str | Path], provenance: Mapping[str, Any]
) -> None:
    """Simulate a job's share of the cells of a batch, chunk by chunk.

    Cells that are not estimable leave no rows; the table of cells says why.

    Parameters
    ----------
    spec : mapping with `seed`, `shares` (plain data of `accelstudy.study.batches.Share`) and
        `leveling` (max_tilt_gon and attitudes)
    outputs : paths of `moments`, and of `estimates`, where replicates are kept, or of `sketches`
    provenance : see `accelstudy.files.tables.origin`
    """
    shares = [Share.from_dict(data) for data in spec["shares"]]
    measured = ("estimate", "linear_estimate", "sigma_priori")
    with ExitStack() as files:

        def opened(name: str, schema: pa.Schema, **options: Any) -> Callable[[pa.Table], None]:
            if name not in outputs:
                return lambda table: None
            return files.enter_context(parquet_writer(outputs[name], schema, provenance, **options))

        write_moments = opened("moments", MOMENTS)
        write_sketches = opened("sketches", SKETCHES)
        write_estimates = opened("estimates", ESTIMATES, measured=measured)
        for number, share in enumerate(shares, 1):
            cell = share.cell
            design = cell.estimability
            if not design.estimable:
                log.info("%d/%d %s: %s", number, len(shares), cell.name, design.reason)
                continue
            tilt = cell_tilt_error(cell, spec["leveling"])
            control = Control.of(cell, tilt)
            centre, drawn = chunks(cell, spec["seed"], share.first, share.count, control)
            summed = Summed(cell, control, tilt, centre)
            tree, sketches = Tree(), CellSketches(summed.distributed)
            for index, chunk in drawn:
                tree.add(Node(index, 1, summed.moments(chunk)))
                if "sketches" in outputs:
                    sketches.add(chunk)
                if "estimates" in outputs:
                    write_estimates(_estimates_table(cell, chunk, index * CHUNK * BLOCK))
            write_moments(moments_table(cell.name, tree))
            if "sketches" in outputs:
                write_sketches(sketch_table(cell.name, sketches.by_key))
            counts = tree.nodes
            log.info(
                "%d/%d %s: %d replicates, %d not converged",
                number,
                len(shares),
                cell.name,
                sum(node.moments.simulated for node in counts),
                sum(node.moments.simulated - node.moments.converged for node in counts),
            )


def _estimates_table(cell: Cell, pair: Pair, first: int) -> pa.Table:
    """Rows of a chunk whose first replicate has the number `first`."""
    units = cell.parameter_units
    chunk, linear = pair
    n_replicates, u = chunk.estimates.shape

    def per_replicate(values: Any) -> Any:
        return np.repeat(values, u)

    def per_parameter(values: list[Any]) -> Any:
        return np.tile(values, n_replicates)

    columns = {
        "cell": _coded(np.zeros(n_replicates * u), [cell.name]),
        "replicate": per_replicate(np.arange(first, first + n_replicates)),
        "parameter": _coded(per_parameter(list(range(u))), list(units)),
        "unit": _coded(per_parameter(list(range(u))), list(units.values())),
        "truth": per_parameter([*cell.true_values]),
        "estimate": chunk.estimates.ravel(),
        "linear_estimate": None if linear is None else linear.estimates.ravel(),
        "sigma_priori": chunk.sigma_priori.ravel(),
        "omega": per_replicate(chunk.omega),
        "linear_omega": None if linear is None else per_replicate(linear.omega),
        "redundancy": np.full(n_replicates * u, chunk.redundancy),
        "iterations": per_replicate(chunk.iterations),
        "converged": per_replicate(chunk.converged),
    }
    missing = pa.nulls(n_replicates * u, pa.float64())
    whole = {name: missing if each is None else each for name, each in columns.items()}
    return pa.table(whole, schema=ESTIMATES)


def _coded(codes: Any, names: list[str]) -> pa.DictionaryArray:
    return pa.DictionaryArray.from_arrays(pa.array(codes, pa.int32()), pa.array(names))
