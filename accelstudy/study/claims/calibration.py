"""Claims of section 4: gravity-based against robot-aided calibration."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from accelstudy.basics.units import recorded_unit, to_recorded
from accelstudy.effects import get_effect
from accelstudy.study.claims.base import Array, Claim, Evidence, SchemeClaim, register, verdict
from accelstudy.study.monte_carlo.distributions import PROBABILITIES
from accelstudy.study.monte_carlo.followed import EFFECT, POSTERIORI

EFFECTS = {"bias": "bias", "scale": "scale", "nonorthogonality": "misalignment"}
"""Effect -> the paper's word for it."""
PAPER_REDUCTIONS = {"bias": 50.0, "scale": 30.0, "nonorthogonality": 70.0}
"""Reduction of the sd a posteriori by the robot, % (section 4.2)."""
PAPER_CORRELATION = 0.2


@register
def calibration_claims(evidence: Evidence) -> Iterable[Claim | SchemeClaim]:
    """Judge the claims of section 4, and give their distributions in every scheme."""
    by_scheme = [*_reductions_by_scheme(evidence), *_correlations_by_scheme(evidence)]
    yield from by_scheme
    for effect, paper in PAPER_REDUCTIONS.items():
        yield _reduction_claim(evidence, by_scheme, effect, paper)
    yield from _correlation_claims(evidence, by_scheme)
    yield _bias_claim(evidence)
    yield _poorly_determined_claim(
        evidence, "scale", "scales are poorly determinable: their sd against 200 ppm"
    )
    yield _poorly_determined_claim(
        evidence, "nonorthogonality", "gravity-based misalignments have very high errors"
    )


def _mean_sigma(evidence: Evidence, effect: str) -> tuple[Array, Array, Array]:
    """Mean sigma a posteriori of each gravity-based parameter, its standard error, the truth."""
    statistics = evidence.statistics[evidence.scheme, "gravity"]
    columns = statistics.followed.effects[effect]
    mean = statistics.mean(POSTERIORI)[columns]
    return mean.value, mean.error, np.abs(statistics.followed.truth[columns])


def _bias_claim(evidence: Evidence) -> Claim:
    sigma, error, truth = _mean_sigma(evidence, "bias")
    ratios = truth / sigma
    ours = float(np.exp(np.mean(np.log(ratios))))
    half = 1.96 * ours * float(np.mean(error / sigma))
    return Claim(
        "bias-determinable",
        "4.2",
        "σ_b is about two orders of magnitude below the true biases (geometric mean of truth / σ)",
        "ratio",
        100.0,
        ours,
        ours - half,
        ours + half,
        verdict(bool(np.all(np.abs(np.log10(ratios) - 2) <= 0.5))),
        "Truth over sd is "
        + ", ".join(f"{ratio:.0f}" for ratio in ratios)
        + " for b_x, b_y, b_z: two orders for the largest bias, one for the smallest.",
    )


def _poorly_determined_claim(evidence: Evidence, effect: str, statement: str) -> Claim:
    sigma, error, truth = _mean_sigma(evidence, effect)
    unit = get_effect(effect).parameters[0].unit
    ours, half = (float(to_recorded(value.mean(), unit)) for value in (sigma, 1.96 * error))
    share = sigma.mean() / truth.min()
    return Claim(
        f"{effect}-determinable",
        "4.2",
        statement,
        recorded_unit(unit),
        np.nan,
        ours,
        ours - half,
        ours + half,
        verdict(share > 1 / 3),
        f"The sd is {100 * share:.0f} % of the smallest true value.",
    )


def _reduction_claim(
    evidence: Evidence, by_scheme: list[SchemeClaim], effect: str, paper: float
) -> Claim:
    rows = [row for row in by_scheme if row.claim == f"reduction-{effect}"]
    row = next(row for row in rows if row.scheme == evidence.scheme)
    (gravity, error_gravity), (robot, error_robot) = _mean_sigmas(evidence, row.scheme, effect)
    half = 1.96 * (100 - row.mean) * np.hypot(error_robot / robot, error_gravity / gravity)
    inside = row.single_low <= paper <= row.single_high
    others = sorted(r.scheme for r in rows if r.single_low <= paper <= r.single_high)
    return Claim(
        row.claim,
        "4.2",
        f"the robot reduces the sd of the {EFFECTS[effect]} by about {paper:.0f} %",
        "%",
        paper,
        row.mean,
        row.mean - half,
        row.mean + half,
        verdict(inside or abs(row.mean - paper) <= 5),
        f"On average {row.mean:.0f} %; 95 % of single simulations show "
        f"{row.single_low:.0f} to {row.single_high:.0f} %".replace("-", "−")
        + f", and {row.percentile:.1f} % of them less than the paper's number. It lies within the "
        f"central 95 % in {len(others)} of {len(rows)} schemes"
        + (f" ({', '.join(others)})." if 0 < len(others) <= 4 else "."),
        row.single_low,
        row.single_high,
        row.percentile,
    )


