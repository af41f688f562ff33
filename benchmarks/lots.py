"""How well lots are judged: simulated lots of 20 sensors, each with a truth the judgement lacks.

    python benchmarks/lots.py [LOTS] [SEED]       # 40 lots of each kind: half an hour of two cores

Prints, for each kind, how often something is found, named rightly (and by an oracle that knows all
but the name, and always gives one) and named wrongly, how often intervals of shares hold them, how
many sensors are judged rightly, and how often sensors are odd. Each lot has a design, an approach
and an effect at random. Of lots of mixed noise some sensors were held for a second and others for a
minute, and all, none or half of them state their sigma; if nothing is missing, each sensor has a
design of its own as well.
"""

import logging
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest

from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.lots.evidence import Sensor
from accelstudy.lots.lot import weigh_lot
from accelstudy.sensors.models import get_model
from studies.hidden.physics.designs import APPROACHES, DESIGNS
from studies.hidden.physics.generate import Case
from studies.hidden.physics.lots import LotCase, generate_lot, lot_oracle
from studies.hidden.physics.measuring import NOISES
from studies.hidden.physics.oracle import oracle, visible_outside
from studies.hidden.scoring.judging import all_true, same_effects
from studies.hidden.study import distinct_pairs
from timing import table

MODEL = "bias-scale-nonorthogonality"
SENSORS = 20
MIXED = (0.15, 1.0)
"""Factors of the noise of position means."""
UNNAMED = "unknown"


@dataclass(frozen=True)
class Kind:
    """A row of the table: what the model of a lot lacks, in which share, and how large it is."""

    title: str
    choices: Callable[[str, str], list[tuple[str, ...]]] = lambda design, approach: [()]
    shares: tuple[float, ...] = ()
    lam: float = 0.0
    named: bool = True
    noises: tuple[str, ...] = ()
    mixed: bool = False


def single(design, approach):
    """Effects that a session shows."""
    return [(name,) for name in oracle(design, approach).visible]


def pairs(design, approach):
    """Two effects that a session shows and tells apart, in either order."""
    told = distinct_pairs(design, approach)
    return [*told, *(pair[::-1] for pair in told)]


def elsewhere(design, approach):
    """Physics that is not in the catalogue."""
    seen = visible_outside(design, approach)
    return [(name,) for name in seen]


KINDS = (
    Kind("nothing"),
    Kind("the noise is wrong, in all", noises=tuple(NOISES)),
    *(Kind("one effect, in all", single, (1.0,), lam) for lam in (6.0, 10.5, 16.0, 100.0)),
    Kind("one effect, in half", single, (0.5,), 10.5),
    Kind("two effects, in all and in a third", pairs, (1.0, 1 / 3), 16.0),
    Kind("one sensor is odd", single, (0.0,), 60.0),
    Kind("physics outside of the catalogue, in all", elsewhere, (1.0,), 60.0, named=False),
    Kind("nothing, mixed noise and positions", mixed=True),
    Kind("each sigma is stated wrongly, mixed noise", noises=("level",), mixed=True),
    Kind("one effect, in all, mixed noise", single, (1.0,), 10.5, mixed=True),
    Kind("one sensor is odd, mixed noise", single, (0.0,), 60.0, mixed=True),
    Kind("two effects, in all", pairs, (1.0, 1.0), 16.0),
)


def lot_of(kind, seed):
    """Campaigns and truths of a lot, and its case; drawn again where a design cannot show it."""
    rng = np.random.default_rng(seed.spawn(1)[0])
    while True:
        design, approach = rng.choice(DESIGNS), rng.choice(APPROACHES)
        choices = kind.choices(str(design), str(approach))
        known = bool(rng.integers(2))
        # What is not stated cannot be stated wrongly.
        sigmas = ()
        if kind.mixed and kind.noises:
            known = True
        elif kind.mixed:
            sigmas = ((True,), (False,), (False, True))[rng.integers(3)]
        if not choices:
            continue
        effects = choices[rng.integers(len(choices))]
        lam = (kind.lam,) * len(effects)
        noise = str(rng.choice(kind.noises)) if kind.noises else None
        case = LotCase(
            Case("lot", str(design), str(approach), known, effects, lam, noise),
            kind.shares,
            DESIGNS if kind.mixed and not effects else (),
            sigmas,
            MIXED if kind.mixed else (),
        )
        try:
            return case, list(generate_lot(case, SENSORS, seed.spawn(1)[0]))
        except InputError:
            continue


