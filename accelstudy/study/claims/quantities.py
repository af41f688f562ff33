"""What the claims are about, measured: functions of the evidence that `claims.yaml` names.

Each returns `value`, with `low` and `high` where there is a 95 % interval, in the unit of the
claim, and further numbers that its rule or its sentence uses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import special

from accelstudy.basics.shares import Z95
from accelstudy.basics.units import GON, MGON
from accelstudy.effects import get_effect
from accelstudy.leveling.angles import angles_of, specific_force
from accelstudy.leveling.sensitivity import leveling_sensitivity
from accelstudy.leveling.shares import overtaken
from accelstudy.study.config import Study
from accelstudy.study.config.blocks import SensitivityConfig

Array = NDArray[np.float64]
Numbers = dict[str, Any]

DRAWS = 200_000
APPROACHES = ("gravity", "robot")
TILT = 50.0
"""Largest roll and pitch, in gon, of the attitudes over which shares are judged."""


@dataclass(frozen=True)
class Evidence:
    """What the claims are judged by.

    Attributes
    ----------
    study : Study, with `sensitivity`
    tables : mapping of name to DataFrame: cells, summary, correlations, sensitivity and shapley
    reductions : DataFrame, see `accelstudy.study.claims.reductions`
    by_scheme : DataFrame, what single simulations show in each scheme; empty while it is made
    """

    study: Study
    tables: Mapping[str, pd.DataFrame]
    reductions: pd.DataFrame
    by_scheme: pd.DataFrame

    @property
    def settings(self) -> SensitivityConfig:
        """Settings of the sensitivity analysis: its model and scheme are those of the claims."""
        assert self.study.sensitivity is not None
        return self.study.sensitivity

    @cached_property
    def schemes(self) -> list[str]:
        """Schemes in which both approaches were simulated with the model of the claims."""
        cells = self.tables["cells"]
        done = set(cells["cell"][cells["estimable"].astype(bool) & (cells["n_replicates"] > 0)])
        names = dict.fromkeys(cells["scheme"].astype(str))
        return [s for s in names if all(self.settings.cell(a, s) in done for a in APPROACHES)]

    def rows(self, table: str, approach: str, scheme: str = "") -> pd.DataFrame:
        """Rows of a table that are of one cell."""
        rows = self.tables[table]
        return rows[rows["cell"] == self.settings.cell(approach, scheme)]

    @cached_property
    def effects_of_forces(self) -> pd.DataFrame:
        """Total effects of the forces alone on roll and pitch."""
        settings = self.settings
        return leveling_sensitivity(
            [0, 30, 50],
            [0],
            self.study.sigma_force,
            settings.base_samples,
            settings.resamples,
            self.study.seed,
            g=self.study.gravity_mps2,
        )


# --- section 3.1: variance propagation -----------------------------------------------------------


def sd_of_tilt(
    evidence: Evidence,
    angle: str = "roll",
    at_roll: float = 0,
    at_pitch: float = 0,
    noise: float = 1,
) -> Numbers:
    """Standard deviation, mgon, of an angle from simulated readings in an attitude given in gon."""
    study = evidence.study
    rng = np.random.default_rng(np.random.SeedSequence([study.seed, 31]))
    attitude = np.array([at_roll, at_pitch]) * GON
    force = np.array(specific_force(attitude[0], attitude[1], study.gravity_mps2))
    errors = noise * study.sigma_force * rng.standard_normal((DRAWS, 3))
    values = ((angles_of(force + errors) - attitude) / MGON)[:, ("roll", "pitch").index(angle)]
    sd, freedom = float(np.std(values, ddof=1)), DRAWS - 1
    # Quantiles of χ²; scipy.stats has them too, but is slow to import.
    low, high = sd * np.sqrt(freedom / (2 * special.gammaincinv(freedom / 2, [0.975, 0.025])))
    theory = study.sigma_force / study.gravity_mps2 / MGON
    return {"value": sd, "low": low, "high": high, "theory": theory}


def sd_ratio_of_noise(evidence: Evidence, times: float, at_pitch: float) -> Numbers:
    """Standard deviation of roll at some times the noise, over that at the noise of the study."""
    one = sd_of_tilt(evidence, at_pitch=at_pitch)["value"]
    many = sd_of_tilt(evidence, at_pitch=at_pitch, noise=times)
    return {name: many[name] / one for name in ("value", "low", "high")}


# --- section 3.2: which inputs make roll and pitch uncertain -------------------------------------


def effect_of_force(evidence: Evidence, force: str, at_roll: float) -> Numbers:
    """Total effect, %, of one force on roll, among the forces alone."""
    table = evidence.effects_of_forces
    at = (table["output"] == "roll") & (table["roll_gon"] == at_roll) & (table["input"] == force)
    return _largest(table[at])


def largest_effect(
    evidence: Evidence,
    output: str,
    inputs: Sequence[str],
    max_roll: float = TILT,
    max_pitch: float = TILT,
    beside: str = "",
) -> Numbers:
    """Largest total effect, %, of the inputs that begin so; `everywhere`: over the whole grid."""
    grid = evidence.tables["sensitivity"]
    grid = grid[(grid["analysis"] == "gravity") & (grid["pitch_gon"] >= 0) & grid["defined"]]
    grid = grid[grid["output"] == output]
    of = grid["input"].str.startswith(tuple(inputs))
    within = (grid["roll_gon"].abs() <= max_roll) & (grid["pitch_gon"] <= max_pitch)
    numbers = {**_largest(grid[of & within]), "everywhere": _largest(grid[of])["value"]}
    if beside:
        numbers["beside"] = _largest(grid[within & (grid["input"] == beside)])["value"]
    return numbers


def order_of_inputs(evidence: Evidence) -> Numbers:
    """Share of attitudes, %, at which Shapley effects rank the inputs otherwise, and which."""
    return {
        "value": _order(evidence, "gravity")[0],
        **{name: _order(evidence, name)[1] for name in APPROACHES},
    }


def _order(evidence: Evidence, approach: str) -> tuple[float, str]:
    table, attitude = evidence.tables["shapley"], ["output", "roll_gon", "pitch_gon"]
    rows = table[(table["analysis"] == approach) & table["defined"].astype(bool)]
    points = 100 * float((rows["shapley_effect"] - rows["total_effect"]).abs().max())
    text = f"no share changes by more than {points:.2g} percentage points"
    pairs = overtaken(rows)
    if pairs.empty:
        return 0.0, f"no input overtakes another; {text}"
    rank = rows.groupby(attitude)["total_effect"].rank(ascending=False, method="first")
    ranked = rows.assign(over=rows["input"], rank=rank)[[*attitude, "over", "rank"]]
    first = pairs.merge(ranked, on=[*attitude, "over"])["rank"].min()
    winners, losers = (", ".join(sorted(set(pairs[column]))) for column in ("input", "over"))
    share = len(pairs[attitude].drop_duplicates()) / len(rows[attitude].drop_duplicates())
    return 100 * share, f"{winners} overtake {losers}, from rank {first:.0f} down; {text}"


def _largest(rows: pd.DataFrame) -> Numbers:
    """Largest total effect, %, with its 95 % confidence interval."""
    row = rows.iloc[int(rows["total_effect"].to_numpy().argmax())]
    value, half = 100 * float(row["total_effect"]), 100 * float(row["ci95"])
    return {"value": value, "low": value - half, "high": value + half}


# --- section 4: gravity-based against robot-aided calibration ------------------------------------


def reduction(evidence: Evidence, effect: str) -> Numbers:
    """Reduction, %, of the mean sd a posteriori of an effect by the robot."""
    table = evidence.by_scheme[evidence.by_scheme["claim"] == f"reduction-{effect}"]
    row = table[table["scheme"] == evidence.settings.scheme.name].iloc[0]
    means = reductions(evidence, effect)
    half = float(means["half"][means["scheme"] == evidence.settings.scheme.name].iloc[0])
    inside = table["single_low"].le(table["paper"]) & table["single_high"].ge(table["paper"])
    names = sorted(table["scheme"][inside])
    named = f" ({', '.join(names)})" if 0 < len(names) <= 4 else ""
    return {
        **{"value": row["mean"], "low": row["mean"] - half, "high": row["mean"] + half},
        **{name: row[name] for name in ("single_low", "single_high", "percentile")},
        "where": f"{len(names)} of {len(table)} schemes{named}",
    }


def reductions(evidence: Evidence, of: str) -> pd.DataFrame:
    """Reductions of the sd of an effect in single simulations, a row each scheme."""
    table = evidence.reductions
    return table[(table["effect"] == of) & table["scheme"].isin(evidence.schemes)]


def scale_correlations(evidence: Evidence, of: str) -> pd.DataFrame:
    """Correlations of the pairs of scales with an approach, a row each scheme."""
    values = {scheme: _scale_pairs(evidence, of, scheme) for scheme in evidence.schemes}
    names = {"mean": "mean", "single_low": "min", "median": "median", "single_high": "max"}
    rows = [
        {"scheme": scheme, **{name: getattr(np, how)(pairs) for name, how in names.items()}}
        for scheme, pairs in values.items()
    ]
    return pd.DataFrame(rows).assign(percentile=np.nan)


def scale_correlation(evidence: Evidence) -> Numbers:
    """Mean correlation of the scales, gravity-based, and its range over the schemes."""
    rows = evidence.by_scheme[evidence.by_scheme["claim"] == "scale-correlation-gravity"]
    value = float(_scale_pairs(evidence, "gravity").mean())
    return {"value": value, "least": rows["mean"].min(), "most": rows["mean"].max()}


def scale_correlation_ratio(evidence: Evidence) -> Numbers:
    """Mean correlation of the scales, gravity-based over robot-aided."""
    gravity, robot = (_scale_pairs(evidence, approach) for approach in APPROACHES)
    means = {"gravity": float(gravity.mean()), "robot": float(robot.mean())}
    value = means["gravity"] / means["robot"]
    return {"value": value, **means, "least": robot.min(), "most": robot.max()}


def largest_correlation(
    evidence: Evidence, but_of: str = "", first: str = "", second: str = ""
) -> Numbers:
    """Largest gravity-based correlation of parameters that begin so, without pairs `but_of`."""
    rows = evidence.rows("correlations", "gravity")
    one, other = rows["parameter_1"].astype(str), rows["parameter_2"].astype(str)
    chosen = (one != other) & one.str.startswith(first) & other.str.startswith(second)
    if but_of:
        chosen &= ~(one.str.startswith(but_of) & other.str.startswith(but_of))
    return {"value": float(rows.loc[chosen, "adjustment"].abs().max())}


def _scale_pairs(evidence: Evidence, approach: str, scheme: str = "") -> Array:
    """Mean |correlation| of each pair of scales, from the adjustment."""
    rows = evidence.rows("correlations", approach, scheme)
    one, other = rows["parameter_1"].astype(str), rows["parameter_2"].astype(str)
    pairs = one.str.startswith("s_") & other.str.startswith("s_") & (one != other)
    return np.abs(rows.loc[pairs, "adjustment"].to_numpy(float))


def truth_over_sd(evidence: Evidence, effect: str) -> Numbers:
    """True parameters of an effect over their mean sd a posteriori, gravity-based."""
    sd, error, truth = _sds(evidence, effect)
    ratios = truth / sd
    value = float(np.exp(np.mean(np.log(ratios))))
    half = Z95 * value * float(np.mean(error / sd))
    return {
        **{"value": value, "low": value - half, "high": value + half},
        **dict(zip("xyz", ratios, strict=True)),
        "orders_off": float(np.abs(np.log10(ratios) - 2).max()),
    }


def sd_a_posteriori(evidence: Evidence, effect: str) -> Numbers:
    """Mean sd a posteriori of an effect's parameters, gravity-based, also in % of the truth."""
    sd, error, truth = _sds(evidence, effect)
    value, half = float(sd.mean()), Z95 * float(error.mean())
    percent = 100 * value / truth.min()
    return {"value": value, "low": value - half, "high": value + half, "percent": percent}


def _sds(evidence: Evidence, effect: str) -> tuple[Array, Array, Array]:
    """Mean sd a posteriori of each gravity-based parameter, its standard error, the |truth|."""
    rows = evidence.rows("summary", "gravity").set_index("parameter")
    rows = rows.loc[[parameter.name for parameter in get_effect(effect).parameters]]
    columns = rows[["sd_posteriori_mean", "sd_posteriori_se", "truth"]].to_numpy(float).T
    return columns[0], columns[1], np.abs(columns[2])


# --- slips ---------------------------------------------------------------------------------------


def redundancy(evidence: Evidence) -> Numbers:
    """Redundancy with the robot; that without it stands where the paper's number does."""
    paper, value = (
        float(evidence.rows("cells", approach)["redundancy"].iloc[0]) for approach in APPROACHES
    )
    return {"paper": paper, "value": value}


def misclosure_as_printed(evidence: Evidence, at_roll: float) -> Numbers:
    """Misclosure, gon, of a perfect sensor in the first condition of equation (10)."""
    force = specific_force(at_roll * GON, 0.0, evidence.study.gravity_mps2)
    return {"value": float(np.arctan2(force[1], -force[2]) / GON - at_roll)}
