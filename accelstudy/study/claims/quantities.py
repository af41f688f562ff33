"""What the claims are about, measured: functions of the data that `claims.yaml` names.

Each returns `value`, with `low` and `high` where there is a 95 % interval, in the unit of the
claim, and further numbers that its rule or its sentence uses.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy import special

from accelstudy.basics.arrays import Array
from accelstudy.basics.shares import Z95
from accelstudy.basics.units import GON, MGON
from accelstudy.effects import get_effect
from accelstudy.leveling.angles import angles_of, specific_force
from accelstudy.leveling.sensitivity import leveling_sensitivity
from accelstudy.leveling.shares import order_changes
from accelstudy.study.config import APPROACHES

if TYPE_CHECKING:
    from accelstudy.study.claims.verdicts import ClaimData

Numbers = dict[str, Any]

DRAWS = 200_000
TILT = 50.0
"""Largest roll and pitch, in gon, of the attitudes over which shares are judged."""


def estimate(value: float, half: float, **others: Any) -> Numbers:
    """Return a number with half the width of its 95 % interval."""
    return {"value": value, "low": value - half, "high": value + half, **others}


# --- section 3.1: variance propagation -----------------------------------------------------------


def sd_of_tilt(
    data: ClaimData,
    angle: str = "roll",
    at_roll: float = 0,
    at_pitch: float = 0,
    noise: float = 1,
) -> Numbers:
    """Standard deviation, mgon, of an angle from simulated readings in an attitude given in gon."""
    study = data.study
    rng = np.random.default_rng(np.random.SeedSequence([study.seed, 31]))
    attitude = np.array([at_roll, at_pitch]) * GON
    force = np.array(specific_force(attitude[0], attitude[1], study.gravity_mps2))
    errors = noise * study.noise.sensor.sigma_mps2 * rng.standard_normal((DRAWS, 3))
    angles = (angles_of(force + errors) - attitude) / MGON
    sd = float(np.std(angles[:, ("roll", "pitch").index(angle)], ddof=1))
    theory = study.noise.sensor.sigma_mps2 / study.gravity_mps2 / MGON
    return estimate(sd, Z95 * sd / np.sqrt(2 * DRAWS), theory=theory)


def sd_ratio_of_noise(data: ClaimData, times: float, at_pitch: float) -> Numbers:
    """Standard deviation of roll at some times the noise, over that at the noise of the study."""
    one = sd_of_tilt(data, at_pitch=at_pitch)["value"]
    many = sd_of_tilt(data, at_pitch=at_pitch, noise=times)
    return {name: many[name] / one for name in ("value", "low", "high")}


# --- section 3.2: which inputs make roll and pitch uncertain -------------------------------------


def effect_of_force(data: ClaimData, force: str, at_roll: float) -> Numbers:
    """Total effect, %, of one force on roll, among the forces alone."""
    study, settings, table = data.study, data.settings, data.tables["sensitivity"]
    at = (table["roll_gon"] == at_roll) & (table["pitch_gon"] == 0)
    table = table[at & (table["analysis"] == "forces")]
    if table.empty:  # not on the grid of the study
        samples = settings.base_samples, study.seed
        noise, g = study.noise.sensor.sigma_mps2, study.gravity_mps2
        table = leveling_sensitivity([at_roll], [0], noise, *samples, g=g)
    return _largest(table[(table["output"] == "roll") & (table["input"] == force)])


def largest_effect(
    data: ClaimData,
    output: str,
    inputs: Sequence[str],
    max_roll: float = TILT,
    max_pitch: float = TILT,
    beside: str = "",
) -> Numbers:
    """Largest total effect, %, of the inputs that begin so; `everywhere`: over the whole grid."""
    grid = data.tables["sensitivity"]
    grid = grid[(grid["analysis"] == "gravity") & (grid["pitch_gon"] >= 0) & grid["defined"]]
    grid = grid[grid["output"] == output]
    of = grid["input"].str.startswith(tuple(inputs))
    within = (grid["roll_gon"].abs() <= max_roll) & (grid["pitch_gon"] <= max_pitch)
    numbers = {**_largest(grid[of & within]), "everywhere": _largest(grid[of])["value"]}
    if beside:
        numbers["beside"] = _largest(grid[within & (grid["input"] == beside)])["value"]
    return numbers


def _largest(rows: pd.DataFrame) -> Numbers:
    row = rows.iloc[int(rows["total_effect"].to_numpy().argmax())]
    return estimate(100 * float(row["total_effect"]), 100 * float(row["ci95"]))


def order_of_inputs(data: ClaimData) -> Numbers:
    """Share of attitudes, %, at which Shapley effects rank the inputs otherwise, and which."""
    shares, texts = zip(*(_order(data, approach) for approach in APPROACHES), strict=True)
    return {"value": shares[0], **dict(zip(APPROACHES, texts, strict=True))}


def _order(data: ClaimData, approach: str) -> tuple[float, str]:
    table, attitude = data.tables["shapley"], ["output", "roll_gon", "pitch_gon"]
    rows = table[(table["analysis"] == approach) & table["defined"].astype(bool)]
    points = 100 * float((rows["shapley_effect"] - rows["total_effect"]).abs().max())
    text = f"no share changes by more than {points:.2g} percentage points"
    pairs = order_changes(rows)
    if pairs.empty:
        return 0.0, f"no input overtakes another; {text}"
    rank = rows.groupby(attitude)["total_effect"].rank(ascending=False, method="first")
    ranked = rows.assign(over=rows["input"], rank=rank)[[*attitude, "over", "rank"]]
    first = pairs.merge(ranked)["rank"].min()
    winners, losers = (", ".join(sorted(set(pairs[column]))) for column in ("input", "over"))
    share = len(pairs[attitude].drop_duplicates()) / len(rows[attitude].drop_duplicates())
    return 100 * share, f"{winners} overtake {losers}, from rank {first:.0f} down; {text}"


# --- section 4: gravity-based against robot-aided calibration ------------------------------------


def mean_sd(
    data: ClaimData, effect: str, approach: str = "gravity", scheme: str = ""
) -> pd.DataFrame:
    """Mean sd a posteriori of the parameters of an effect, its standard error `se`, and `truth`."""
    rows = data.rows("summary", approach, scheme).set_index("parameter")
    names = {"sd_posteriori_mean": "sd", "sd_posteriori_se": "se", "truth": "truth"}
    parameters = [parameter.name for parameter in get_effect(effect).parameters]
    return rows.loc[parameters, [*names]].rename(columns=names).astype(float).abs()


def mean_reduction(data: ClaimData, effect: str, scheme: str = "") -> Numbers:
    """Reduction, %, of the mean sd a posteriori of an effect by the robot, in a scheme."""
    below, above = (mean_sd(data, effect, each, scheme).mean() for each in APPROACHES)
    left = 100 * above["sd"] / below["sd"]
    error = float(np.hypot(above["se"] / above["sd"], below["se"] / below["sd"]))
    return estimate(100 - left, Z95 * left * error)


def reduction(data: ClaimData, effect: str, paper: float) -> Numbers:
    """Return `mean_reduction` in the scheme of the claims, and what single simulations show.

    Without redundancy a scheme has no sd a posteriori, and does not count.
    """
    single = {
        scheme: single_reductions(data, effect, scheme, paper)
        for scheme in data.schemes
        if not np.isnan(mean_reduction(data, effect, scheme)["value"])
    }
    within = (name for name, s in single.items() if s["single_low"] <= paper <= s["single_high"])
    names = sorted(within)
    named = f" ({', '.join(names)})" if 0 < len(names) <= 4 else ""
    where = f"{len(names)} of {len(single)} schemes{named}"
    own = single[data.settings.scheme.name]
    return {**mean_reduction(data, effect), **own, "paper": paper, "where": where}


def single_reductions(data: ClaimData, effect: str, scheme: str, paper: float) -> Numbers:
    """Reductions, %, of the sd of an effect in single simulations: median and central 95 %.

    `percentile` is where the paper's number lies among them.
    The sd a posteriori of one calibration is its mean times σ̂0 over the mean of σ̂0, and the ratio
    of two independent σ̂0² of r degrees of freedom each has the F distribution.
    """
    freedom, sds = [], []
    for approach in APPROACHES:
        r = float(data.rows("cells", approach, scheme)["redundancy"].iloc[0])
        mean = np.exp(special.gammaln((r + 1) / 2) - special.gammaln(r / 2)) * np.sqrt(2 / r)
        freedom.append(r)
        sds.append(mean_sd(data, effect, approach, scheme)["sd"].mean() / mean)
    below, above = freedom
    ratio = sds[1] / sds[0]
    ends = 100 * (1 - ratio * np.sqrt(special.fdtri(above, below, [0.975, 0.5, 0.025])))
    percentile = 100 * special.fdtrc(above, below, ((1 - paper / 100) / ratio) ** 2)
    names = ("single_low", "median", "single_high", "percentile")
    return dict(zip(names, map(float, [*ends, percentile]), strict=True))


def pair_correlations(
    data: ClaimData,
    approach: str = "gravity",
    scheme: str = "",
    first: str = "",
    second: str = "",
    but_of: str = "",
) -> Array:
    """Mean |correlation|, from the adjustment, of pairs that begin with `first` and `second`.

    Without pairs of which both begin with `but_of`, if it is given.
    """
    rows = data.rows("correlations", approach, scheme)
    one, other = rows["parameter_1"].astype(str), rows["parameter_2"].astype(str)
    chosen = (one != other) & one.str.startswith(first) & other.str.startswith(second)
    if but_of:
        chosen &= ~(one.str.startswith(but_of) & other.str.startswith(but_of))
    return rows["adjustment"][chosen].abs().to_numpy(float)


def scale_pairs(data: ClaimData, approach: str, scheme: str = "") -> Array:
    """Mean |correlation| of each pair of scales."""
    return pair_correlations(data, approach, scheme, "s_", "s_")


def scale_correlation(data: ClaimData) -> Numbers:
    """Mean correlation of the scales, gravity-based, and its range over the schemes."""
    means = [float(scale_pairs(data, "gravity", scheme).mean()) for scheme in ("", *data.schemes)]
    return {"value": means[0], "least": min(means), "most": max(means)}


def scale_correlation_ratio(data: ClaimData) -> Numbers:
    """Mean correlation of the scales, gravity-based over robot-aided."""
    pairs = {approach: scale_pairs(data, approach) for approach in APPROACHES}
    means = {approach: float(each.mean()) for approach, each in pairs.items()}
    ends = {"least": pairs["robot"].min(), "most": pairs["robot"].max()}
    return {"value": means["gravity"] / means["robot"], **means, **ends}


def largest_correlation(data: ClaimData, **pairs: str) -> Numbers:
    """Largest gravity-based correlation of pairs as in `pair_correlations`."""
    return {"value": float(pair_correlations(data, **pairs).max())}


def truth_over_sd(data: ClaimData, effect: str) -> Numbers:
    """True parameters of an effect over their mean sd a posteriori, gravity-based."""
    rows = mean_sd(data, effect)
    ratios = (rows["truth"] / rows["sd"]).to_numpy()
    value = float(np.exp(np.log(ratios).mean()))
    half = Z95 * value * float((rows["se"] / rows["sd"]).mean())
    orders_off = float(np.abs(np.log10(ratios) - 2).max())
    return estimate(value, half, orders_off=orders_off, **dict(zip("xyz", ratios, strict=True)))


def sd_a_posteriori(data: ClaimData, effect: str) -> Numbers:
    """Mean sd a posteriori of an effect's parameters, gravity-based, also in % of the truth."""
    rows = mean_sd(data, effect)
    value, half = float(rows["sd"].mean()), Z95 * float(rows["se"].mean())
    return estimate(value, half, percent=100 * value / rows["truth"].min())


# --- slips ---------------------------------------------------------------------------------------


def redundancy(data: ClaimData) -> Numbers:
    """Redundancy with the robot; that without it stands where the paper's number does."""
    paper, value = (
        float(data.rows("cells", approach)["redundancy"].iloc[0]) for approach in APPROACHES
    )
    return {"paper": paper, "value": value}


def misclosure_as_printed(data: ClaimData, at_roll: float) -> Numbers:
    """Misclosure, gon, of a perfect sensor in the first condition of equation (10)."""
    force = specific_force(at_roll * GON, 0.0, data.study.gravity_mps2)
    return {"value": float(np.arctan2(force[1], -force[2]) / GON - at_roll)}