def judged(job):
    """Judge one lot: a row of answers, with None where a question does not arise."""
    logging.disable()
    number, i, seed = job
    kind = KINDS[number]
    asked, made = lot_of(kind, np.random.SeedSequence([seed, number, i]))
    case = asked.case
    truths = [truth for _, truth in made]
    model, by = get_model(MODEL), get_approach(case.approach)
    draws = np.random.SeedSequence(1).spawn(len(made))
    each = zip(made, draws, strict=True)
    lot = weigh_lot([Sensor(one, model, by, own) for (one, _), own in each])
    classes = {}
    for truth in truths if kind.named else ():
        for effect, same in zip(truth.effects, truth.classes, strict=True):
            classes.setdefault(effect.name, {effect.name}).update(same)
    if case.noise is not None:
        classes = {case.noise: {NOISES[case.noise][0]}}
    told = lot.effects if lot.explained else ()
    told = [found for found in told if not found.names[0].startswith(UNNAMED)]
    right = {
        name: found for name, same in classes.items() for found in told if same & {*found.names}
    }
    of_type = 0.0 not in kind.shares
    has = {name: [any(e.name == name for e in t.effects) for t in truths] for name in classes}
    odd = {*lot.odd}
    carriers = set() if of_type else {k for k, t in enumerate(truths) if t.effects}
    return {
        "kind": number,
        "missing": lot.missing,
        "named": len(right) == len(classes) if classes and of_type else None,
        "wrong": any(not all_true([f.names], [*classes.values()]) for f in told),
        "shares": [f.share_ci95[0] <= np.mean(has[n]) <= f.share_ci95[1] for n, f in right.items()
                   if kind.shares],
        "sensors": [
            bool({*one.names} & classes[case.effect[0]]) for one in lot.each
        ] if kind.shares == (1.0,) and kind.named else [],
        "oracle": same_effects(lot_oracle(asked, made).told, [*classes.values()])
                  if kind.named and len(kind.shares) == 1 and of_type and not kind.mixed else None,
        "odd": None if of_type else carriers <= odd,
        "odd wrongly": bool(odd - carriers),
    }  # fmt: skip


def share(answers):
    """Share of yes with its 95 % interval, as text."""
    answers = [one for one in answers if one is not None]
    if not answers:
        return ""
    count, n = sum(answers), len(answers)
    low, high = binomtest(count, n).proportion_ci()
    return f"{count / n:.2f} ({low:.2f} to {high:.2f})"


def main(lots, seed):
    """Print the table."""
    jobs = [(number, i, seed) for i in range(lots) for number in range(len(KINDS))]
    with ProcessPoolExecutor(2) as pool:
        answers = [*pool.map(judged, jobs)]
    rows = []
    for number, kind in enumerate(KINDS):
        of_kind = [one for one in answers if one["kind"] == number]
        inside, sensors = ([x for one in of_kind for x in one[k]] for k in ("shares", "sensors"))
        rows.append([
            kind.title, f"{kind.lam:g}" if kind.lam else "", str(len(of_kind)),
            *(share([one[k] for one in of_kind]) for k in ("missing", "named", "oracle", "wrong")),
            share(inside), f"{np.mean(sensors):.2f}" if sensors else "",
            *(share([one[k] for one in of_kind]) for k in ("odd", "odd wrongly")),
        ])  # fmt: skip
    head = [
        "what the model lacks", "λ", "lots", "anything missing", "named rightly", "by the oracle",
        "a wrong name",
        "share inside", "sensors rightly", "odd found", "odd wrongly",
    ]  # fmt: skip
    print(table(head, *rows))


if __name__ == "__main__":
    given = [int(text) for text in sys.argv[1:]]
    main(*given, *(40, 20261123)[len(given) :])
