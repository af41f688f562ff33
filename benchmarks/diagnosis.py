"""Time of one diagnosis: by the command, start-up included, and inside a batch.

python benchmarks/diagnosis.py [campaigns of each kind]
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from accelstudy.campaign.format import write_campaign
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.sensors.models import get_model
from processes import ACCELSTUDY, took

HIDDEN = {
    "nothing": (),
    "an effect": ("hysteresis",),
    "an effect with a setting": ("warm_up",),
    "two effects": ("base_tilt", "hysteresis"),
}
COMMANDS = 3


def settings(effects: tuple[str, ...], seed: int) -> CampaignSettings:
    """36 positions with a robot, and all columns."""
    return CampaignSettings(
        seed=seed,
        scheme="fibonacci-30",
        repeat_first=6,
        order="random",
        temperature=(15.0, 40.0),
        temperature_order="ABBA",
        vibration=(0.0, 1.0),
        yaw="random",
        n_samples=200,
        effects=effects,
    )


def main(count: int) -> None:
    """Print the medians and the ranges."""
    model = get_model("bias-scale-nonorthogonality")
    print(f"{'hidden':26}{'batch / s':>22}{'command / s':>22}")
    for kind, effects in HIDDEN.items():
        campaigns = [simulate_campaign(settings(effects, seed))[0] for seed in range(count + 1)]
        times = []
        for campaign in campaigns:
            start = time.perf_counter()
            diagnose(campaign, model)
            times.append(time.perf_counter() - start)
        with tempfile.TemporaryDirectory() as folder:
            write_campaign(campaigns[0], Path(folder, "campaign"))
            commands = [
                took(*ACCELSTUDY, "diagnose", f"{folder}/campaign", "--out", f"{folder}/{k}").wall
                for k in range(COMMANDS)
            ]
        # The first of a batch generates the functions of the models.
        columns = (shown(values) for values in (times[1:], commands))
        print(f"{kind:26}" + "".join(f"{column:>22}" for column in columns))


def shown(values: list[float]) -> str:
    """Median and range."""
    return f"{np.median(values):.2f} ({min(values):.2f} - {max(values):.2f})"


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
