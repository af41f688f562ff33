"""What the page about public measurements quotes of them: diagnoses, limits, and other numbers."""

from collections.abc import Iterator
from functools import cache

import numpy as np
from places import DATA
from scipy import optimize
from usual import NINE

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import shown_unit
from accelstudy.basics.wording import amount, number, probability, words
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.public import import_settings, public_data, public_file
from accelstudy.diagnosis.evidence.noise import force_residuals
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.words import verdict_lines
from accelstudy.diagnosis.result import CampaignDiagnosis
from accelstudy.effects import get_effect

WHITE, UNKNOWN = "white", "not given"
SIGMAS = {"xsens-mti": ("", WHITE, UNKNOWN)}
"""Which sigmas a campaign is diagnosed with; the others with that of its import."""
QUOTED = {"ck-explorer": "", "xsens-mti": WHITE}
LONGEST = "lis3dh-phone"
"""Its diagnosis takes longer than all others, so that it belongs to the part `logs`."""


def texts() -> Iterator[tuple[str, str]]:
    """All that the page quotes, but for the measurement that takes longest."""
    rows, small = [], []
    for name, data in public_data().items():
        if data.settings is None or name == LONGEST:
            continue
        try:
            rows += [row(name, sigma) for sigma in SIGMAS.get(name, ("",))]
        except InputError as error:
            small.append(f"* `{name}`: {str(error).split(': ')[1]}")
    yield "verdicts", lines(rows)
    yield "too-small", lines(small)
    yield "limits", lines(limit_rows())
    for name, sigma in QUOTED.items():
        yield name, lines(verdict(name, sigma))
    innalabs = diagnosed("innalabs-49")
    numbers = {**nonlinearity(), **blocks(), **y_axis(innalabs)}
    invisible = innalabs.frame.tested.invisible
    numbers["effects that no campaign shows"] = ", ".join(map(words, invisible))
    yield "numbers", lines(f"{what}: {said}" for what, said in numbers.items())


def of_the_longest() -> Iterator[tuple[str, str]]:
    """What the page quotes of it."""
    yield f"{LONGEST}-row", lines([row(LONGEST)])
    yield f"{LONGEST}-verdict", lines(verdict(LONGEST))


def lines(said):
    return "".join(f"{line}\n" for line in said)


@cache
def imported(name):
    return import_log(public_file(name, DATA), import_settings(name))


@cache
def diagnosed(name: str, sigma: str = "") -> CampaignDiagnosis:
    campaign, _ = imported(name)
    if sigma == WHITE:
        campaign = campaign.with_sigma(0.000296)
    elif sigma == UNKNOWN:
        campaign = campaign.with_sigma(None)
    return diagnose(campaign, NINE)


def row(name, variant=""):
    """The row of a diagnosis in the table of verdicts."""
    d = diagnosed(name, variant)
    sigma = d.campaign.sigma_force
    shown = "" if sigma is None else number(1e3 * float(np.mean(sigma)))
    given = f"{shown}, {variant or 'Allan'}" if shown else UNKNOWN
    test = d.base_fit.global_test
    size = probability(test and test.p_value)
    pattern = probability(d.problem.p_value if d.problem.field.names else None)
    said = f"`{d.verdict}`" + "".join(f": {words(f.name)}" for f in d.found)
    cells = (f"`{name}`", d.campaign.n_positions, d.base.redundancy, given, size, pattern, said)
    return f"| {' | '.join(map(str, cells))} |"


def verdict(name, variant=""):
    return verdict_lines(diagnosed(name, variant))[:-1]


def limit_rows():
    """The table of upper limits: largest typical size, Xsens, and worst of the MPU-9150."""
    sensors = ["xsens-mti"], [f"mpu9150-{i}" for i in range(3)]
    limits = [
        [{limit.name: limit.value for limit in diagnosed(name).upper_limits} for name in names]
        for names in sensors
    ]
    for effect in limits[0][0]:
        known = get_effect(effect)
        unit = known.parameters[0].unit
        values = max(known.typical), *(max(one[effect] for one in ones) for ones in limits)
        shown = [f"{amount(value, unit)} {shown_unit(unit)}" for value in values]
        yield f"| {words(effect)} | {' | '.join(shown)} |"


