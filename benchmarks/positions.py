"""Cost of a calibration and of a diagnosis over the number of positions, as commands.

python benchmarks/positions.py [numbers of positions]
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from accelstudy.campaign.format import write_campaign
from accelstudy.campaign.session import Campaign
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from processes import ACCELSTUDY, took

FAMILY = 5000
"""Positions of one simulated session; of more, several sessions one after the other are made."""


def campaign(n: int, approach: str) -> Campaign:
    """Simulate n positions in an order of their own, with time and temperature."""
    parts = []
    for seed in range(-(-n // FAMILY)):
        settings = CampaignSettings(
            seed=seed,
            scheme=f"random-{min(n, FAMILY)}-{seed + 1}",
            approach=approach,
            temperature=(15.0, 40.0),
            temperature_order="ABBA",
        )
        parts.append(simulate_campaign(settings)[0])
    first = parts[0]

    def joined(name: str) -> np.ndarray | None:
        values = [getattr(part, name) for part in parts]
        return None if values[0] is None else np.concatenate(values)[:n]

    columns = {name: joined(name) for name in ("forces", "angles", "temperature", "yaw", "sd")}
    return replace(
        first, **columns, positions=1 + np.arange(n), time=60.0 * np.arange(n), n_samples=None
    )


def main(numbers: list[int]) -> None:
    """Print one row per command and number of positions."""
    titles = ("command", "approach", "positions", "wall / s", "CPU / s", "peak / MB", "ms / more")
    print(("{:>12}" * len(titles)).format(*titles))
    with tempfile.TemporaryDirectory() as folder:
        for approach in ("gravity", "robot"):
            for n in numbers:
                write_campaign(campaign(n, approach), Path(folder, f"{approach}-{n}"))
            for command in ("calibrate", "diagnose"):
                least = None
                for n in numbers:
                    source = Path(folder, f"{approach}-{n}")
                    out = Path(folder, f"{command}-{source.name}")
                    arguments = ("--approach", approach, "--out", out)
                    wall, cpu, peak = took(*ACCELSTUDY, command, source, *arguments)
                    least = least or (n, cpu)
                    further = 1e3 * (cpu - least[1]) / (n - least[0]) if n > least[0] else np.nan
                    print(f"{command:>12}{approach:>12}{n:>12}{wall:12.1f}{cpu:12.1f}{peak:12.0f}"
                          f"{further:12.2f}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main([int(argument) for argument in sys.argv[1:]] or [500, 5000])
