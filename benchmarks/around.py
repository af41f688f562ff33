"""What diagnosis and import take, beside what one would compare them with."""

import sys
import tempfile
from pathlib import Path

import numpy as np

import accelstudy as acs
from accelstudy.approaches import get_approach
from accelstudy.campaign.format import write_campaign
from accelstudy.diagnosis.pipeline import diagnose
from log_memory import RATE, lines, write_log
from problem import MODEL
from processes import ACCELSTUDY, took
from timing import in_turns, short, spread, table
from ways import WAYS

ROUNDS = 3
HIDDEN = {"nothing": (), "hysteresis": ("hysteresis",)}
CAMPAIGNS, FITS = 10, 50
LOG = 100
"""MB."""
READ = "import sys, pandas; pandas.read_csv(sys.argv[1])"


def simulated(effects, seed):
    """36 positions with a robot, and all columns."""
    return acs.simulate_campaign(
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


def run():
    """[(what, how much, seconds (rounds,), seconds of the other (rounds,), the other, memory)]."""
    return [*diagnoses(), *commands()]


def diagnoses():
    """Diagnoses in a batch, beside least squares of the same campaigns."""
    loop, found = WAYS.get("scipy_jacobian")(get_approach("robot")), []
    for hidden, effects in HIDDEN.items():
        campaigns = [simulated(effects, seed) for seed in range(CAMPAIGNS)]
        works = {
            "diagnosis": lambda campaigns=campaigns: [diagnose(c, MODEL) for c in campaigns],
            "fit": lambda c=campaigns[0]: [loop.solve_one(c.forces, c.angles) for _ in range(FITS)],
        }
        seconds = in_turns(works, ROUNDS)
        found.append(
            (
                f"`diagnose` in a batch, hidden: {hidden}",
                "36 positions with a robot, all columns",
                seconds["diagnosis"] / CAMPAIGNS,
                seconds["fit"] / FITS,
                "one SciPy fit, analytic Jacobian",
                None,
            )
        )
    return found


def commands():
    """Commands as processes of their own, start of Python included."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        campaign, log = folder / "campaign", folder / "log.csv"
        write_campaign(simulated(HIDDEN["hysteresis"], 0), campaign)
        write_log(log, lines(), 1e6 * LOG)
        pairs = {
            "`accelstudy diagnose`, hidden: hysteresis": (
                "36 positions with a robot, all columns",
                lambda out: took(*ACCELSTUDY, "diagnose", campaign, "--out", out),
                lambda out: took(*ACCELSTUDY, "calibrate", campaign, "--out", out),
                "`accelstudy calibrate`",
            ),
            "`accelstudy import`": (
                f"log of {LOG} MB: threshold, holds, figure",
                lambda out: took(*ACCELSTUDY, "import", log, "--out", out, "--rate", RATE),
                lambda out: took(sys.executable, "-c", READ, log),
                "`pandas.read_csv`, and nothing else",
            ),
        }
        found = []
        for number, (what, (size, own, other, title)) in enumerate(pairs.items()):
            outs = [folder / f"{number}-{k}" for k in range(2 * ROUNDS)]
            ran = [(own(outs[2 * k]), other(outs[2 * k + 1])) for k in range(ROUNDS)]
            of_own, of_other = (np.array(each) for each in zip(*ran, strict=True))
            memory = of_own[:, 2], of_other[:, 2]
            found.append((what, size, of_own[:, 1], of_other[:, 1], title, memory))
    return found


def tables(rows):
    """One row for each."""
    head = ["what", "on", "processor time", "as much as", "memory"]
    texts = []
    for what, size, own, other, title, memory in rows:
        peak = "" if memory is None else f"{short(memory[0].max())} MB ({short(memory[1].max())})"
        times = f"{spread(own / other)} × {title}"
        texts.append([what, size, f"{short(np.median(own))} s", times, peak])
    return table(head, *texts)
