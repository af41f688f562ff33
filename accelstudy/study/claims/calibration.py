"""Claims of section 4: gravity-based against robot-aided calibration."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from accelstudy.effects import get_effect
from accelstudy.study.claims.base import Array, Claim, Evidence, SchemeClaim, verdict
from accelstudy.study.summary import Fits
from accelstudy.units import to_display

EFFECTS = {"bias": "bias", "scale": "scale", "nonorthogonality": "misalignment"}
"""Effect -> the paper's word for it."""
PAPER_REDUCTIONS = {"bias": 50.0, "scale": 30.0, "nonorthogonality": 70.0}
"""Reduction of the sd a posteriori by the robot, % (section 4.2)."""
PAPER_CORRELATION = 0.2


def claims_by_scheme(evidence: Evidence) -> list[SchemeClaim]:
    """Distribution of single simulations in every scheme."""
    return [*_reductions_by_scheme(evidence), *_correlations_by_scheme(evidence)]


def calibration_claims(evidence: Evidence, by_scheme: list[SchemeClaim]) -> Iterable[Claim]:
    """Judge the claims of section 4, given their distributions by scheme."""
    for effect, paper in PAPER_REDUCTIONS.items():
        yield _reduction_claim(evidence, by_scheme, effect, paper)
    yield from _correlation_claims(evidence, by_scheme)

    gravity = evidence.fits[evidence.scheme, "gravity"]
    for effect, text, limit in (
        ("bias", "σ_b is about two orders of magnitude below the true biases", 100.0),
        ("scale", "scales are poorly determinable: their sd against 200 ppm", np.nan),
        ("nonorthogonality", "gravity-based misalignments have very high errors", np.nan),
    ):
        columns = _columns(gravity, effect)
        sigma = gravity.sigma_posteriori[:, columns].mean(axis=0)
        error = 1.96 * gravity.sigma_posteriori[:, columns].std() / np.sqrt(len(gravity.estimates))
        truth = np.abs(gravity.truth[columns])
        unit = gravity.units[columns[0]]
        if effect == "bias":
            ratios = truth / sigma
            ours = float(np.exp(np.mean(np.log(ratios))))
            spread = ours * error / float(sigma.mean())
            yield Claim(
                "bias-determinable",
                "4.2",
                text,
                "ratio",
                limit,
                ours,
                ours - spread,
                ours + spread,
                verdict(bool(np.all(np.abs(np.log10(ratios) - 2) <= 0.5))),
                "Truth over sd is "
                + ", ".join(f"{ratio:.0f}" for ratio in ratios)
                + " for b_x, b_y, b_z: two orders for the largest bias, one for the smallest.",
            )
            continue
        mean = float(to_display(sigma.mean(), unit))
        half = float(to_display(error, unit))
        share = sigma.mean() / truth.min()
        yield Claim(
            f"{effect}-determinable",
            "4.2",
            text,
            "ppm" if effect == "scale" else "mgon",
            np.nan,
            mean,
            mean - half,
            mean + half,
            verdict(share > 1 / 3),
            f"The sd is {100 * share:.0f} % of the smallest true value.",
        )


def _reduction_claim(
    evidence: Evidence, by_scheme: list[SchemeClaim], effect: str, paper: float
) -> Claim:
    rows = [row for row in by_scheme if row.claim == f"reduction-{effect}"]
    row = next(row for row in rows if row.scheme == evidence.scheme)
    gravity, robot = _single_runs(evidence, evidence.scheme, effect)
    relative = np.hypot(
        robot.std() / robot.mean() / np.sqrt(len(robot)),
        gravity.std() / gravity.mean() / np.sqrt(len(gravity)),
    )
    half = 1.96 * (100 - row.mean) * relative
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
        f"On average {row.mean:.0f} %; single simulations show {row.single_low:.0f} to "
        f"{row.single_high:.0f} %, and the paper's number lies at their {row.percentile:.1f}th "
        f"percentile. It lies within the central 95 % in {len(others)} of {len(rows)} schemes"
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
        float(gravity.min()),
        float(gravity.max()),
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
        ours / float(robot.max()),
        ours / float(robot.min()),
        verdict(ratio >= 10 / np.sqrt(10)),
        f"From {ours:.2f} to {robot.mean():.3f}.",
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
            gravity, robot = _single_runs(evidence, scheme, effect)
            if not np.isfinite(gravity).all():
                continue  # no redundancy, no sigma a posteriori
            single = 100 * (1 - robot / gravity)
            low, median, high = np.quantile(single, [0.025, 0.5, 0.975]).tolist()
            mean = float(100 * (1 - robot.mean() / gravity.mean()))
            percentile = float(100 * np.mean(single < paper))
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


def _columns(fits: Fits, effect: str) -> list[int]:
    return [fits.names.index(p.name) for p in get_effect(effect).parameters]


def _single_runs(evidence: Evidence, scheme: str, effect: str) -> tuple[Array, Array]:
    """Mean sigma a posteriori of an effect's parameters per simulation: gravity, robot (SI)."""
    pair = []
    for approach in ("gravity", "robot"):
        fits = evidence.fits[scheme, approach]
        pair.append(fits.sigma_posteriori[:, _columns(fits, effect)].mean(axis=1))
    n = min(map(len, pair))
    return pair[0][:n], pair[1][:n]