def _correlation_claims(evidence: Evidence, by_scheme: list[SchemeClaim]) -> Iterable[Claim]:
    gravity = _scale_correlations(evidence, evidence.scheme, "gravity")
    robot = _scale_correlations(evidence, evidence.scheme, "robot")
    ours = float(gravity.mean())
    per_scheme = [r.mean for r in by_scheme if r.claim == "scale-correlation-gravity"]
    yield Claim(
        "scale-correlation-gravity",
        "4.2",
        "gravity-based scales are correlated by about 0.2",
        "1",
        PAPER_CORRELATION,
        ours,
        np.nan,
        np.nan,
        verdict(round(abs(ours - PAPER_CORRELATION), 3) <= 0.05),
        f"3m/(1 − 3m) = {ours:.2f} for an isotropic scheme, at the edge of what rounds to 0.2, and "
        f"the same in every run; {min(per_scheme):.2f} to {max(per_scheme):.2f} over all schemes.",
    )
    ratio = ours / float(robot.mean())
    yield Claim(
        "scale-correlation-robot",
        "4.2",
        "the robot reduces that correlation by one order of magnitude",
        "ratio",
        10.0,
        ratio,
        np.nan,
        np.nan,
        verdict(ratio >= 10 / np.sqrt(10)),
        f"From {ours:.2f} to {robot.mean():.3f} (pairs: {robot.min():.3f} to {robot.max():.3f}), "
        "more than one order.",
    )
    rows = evidence.correlations[evidence.correlations["cell"] == evidence.cell.name]
    first, second = rows["parameter_1"].astype(str), rows["parameter_2"].astype(str)
    scales = first.str.startswith("s_") & second.str.startswith("s_")
    rest = float(rows.loc[~scales & (first != second), "adjustment"].abs().max())
    yield Claim(
        "nearly-uncorrelated",
        "4.2",
        "all other gravity-based parameters are nearly uncorrelated",
        "1",
        0.0,
        rest,
        np.nan,
        np.nan,
        verdict(rest < 0.05),
        f"The largest of the other correlations is {rest:.4f}.",
    )


def _reductions_by_scheme(evidence: Evidence) -> Iterable[SchemeClaim]:
    for effect, paper in PAPER_REDUCTIONS.items():
        for scheme in evidence.schemes:
            if (scheme, effect) not in evidence.ratios:
                continue  # no redundancy, no sigma a posteriori
            ratio = evidence.ratios[scheme, effect]
            central = [PROBABILITIES.tolist().index(p) for p in (0.975, 0.5, 0.025)]
            low, median, high = (100 * (1 - ratio.quantile(np.array(central)).value)).tolist()
            (gravity, _), (robot, _) = _mean_sigmas(evidence, scheme, effect)
            mean = 100 * (1 - robot / gravity)
            percentile = float(100 * (1 - ratio.share_below(1 - paper / 100)))
            yield SchemeClaim(
                f"reduction-{effect}", scheme, paper, mean, low, median, high, percentile
            )


def _scale_correlations(evidence: Evidence, scheme: str, approach: str) -> Array:
    """Mean |correlation| of pairs of scales, from the adjustment."""
    rows = evidence.correlations
    rows = rows[rows["cell"] == evidence.cells[scheme, approach].name]
    pairs = rows[
        rows["parameter_1"].astype(str).str.startswith("s_")
        & rows["parameter_2"].astype(str).str.startswith("s_")
        & (rows["parameter_1"].astype(str) != rows["parameter_2"].astype(str))
    ]
    return np.abs(pairs["adjustment"].to_numpy())


def _correlations_by_scheme(evidence: Evidence) -> Iterable[SchemeClaim]:
    for approach, paper in (("gravity", PAPER_CORRELATION), ("robot", PAPER_CORRELATION / 10)):
        for scheme in evidence.schemes:
            values = _scale_correlations(evidence, scheme, approach)
            yield SchemeClaim(
                f"scale-correlation-{approach}",
                scheme,
                paper,
                float(values.mean()),
                float(values.min()),
                float(np.median(values)),
                float(values.max()),
                np.nan,
            )


def _mean_sigmas(evidence: Evidence, scheme: str, effect: str) -> list[tuple[float, float]]:
    """Mean sigma a posteriori of an effect with its standard error (SI): gravity, robot."""
    sigmas = []
    for approach in ("gravity", "robot"):
        statistics = evidence.statistics[scheme, approach]
        at = list(statistics.followed.effects).index(effect)
        mean = statistics.mean(EFFECT)[at]
        sigmas.append((float(mean.value), float(mean.error)))
    return sigmas
