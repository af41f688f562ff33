"""A design as a YAML file that records how it was made; a configuration takes it as a scheme."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from accelstudy.basics.units import to_recorded
from accelstudy.design.optimal.search import rounded
from accelstudy.design.optimal.spaces import attitudes

Array = NDArray[np.float64]


def write_design(
    path: Path,
    name: str,
    title: str,
    source: str,
    directions: Array,
    made: Mapping[str, Any],
    columns: Mapping[str, Sequence[Any]] | None = None,
) -> None:
    """Write a scheme that `accelstudy.schemes.get_scheme` reads.

    Parameters
    ----------
    path : Path
    name, title, source : str, of the scheme
    directions : (n, 3) array of unit vectors
    made : mapping, plain data: how it was made, and how good it is
    columns : mapping of name to n values, optional, further columns of the positions
    """
    roll, pitch = (to_recorded(attitudes(directions), "rad") / 1000).T
    positions = [
        {
            "position": i + 1,
            "roll_gon": _gon(roll[i]),
            "pitch_gon": _gon(pitch[i]),
            **{key: values[i] for key, values in (columns or {}).items()},
        }
        for i in range(len(directions))
    ]
    content = {
        "scheme": name,
        "title": title,
        "source": source,
        "design": dict(made),
        "positions": positions,
        "directions": rounded(directions).tolist(),
    }
    head = (
        "# Positions for a calibration, in the order in which to take them. Any configuration and\n"
        "# command takes this file as a scheme; `directions` is what counts: gravity in the body\n"
        "# frame.\n"
    )
    text = yaml.safe_dump(
        content, sort_keys=False, allow_unicode=True, default_flow_style=None, width=100
    )
    path.write_text(head + text, encoding="utf-8")


def _gon(angle: float) -> float:
    return round(float(angle), 3) + 0.0
