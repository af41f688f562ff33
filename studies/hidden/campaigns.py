"""A campaign of either study, from its case to a row: its truth, and what is said of it."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from accelstudy.adjustment.quality import Solution, column_basis
from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.result import CampaignDiagnosis
from accelstudy.effects import effects_without
from accelstudy.files.outputs import whole_file
from accelstudy.files.validation import validate
from accelstudy.sensors.models import get_model
from studies.hidden.baselines import METHODS, answers
from studies.hidden.physics.generate import Truth
from studies.hidden.real_noise import RealNoiseConfig
from studies.hidden.study import HiddenConfig, Row, removed

Config = HiddenConfig | RealNoiseConfig


def parse_hidden(content: Mapping[str, Any], source: str = "config") -> Config:
    """Check a configuration of either study; raise `InputError` with one line."""
    if not content:
        raise InputError("name a study: --configfile studies/hidden/config/hidden-effects.yaml")
    if "logs" in content:
        return validate(RealNoiseConfig, content, source)
    return validate(HiddenConfig, content, source)


def run(config: Config, job: str, path: str | Path) -> None:
    """Make and diagnose the campaigns of a job, and write their rows, one a line."""
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        for case, k in config.job(job):
            print(json.dumps(row_of(config, case, k)), file=file)


def read_rows(paths: Iterable[str | Path]) -> list[Row]:
    """Read the rows of jobs."""
    texts = (Path(path).read_text(encoding="utf-8") for path in paths)
    return [json.loads(line) for text in texts for line in text.splitlines()]


def row_of(config: Config, case: Any, k: int) -> Row:
    """Truth and answer of a campaign, of what JSON has.

    The diagnosis gets the campaign and nothing else. One that fails is a row with its error.
    """
    log, every = config.logs.get(case.design), config.baselines_every
    what, model = f"{case.name} {k}", get_model((log and log.model) or config.model)
    made, failed = tried(lambda: config.make(case, k), f"{what}: not made")
    campaign: Any
    campaign, truth = made or (None, Truth())
    methods = None
    with effects_without(removed(case)):
        answer, error = tried(
            lambda: outcome(diagnose(campaign, model, seed=config.diagnosis_seed)), what, failed
        )
        if every and int.from_bytes(case.digest(k)[:8]) % every == 0:
            told, _ = tried(lambda: dict(answers(campaign, model)), what, failed)
            # Where the model cannot be fitted, no method can work: each finds nothing.
            methods = told or dict.fromkeys(METHODS, (False, []))
    given = case.sigma_known if campaign is None else campaign.sigma_force is not None
    # No name is right for what a session cannot show or the catalogue lacks.
    known = truth.classes if case.set not in ("invisible", "outside", "unforeseen") else ()
    right = [[name for name in one if name not in removed(case)] for one in known]
    row = {
        "cell": case.name,
        "campaign": k,
        **{name: getattr(case, name) for name in ("set", "what", "size", "design", "approach")},
        "sigma": "given" if given else "not given",
        "recorded": getattr(case, "recorded", None),
        **asdict(truth),
        "classes": [one for one in right if one],
        **(answer or {}),
        "methods": methods,
        "error": error,
    }
    return dict(json.loads(json.dumps(row)))


def tried(work: Callable[[], Any], what: str, failed: str = "") -> tuple[Any, str]:
    """Return the result of a work and no error, or None and the error or that of an earlier one."""
    if failed:
        return None, failed
    try:
        return work(), ""
    except InputError as error:
        logging.info("%s: %s", what, error)
        return None, f"refused: {error}"
    except OSError:  # such as a full disk, which is no fault of this campaign
        raise
    except Exception as error:
        logging.exception("%s", what)
        return None, f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"


def outcome(d: CampaignDiagnosis) -> Row:
    """What a diagnosis says."""
    test, held = d.base_fit.global_test, d.confirmation.test
    certain = [part.names for part in d.finding.statement.certain if part.is_effect]
    fits = (d.base, d.final.solution) if d.verdict == "learned" else ()
    return {
        "verdict": d.verdict,
        "found": [one.name for one in d.effects],
        "specs": [one.spec for one in d.effects],
        "positions": [one.position for one in d.effects],
        "posteriors": [_rounded(one.posterior) for one in d.effects],
        "credible_set": [
            {"names": one.names, "classes": one.classes, "posterior": _rounded(one.posterior)}
            for one in d.credible_set
        ],
        "certain": [[name.name for name in names] for names in certain],
        "place": d.shape and d.shape.place,
        "fits": [fit_squares(one) for one in fits],
        "confirmed": d.confirmation.confirmed,
        "name_confirmed": d.confirmation.statement == "name",
        "held_out_z": None if held is None else float(held.z),
        "sigma0_before": float(d.variances["base"]),
        "sigma0_after": d.variances.get("extended"),
        "p_size": None if test is None else float(test.p_value),
    }


def fit_squares(solution: Solution) -> dict[str, Any]:
    """Sums of squares of the residuals of a fit, by kind, and what white noise leaves of them.

    With H = U Uᵀ of the conditions, U an orthonormal basis of the columns of Ã, residuals of unit
    weight have the sum of squares tr (I − H)² on average. Rows of Ã beside the conditions, those of
    parameters with a prior, only hold the parameters.
    """
    rows = solution.misclosures.size
    basis = column_basis(solution.design)[:rows]
    noise = rows - 2 * np.sum(basis**2) + np.sum((basis.T @ basis) ** 2)
    squares = np.sum(solution.residuals**2, axis=0)
    values = {"force": np.sum(squares[:3]), "angle": np.sum(squares[3:]), "noise": noise}
    return {name: _rounded(float(value)) for name, value in values.items()}


def _rounded(probability: float | None) -> float | None:
    return None if probability is None else float(f"{probability:.6g}")
