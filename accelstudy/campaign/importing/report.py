"""The report of an import, as lines of text."""

from __future__ import annotations

from dataclasses import dataclass

from accelstudy.basics.wording import counted
from accelstudy.campaign.holds.allan import MeanAccuracy
from accelstudy.campaign.holds.detection import DetectedHolds


@dataclass(frozen=True)
class ImportReport:
    """The report of an import.

    Attributes
    ----------
    n_holds : int
    accuracy : MeanAccuracy, of the mean of a typical hold; None from a table of means
    sigma_white : float, m/s², sd of a mean if the noise were white; None if unknown
    holds : DetectedHolds, None from a table of means
    notes : tuple of str, assumptions of the import
    warnings : tuple of str
    """

    n_holds: int
    accuracy: MeanAccuracy | None
    sigma_white: float | None
    holds: DetectedHolds | None
    notes: tuple[str, ...]
    warnings: tuple[str, ...]

    @property
    def sigma_allan(self) -> float | None:
        """Standard deviation of a mean from the Allan deviation, m/s²; None without a log."""
        return None if self.accuracy is None else self.accuracy.allan

    @property
    def ratio(self) -> float | None:
        """Factor by which the assumption of white noise is too optimistic."""
        return None if self.accuracy is None else self.accuracy.ratio

    def lines(self) -> list[str]:
        """Return the report as lines of text."""
        if self.holds is None or self.accuracy is None:
            sigma = "unknown" if self.sigma_white is None else shown(self.sigma_white)
            return [f"{self.n_holds} positions; sigma of a mean: {sigma}", *self.notes]
        holds, accuracy = self.holds, self.accuracy
        lengths = holds.n_samples * holds.step
        lines = [
            f"log: {holds.span[1] - holds.span[0]:.1f} s at {1 / holds.step:.6g} per second",
            *self.notes,
            f"threshold: {holds.threshold.sd:.3g} m/s², {holds.threshold.reason}",
            f"holds: {len(holds)}, of {lengths.min():.1f} to {lengths.max():.1f} s",
        ]
        if holds.left_out:
            each = ", ".join(f"{n} ({why})" for n, why in sorted(holds.left_out.items()))
            lines.append(f"left out: {counted(len(holds.left_out), 'hold')}: {each}")
        return [
            *lines,
            f"sigma of a mean over {accuracy.duration:.1f} s: {shown(accuracy.allan)} (Allan), "
            f"{shown(accuracy.white)} if the noise were white; ratio {accuracy.ratio:.2f}",
        ]


def shown(sigma: float) -> str:
    """Standard deviation of a force, m/s², for people."""
    return f"{1e3 * sigma:.3g} mm/s²"
