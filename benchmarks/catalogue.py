"""What some effects of the catalogue cost the diagnosis of all others, and what they bring.

python benchmarks/catalogue.py joint_compliance mounting_slip thermal_curve [--campaigns 2]

Campaigns of the study of hidden effects are diagnosed with the whole catalogue and without these.
"""

import argparse
import time
from collections.abc import Iterator
from zlib import crc32

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.effects import effect_names, effects_without
from accelstudy.sensors.models import get_model
from studies.hidden.physics.generate import Case, generate

DESIGNS = ("spread-24", "yaw-50", "two-warm-36")
NONCENTRALITY = 25.0
"""Where a name is often right, and evidence still counts."""
MODEL = get_model("bias-scale-nonorthogonality")


def campaigns(effects: list[str], count: int) -> Iterator[tuple[Campaign, set[str]]]:
    """Campaigns with each of some effects, and the names that are right; of none, with nothing."""
    for effect in effects or [""]:
        for design in DESIGNS:
            case = Case("null", design, "robot", sigma_known=True)
            if effect:
                case = Case("one", design, "robot", True, (effect,), (NONCENTRALITY,))
            for k in range(count):
                seed = np.random.SeedSequence((crc32(f"{effect} {design}".encode()), k))
                try:
                    campaign, truth = generate(case, seed)
                except InputError:  # the design cannot see it
                    break
                yield campaign, {effect, *(truth.classes[0] if effect else ())}


def judged(campaign: Campaign, right: set[str]) -> tuple[float, ...]:
    """Whether effects are named, the right one first; its posterior; seconds."""
    start = time.process_time()
    found = diagnose(campaign, MODEL)
    seconds = time.process_time() - start
    named = found.verdict in ("named", "narrowed")
    right_one = named and bool(right & set(found.found[0].equivalence_class))
    posterior = sum(p for name, p in found.probabilities.items() if name in right)
    return float(named), float(right_one), posterior, seconds


def main(names: list[str], count: int) -> None:
    """Print the means with the whole catalogue and without some effects."""
    others = [name for name in effect_names() if name not in names]
    others = [name for name in others if name not in {e.name for e in MODEL.effects}]
    print(f"{'hidden':14}{'catalogue':12}{'campaigns':>10}{'named':>7}{'right':>7}{'posterior':>11}"
          f"{'s':>7}")  # fmt: skip
    for hidden, effects, times in (
        ("nothing", [], 10),
        ("another", others, 1),
        ("one of them", names, 1),
    ):
        rows: dict[str, list[tuple[float, ...]]] = {"whole": [], "without": []}
        for campaign, right in campaigns(effects, times * count):
            rows["whole"].append(judged(campaign, right))
            with effects_without(names):
                rows["without"].append(judged(campaign, right))
        for catalogue, values in rows.items():
            named, right_one, posterior, seconds = np.mean(values, axis=0)
            print(f"{hidden:14}{catalogue:12}{len(values):10}{named:7.2f}{right_one:7.2f}"
                  f"{posterior:11.3f}{seconds:7.2f}")  # fmt: skip
        lost = np.subtract(rows["whole"], rows["without"])[:, 2]
        print(f"{'':26}posterior {lost.mean():+.3f} ± {lost.std(ddof=1) / len(lost) ** 0.5:.3f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("effects", nargs="+", choices=effect_names())
    parser.add_argument("--campaigns", type=int, default=2)
    given = parser.parse_args()
    main(given.effects, given.campaigns)
