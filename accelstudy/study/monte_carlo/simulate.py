"""The Monte Carlo itself: simulate and calibrate the replicates of a cell, chunk by chunk."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.design.estimability import estimability
from accelstudy.files.tables import parquet_writer
from accelstudy.leveling.error import TiltError
from accelstudy.simulation.sessions import BLOCK, session
from accelstudy.study.batches import Share
from accelstudy.study.cell import CHUNK, Cell
from accelstudy.study.compiling import calibrator
from accelstudy.study.monte_carlo.followed import CellSketches, Followed, cell_tilt_error
from accelstudy.study.monte_carlo.moments import MOMENTS, Node, Tree, moments_table
from accelstudy.study.monte_carlo.sketch import SKETCHES, sketch_table

Array = NDArray[np.float64]

log = logging.getLogger(__name__)


def blocks(cell: Cell, seed: int, first: int, count: int) -> Iterator[Block]:
    """Simulate and calibrate blocks of an estimable cell, one after another.

    Parameters
    ----------
    cell : Cell
    seed : int, of the study
    first, count : int, number of the first block, from 0 on, and how many are asked for; there are
        no more than `Cell.n_blocks`
    """
    simulated, estimated = cell.simulated_model, cell.estimated_model
    calibrate = calibrator(cell)
    ideal = session(
        simulated,
        simulated.vector(cell.truth),
        cell.positions.directions,
        cell.gravity,
        cell.hold,
    )
    drawn = ideal.draw_blocks(
        cell.noise,
        cell.replicates,
        range(first, min(first + count, cell.n_blocks)),
        lambda block: np.random.default_rng(cell.seed(seed, block)),
        BLOCK,
        angles=cell.conditions.uses_angles,
    )
    for observed in drawn:
        yield calibrate(estimated, cell.conditions, observed)


_NAME = pa.dictionary(pa.int32(), pa.string())

ESTIMATES = pa.schema(
    {
        "cell": _NAME,
        "replicate": pa.int64(),
        "parameter": _NAME,
        "unit": _NAME,
        "truth": pa.float64(),
        "estimate": pa.float64(),
        "sigma_priori": pa.float64(),
        "omega": pa.float64(),
        "redundancy": pa.int32(),
        "iterations": pa.int32(),
        "converged": pa.bool_(),
    }
)
"""One row per cell, replicate and parameter, SI. Columns that follow from these are not stored: the
error is estimate − truth, σ̂0² = omega / redundancy, and sigma_posteriori = σ̂0 · sigma_priori
(`read_estimates` adds them). Columns that repeat within a replicate need next to no space."""


def simulate_batch(
    spec: Mapping[str, Any], outputs: Mapping[str, str | Path], provenance: Mapping[str, Any]
) -> None:
    """Simulate a job's share of the cells of a batch, chunk by chunk.

    Cells that are not estimable leave no rows; the table of cells says why.

    Parameters
    ----------
    spec : mapping with `seed`, `shares` (plain data of `accelstudy.study.batches.Share`)
        and, for `sketches`, `leveling` (max_tilt_gon and attitudes)
    outputs : paths of `moments`, and of `estimates`, where replicates are kept, or of `sketches`
    provenance : see `accelstudy.files.tables.origin`
    """
    shares = [Share.from_dict(data) for data in spec["shares"]]
    measured = ("estimate", "sigma_priori")
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
            design = estimability(
                cell.positions,
                cell.estimated_model,
                cell.conditions,
                cell.noise,
                gravity=cell.gravity,
                hold=cell.hold,
            )
            if not design.estimable:
                log.info("%d/%d %s: %s", number, len(shares), cell.name, design.reason)
                continue
            followed, tree = Followed.of(cell), Tree()
            sketches = None
            if "sketches" in outputs:
                sketches = CellSketches(followed, _pilot_tilt(cell, spec["seed"], spec["leveling"]))
            for index, chunk in _chunks(share, spec["seed"]):
                values = followed.values(chunk)
                tree.add(Node(index, 1, followed.moments(chunk, values)))
                if sketches is not None:
                    sketches.add(chunk, values)
                if "estimates" in outputs:
                    write_estimates(_estimates_table(cell, chunk, index * CHUNK * BLOCK))
            write_moments(moments_table(cell.name, tree))
            if sketches is not None:
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


def _chunks(share: Share, seed: int) -> Iterator[tuple[int, Block]]:
    """Number and content of each chunk of a share."""
    drawn = blocks(share.cell, seed, share.first * CHUNK, share.count * CHUNK)
    for index in range(share.first, share.first + share.count):
        yield index, Block.joined(islice(drawn, CHUNK))


def _pilot_tilt(cell: Cell, seed: int, leveling: Mapping[str, Any]) -> TiltError | None:
    """Tilt error about the mean of the first block of a cell in which a calibration converged.

    It is the same in all jobs. It is None if no calibration of the first chunk converged.
    """
    for block in blocks(cell, seed, 0, CHUNK):
        if block.converged.any():
            return cell_tilt_error(cell, block.estimates[block.converged].mean(axis=0), leveling)
    return None


def _estimates_table(cell: Cell, chunk: Block, first: int) -> pa.Table:
    """Rows of a chunk whose first replicate has the number `first`."""
    units = cell.parameter_units
    n_replicates, u = chunk.estimates.shape
    truth = {**cell.truth, "g": cell.gravity}

    def per_replicate(values: Any) -> Any:
        return np.repeat(values, u)

    def per_parameter(values: list[Any]) -> Any:
        return np.tile(values, n_replicates)

    columns = {
        "cell": _coded(np.zeros(n_replicates * u), [cell.name]),
        "replicate": per_replicate(np.arange(first, first + n_replicates)),
        "parameter": _coded(per_parameter(list(range(u))), list(units)),
        "unit": _coded(per_parameter(list(range(u))), list(units.values())),
        "truth": per_parameter([truth.get(name, 0.0) for name in units]),
        "estimate": chunk.estimates.ravel(),
        "sigma_priori": chunk.sigma_priori.ravel(),
        "omega": per_replicate(chunk.omega),
        "redundancy": np.full(n_replicates * u, chunk.redundancy),
        "iterations": per_replicate(chunk.iterations),
        "converged": per_replicate(chunk.converged),
    }
    return pa.table(columns, schema=ESTIMATES)


def _coded(codes: Any, names: list[str]) -> pa.DictionaryArray:
    return pa.DictionaryArray.from_arrays(pa.array(codes, pa.int32()), pa.array(names))
