"""What a diagnosis says beside its verdict.

Each part is computed at first use: a study of many campaigns needs few of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from accelstudy.adjustment.quality import suspects
from accelstudy.basics.progress import stage
from accelstudy.campaign.calibration.assessment import SUSPECT
from accelstudy.diagnosis.decision.posterior import of_effects
from accelstudy.diagnosis.decision.search import Search
from accelstudy.diagnosis.decision.verdict import Finding
from accelstudy.diagnosis.space.groups import LACK_OF_FIT
from accelstudy.diagnosis.worth.changes import Change, parameter_changes
from accelstudy.diagnosis.worth.limits import UpperLimit, upper_limits
from accelstudy.diagnosis.worth.location import Location
from accelstudy.diagnosis.worth.next_positions import NextPosition, next_positions
from accelstudy.diagnosis.worth.tilt import leveling_rms


@dataclass(frozen=True)
class Beside:
    """What follows from a finding.

    Attributes
    ----------
    search : Search
    finding : Finding
    variance : float, of unit weight, after what was found
    sigma_known : bool, whether sigma is given
    trusted : bool, whether it is, and the base fit does not refute it
    holds : bool, whether it is, and the final fit does not refute it
    """

    search: Search
    finding: Finding
    variance: float
    sigma_known: bool
    trusted: bool
    holds: bool

    @cached_property
    def location(self) -> Location:
        """Where the excess χ² above the noise lives.

        The noise is the given one. Where none is given, it is what remains after what was found or,
        if something unknown is missing, the least that any group of regressors leaves.
        """
        residuals, groups = self.search.residuals, self.search.groups
        variance = self.variance
        if self.sigma_known:
            variance = 1.0
        elif self.finding.verdict == "unknown":
            z, r = residuals.z, residuals.redundancy
            spaces = [space for name, space in groups.items() if name != LACK_OF_FIT]
            left = [float((z @ z - q.parts(z)[0]) / (r - q.dims[0])) for q in spaces]
            variance = min([variance, *left])
        return Location(self.search.examined, self.search.chance, variance)

    @cached_property
    def leveling(self) -> tuple[float, float] | None:
        """Tilt error without and with what was found, rad; see `leveling_rms`."""
        if not self.finding.chosen:
            return None
        final, hold = self.finding.examined.frame.solution, self.search.examined.frame.hold
        return leveling_rms(self.search.first, final, hold, self.variance)

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """Compare what added effects should change of the other parameters with what they do."""
        effects = [choice.best.shown for choice in self.finding.chosen]
        added = [effect for effect in effects if effect is not None]
        if not added or len(added) < len(effects):
            return ()
        final, frame = self.finding.examined.frame.solution, self.search.examined.frame
        return parameter_changes(self.search.first, final, frame, added, self.variance)

    @cached_property
    def upper_limits(self) -> tuple[UpperLimit, ...]:
        """Limits of the effects that were neither found nor left open."""
        names = [choice.best.name for choice in self.finding.chosen]
        if self.finding.verdict == "narrowed":
            classes = [alike for one in self.finding.credible_set for alike in one.classes]
            names += [name for alike in classes for name in alike]
        return tuple(upper_limits(self.finding.examined, self.holds, names))

    @cached_property
    def next_positions(self) -> tuple[NextPosition, ...]:
        """Positions that tell the two most probable of the credible set apart."""
        finding = self.finding
        if finding.posterior is None or finding.verdict not in ("named", "narrowed", "unknown"):
            return ()
        weighed = zip(finding.credible_set, finding.posterior.told, strict=False)
        rivals = [one.best for explanation, one in weighed if of_effects(explanation)]
        if len(rivals) < 2:
            return ()
        with stage("next positions"):
            return tuple(next_positions(self.search.examined.frame, *rivals[:2]))

    @cached_property
    def suspects(self) -> tuple[tuple[int, float], ...]:
        """Indices of positions that a calibration with the base model marks, and their p-values."""
        if self.search.exact:
            return ()
        first = self.search.first
        found = suspects(first.model, first.approach, first.observed, SUSPECT, self.trusted)
        return tuple((int(s.position), s.p_value) for s in found)
