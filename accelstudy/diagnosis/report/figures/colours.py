"""The colours that the figures of a diagnosis share."""

from __future__ import annotations

BEFORE, AFTER, NOISE = "#D55E00", "#0072B2", "#E6E6E6"
OTHER = "#999999"
