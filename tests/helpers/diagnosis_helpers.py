"""Simulated campaigns for the tests of the diagnosis, and fits of ideal sensors."""

from dataclasses import replace

import numpy as np
from scipy.stats import binom
from usual import NINE, ROBOT, G

import accelstudy as acs
from accelstudy.adjustment.quality import solve
from accelstudy.diagnosis.decision.posterior import Explanation
from accelstudy.diagnosis.decision.problem import BaseFit, pose
from accelstudy.diagnosis.evidence.candidates import Cause
from accelstudy.diagnosis.evidence.size import Level
from accelstudy.diagnosis.file_format import DiagnosisDocument
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.effects import HoldConditions
from accelstudy.schemes import get_scheme
from accelstudy.simulation.sessions import Noise, session

FULL = {
    **{"scheme": "fibonacci-30", "repeat_first": 6, "order": "random", "interval": 60.0},
    **{"temperature": (10.0, 40.0), "temperature_order": "ABBA", "vibration": (0.0, 2.0)},
    **{"yaw": "random", "n_samples": 500},
}
"""A campaign with all columns, in which no effect of the catalogue hides behind another, but a
thermal curve behind a thermal bias: there are two temperatures."""


def campaign(seed=1, **keys):
    """A simulated campaign with all columns; `keys` change the settings."""
    return acs.simulate_campaign(seed=seed, **{**FULL, **keys})


def some_holds(n, seed=3, **columns):
    """Holds with everything that is not implied by the attitudes, at random."""
    rng = np.random.default_rng(seed)
    known = {
        "temperature": rng.uniform(10, 40, n),
        "time": 60.0 * np.arange(n),
        "vibration": rng.uniform(0, 2, n),
        "yaw": rng.uniform(-np.pi, np.pi, n),
    }
    return HoldConditions(**{**known, **columns})


def shuffled(scheme, seed=4):
    return np.random.default_rng(seed).permutation(get_scheme(scheme).directions)


def design(directions, approach=ROBOT, hold=None, model=NINE, noise=None, seed=None):
    """The fit of a session of an ideal sensor: without noise, or with noise of a seed."""
    noise = noise or Noise()
    ideal = session(model, np.zeros(model.n_parameters), directions, G, hold)
    if seed is None:
        observed = ideal.observations(noise)
    else:
        observed = ideal.draw(noise, 1, np.random.default_rng(seed))
    return SessionFit.of(solve(model, approach, observed))


def posed(approach, observed, level=None):
    """The problem of a session, whose sigma is known or of a given level of knowledge."""
    return pose(BaseFit(solve(NINE, approach, observed), level or Level.of_stated_sigma(), None))


def explanation(text, log_weight=np.nan, posterior=np.nan, best=()):
    """Explanation by "one+two", where = joins names that mean the same; it may have shapes."""
    members = [tuple(part.split("=")) for part in text.split("+")]
    shapes = best or [None] * len(members)
    causes = tuple(Cause(m[0], m, shape) for m, shape in zip(members, shapes, strict=True))
    return Explanation(causes, log_weight, posterior)


def otherwise(diagnosis, finding=None, **told):
    """The diagnosis with another finding, or with other things that follow from it."""
    changed = replace(diagnosis, finding=finding or diagnosis.finding)
    vars(changed).update(told)
    return changed


def assert_consistent(content):
    """The content of a diagnosis.json fits its model, and its keys do not contradict each other."""
    assert DiagnosisDocument.content(content) == content
    verdict, effects, gap = content["verdict"], content["effects"], content["gap"]
    assert bool(effects) != (verdict in ("no_effect", "unknown"))
    assert len(effects) <= 3 or verdict not in ("named", "narrowed")
    if verdict not in ("noise_model", "gross_error"):
        assert bool(content["credible_set"]) != (verdict == "no_effect")
    learned = verdict == "learned"
    assert (content["shape"] is not None) == learned
    assert not learned or effects[0]["name"] == "learned"
    statement, names = gap["confirmed_statement"], gap["confirmed_names"]
    assert gap["confirmed"] == (statement is not None)
    assert (statement == "name") == (len(names) == 1)
    assert not gap["confirmed"] or gap["held_out_z"] is not None
    assert gap["confirmed"] or not names


def most(count, level, error=1e-4):
    """Number of rejections in `count` tests at `level` that is exceeded with `error` only."""
    return int(binom.isf(error, count, level))


def least(count, level, error=1e-4):
    """Number of rejections that is undercut with `error` only."""
    return int(binom.ppf(error, count, level))