def nonlinearity():
    """F tests of the norm, by a solver that shares nothing with the diagnosis, and the latter."""
    forces, g = imported("ck-explorer")[0].forces, 9.80665

    def squares(*forms):
        def misclosures(p):
            t = np.array([[p[0], p[1], p[2]], [0, p[3], p[4]], [0, 0, p[5]]])
            felt = forces - p[6:9]
            for k, form in enumerate(forms, 3):
                felt = felt - p[3 * k : 3 * k + 3] * form
            return np.linalg.norm(felt @ t.T, axis=1) - g

        start = np.r_[1.0, 0, 0, 1, 0, 1, np.zeros(3 + 3 * len(forms))]
        return 2 * optimize.least_squares(misclosures, start).cost

    n, base = len(forces), squares()
    terms = {"quadratic terms": forces**2 / g, "cubic terms": forces**3 / g**2,
             "scale asymmetries": 2 * np.maximum(forces, 0) - forces}  # fmt: skip
    left = {name: squares(form) for name, form in terms.items()}
    said = {f"F of {name}": number((base / one - 1) * (n - 12) / 3) for name, one in left.items()}
    for name, one in (("before", base), ("after", left["quadratic terms"])):
        said[f"rms {name}"] = number(1e3 * float(np.sqrt(one / n)))
    d = diagnosed("ck-explorer")
    (y,) = (one.value for one in d.found[0].parameters if one.name == "k2_y")
    said["reading of y less"] = number(-1e3 * y * g)
    posteriors = {one.names: one.posterior for one in d.credible_set}
    said["posterior of the asymmetry"] = number(posteriors["scale_asymmetry",])
    said["posterior of an even nonlinearity"] = number(d.finding.statement.certain[0].posterior)
    return said


def blocks():
    """How firmly the blocks were held."""
    path = public_file("ck-explorer", DATA)
    samples = 9.80665 * np.loadtxt(path, delimiter=",", skiprows=1).reshape(160, 100, 3)
    sd = np.sqrt(np.mean(samples.var(axis=1, ddof=1), axis=1))
    off = samples - samples.mean(axis=1, keepdims=True)
    beside = np.sum(off[:, 1:] * off[:, :-1], axis=1) / np.sum(off**2, axis=1)
    order, correlated = np.argsort(sd), beside.mean(axis=1)
    accuracy = imported("ck-explorer")[1].noise.accuracy
    return {
        "least sd": number(sd.min()), "largest sd": number(sd.max()),
        "correlation in noisy blocks": number(correlated[order[-20:]].mean()),
        "correlation in quiet blocks": number(correlated[order[:20]].mean()),
        "ratio to white noise": number(accuracy.ratio),
    }  # fmt: skip


def y_axis(d):
    """What the y axis of the Innalabs leaves."""
    y, residuals = d.campaign.forces[:, 1] / d.campaign.gravity, 1e3 * d.base.misclosures[:, 0]
    carried, down = np.abs(y) > 0.8, residuals[y < -0.95]
    squares = np.sum(force_residuals(d.problem.at(d.final).residuals) ** 2, axis=0)
    shares = dict(zip("xyz", squares / squares.sum(), strict=True))
    rms = [number(float(np.sqrt(np.mean(residuals[r] ** 2)))) for r in (carried, ~carried)]
    return {
        "positions in which y carries more": str(np.count_nonzero(carried)),
        "rms in these": rms[0], "rms in the others": rms[1],
        **{f"share of {axis}": number(each) for axis, each in shares.items()},
        "least at y down": number(down.min()), "largest at y down": number(down.max()),
    }  # fmt: skip
