"""Tables of a plan."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from accelstudy.data_sheets import get_data_sheet


def sensor_table(sensors: Sequence[str], seconds: Sequence[float]) -> pd.DataFrame:
    """How well the mean of a hold is known, for each sensor and duration, SI."""
    return pd.DataFrame(
        {
            "sensor": sheet.name,
            "title": sheet.title,
            "source": sheet.source,
            "seconds": duration,
            "sigma_mean": sheet.sigma_mean(duration),
            "unknown": ", ".join(sheet.unknown),
        }
        for sheet in map(get_data_sheet, sensors)
        for duration in seconds
    )
