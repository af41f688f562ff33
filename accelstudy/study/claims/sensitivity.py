"""Claims of section 3.2: which inputs make roll and pitch uncertain."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd

from accelstudy.leveling.sensitivity import leveling_sensitivity
from accelstudy.leveling.shares import overtaken
from accelstudy.study.claims.base import Claim, Evidence, register, verdict

TILT = 50.0
"""Largest roll and pitch, in gon, of the attitudes over which the claims are judged."""


@register
def sensitivity_claims(evidence: Evidence) -> Iterable[Claim]:
    """Judge the claims of section 3.2."""
    table = leveling_sensitivity(
        [0, 30, 50],
        [0],
        evidence.cell.noise.sigma_force,
        evidence.base_samples,
        evidence.resamples,
        evidence.seed,
        g=evidence.cell.gravity,
    )

    def effect(output: str, roll: float, name: str) -> tuple[float, float, float]:
        rows = table[
            (table["output"] == output) & (table["roll_gon"] == roll) & (table["input"] == name)
        ]
        return _largest_effect(rows)

    ours = effect("roll", 50, "f_x")
    yield Claim(
        "f_x-roll",
        "3.2",
        "f_x does not influence roll",
        "%",
        0.0,
        *ours,
        verdict(ours[0] == 0),
        "Roll does not contain f_x.",
    )
    ours = effect("roll", 50, "f_y")
    yield Claim(
        "f_y-f_z-50gon",
        "3.2",
        "f_y and f_z matter equally for roll at a roll of 50 gon",
        "%",
        50.0,
        *ours,
        verdict(ours[1] <= 50 <= ours[2]),
        "cos²φ = sin²φ = 1/2 at 50 gon.",
    )
    ours = effect("roll", 30, "f_z")
    yield Claim(
        "f_z-small-tilt",
        "3.2",
        "f_z is inessential for both angles below a tilt of 30 gon",
        "%",
        np.nan,
        *ours,
        verdict(ours[0] < 10),
        f"At 30 gon f_z has {ours[0]:.0f} % of the variance of roll (sin²φ); it stays below 10 % "
        "up to 20 gon only.",
    )

    grid = evidence.sensitivity
    grid = grid[(grid["analysis"] == "gravity") & (grid["pitch_gon"] >= 0) & grid["defined"]]

    def largest(
        output: str, prefix: tuple[str, ...], up_to: float = np.inf
    ) -> tuple[float, float, float]:
        """Find the largest share of the named inputs within a range of roll and pitch."""
        within = (grid["roll_gon"].abs() <= up_to) & (grid["pitch_gon"] <= up_to)
        named = grid["input"].str.startswith(prefix)
        return _largest_effect(grid[(grid["output"] == output) & within & named])

    force = largest("roll", ("f_y",), up_to=0)[0]
    ours = largest("roll", ("alpha_zx",), up_to=0)
    yield Claim(
        "alpha_zx-roll",
        "3.2",
        "α_zx has a big share of the variance of roll",
        "%",
        np.nan,
        *ours,
        verdict(ours[0] > 10),
        f"At level α_zx has {ours[0]:.0f} % beside {force:.0f} % of f_y.",
    )
    ours = largest("roll", ("b_", "s_"), up_to=TILT)
    everywhere = largest("roll", ("b_", "s_"))
    yield Claim(
        "bias-scale-roll",
        "3.2",
        "biases and scales have about 1 to 8 % of the variance of roll",
        "%",
        8.0,
        *ours,
        verdict(abs(ours[0] - 8) <= 1.5),
        f"The largest share of a bias or scale is {ours[0]:.1f} % up to {TILT:.0f} gon of roll and "
        f"pitch, and {everywhere[0]:.1f} % over the whole grid.",
    )
    ours = largest("pitch", ("s_",), up_to=TILT)
    yield Claim(
        "scale-pitch",
        "3.2",
        "scales stay below 3 % of the variance of pitch",
        "%",
        3.0,
        *ours,
        verdict(ours[1] < 3),
        f"The largest share of a scale is {ours[0]:.1f} % up to {TILT:.0f} gon of roll and pitch.",
    )
    yield _order_of_inputs(evidence.shapley)


def _order_of_inputs(table: pd.DataFrame) -> Claim:
    """Judge whether total effects rank the inputs as Shapley effects do."""
    output = ["output", "roll_gon", "pitch_gon"]

    def changes(approach: str) -> tuple[float, str]:
        rows = table[(table["analysis"] == approach) & table["defined"].astype(bool)]
        points = 100 * float((rows["shapley_effect"] - rows["total_effect"]).abs().max())
        text = f"no share changes by more than {points:.2g} percentage points"
        pairs = overtaken(rows)
        if pairs.empty:
            return 0.0, f"no input overtakes another; {text}"
        rank = rows.groupby(output)["total_effect"].rank(ascending=False, method="first")
        ranked = rows.assign(over=rows["input"], rank=rank)[[*output, "over", "rank"]]
        first = pairs.merge(ranked, on=[*output, "over"])["rank"].min()
        winners, losers = (", ".join(sorted(set(pairs[column]))) for column in ("input", "over"))
        share = len(pairs[output].drop_duplicates()) / len(rows[output].drop_duplicates())
        return 100 * share, f"{winners} overtake {losers}, from rank {first:.0f} down; {text}"

    ours, sentence = changes("gravity")
    return Claim(
        "order-of-inputs",
        "3.2",
        "total effects rank the inputs as Shapley effects do, which count the correlations of the "
        "parameters (share of attitudes at which they do not)",
        "%",
        np.nan,
        ours,
        np.nan,
        np.nan,
        verdict(ours == 0),
        f"With gravity alone {sentence}. With the robot {changes('robot')[1]}.",
    )


def _largest_effect(rows: pd.DataFrame) -> tuple[float, float, float]:
    """Largest total effect in % with its 95 % confidence interval."""
    at = int(rows["total_effect"].to_numpy().argmax())
    value = 100 * float(rows["total_effect"].iloc[at])
    half = 100 * float(rows["ci95"].iloc[at])
    return value, value - half, value + half
