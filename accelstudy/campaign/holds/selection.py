"""Holds that the user leaves out or joins, by their numbers in the figure or by time."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.campaign.holds.segments import Segment

_BY_NUMBER = re.compile(r"\s*(\d{1,9})\s*:\s*(\S.*?)\s*")
_SPAN = re.compile(r"\s*(\d+(?:\.\d*)?)\s*s?\s*-\s*(\d+(?:\.\d*)?)\s*s\s*")
_BY_TIME = re.compile(_SPAN.pattern + r":\s*(\S.*?)\s*")


@dataclass(frozen=True)
class Selection:
    """Holds to leave out and to join, by the numbers that the detector gave them.

    Attributes
    ----------
    numbers : mapping of int to str, holds that are left out, with the reason
    spans : tuple of (from, to, reason), s since the start of the log; holds in them are left out
    joined : tuple of tuples of int, holds that are one hold
    joined_spans : tuple of (from, to), s since the start of the log; holds in one are one hold
    """

    numbers: Mapping[int, str] = field(default_factory=dict)
    spans: tuple[tuple[float, float, str], ...] = ()
    joined: tuple[tuple[int, ...], ...] = ()
    joined_spans: tuple[tuple[float, float], ...] = ()

    def join(self, segments: Mapping[int, Segment], alike: float) -> dict[int, Segment]:
        """Join holds; they keep the number of the first.

        Parameters
        ----------
        segments : mapping of int to Segment
        alike : float, m/s², by which the means of holds in one attitude may differ

        Raises
        ------
        InputError
            If there is no such hold, a span of time has fewer than two, others lie between, or
            their attitudes differ.
        """
        holds = dict(segments)
        groups = list(self.joined)
        for start, end in self.joined_spans:
            groups.append(tuple(_within(holds, start, end)))
            if len(groups[-1]) < 2:
                raise InputError(f"join: {start:g}s-{end:g}s: fewer than two holds lie there")
        for group in groups:
            for number in group:
                _check(number, holds, "join")
            between = [n for n in holds if group[0] < n < group[-1] and n not in group]
            if between:
                raise InputError(f"join: {_names(group)}: hold {between[0]} lies between them")
            for number in group[1:]:
                step = float(np.linalg.norm(holds[number].mean - holds[group[0]].mean))
                if step > alike:
                    raise InputError(
                        f"join: holds {group[0]} and {number} differ by {step:.2g} m/s²: the "
                        "sensor was turned between them"
                    )
                holds[group[0]] = holds[group[0]] + holds.pop(number)
        return holds

    def left_out(self, holds: Mapping[int, Segment]) -> dict[int, str]:
        """Holds that are left out, with the reason.

        Raises
        ------
        InputError
            If there is no such hold, or none in a span of time.
        """
        for number in self.numbers:
            _check(number, holds, "exclude")
        reasons = dict(self.numbers)
        for start, end, reason in self.spans:
            inside = _within(holds, start, end)
            if not inside:
                raise InputError(f"exclude: {start:g}s-{end:g}s: no hold lies there")
            reasons |= {n: reason for n in inside if n not in reasons}
        return reasons


def parse_selection(exclude: Sequence[str], join: Sequence[str]) -> Selection:
    """Selection from ``13:moved`` or ``120s-135s:moved``, and from ``4,5`` or ``120s-135s``.

    Raises
    ------
    InputError
        If something is neither.
    """
    numbers: dict[int, str] = {}
    spans = []
    for text in exclude:
        if match := _BY_NUMBER.fullmatch(text):
            numbers[int(match[1])] = match[2]
        elif (match := _BY_TIME.fullmatch(text)) and float(match[1]) < float(match[2]):
            spans.append((float(match[1]), float(match[2]), match[3]))
        else:
            raise InputError(
                f"exclude: expected a hold or a time, and why, as 13:moved or 120s-135s:moved, "
                f"not {text!r}"
            )
    joined, joined_spans = [], []
    for text in join:
        if (match := _SPAN.fullmatch(text)) and float(match[1]) < float(match[2]):
            joined_spans.append((float(match[1]), float(match[2])))
            continue
        parts = [part.strip() for part in text.split(",")]
        if len(parts) < 2 or not all(re.fullmatch(r"\d{1,9}", part) for part in parts):
            raise InputError(
                f"join: expected numbers of holds or a time, as 4,5 or 120s-135s, not {text!r}"
            )
        joined.append(tuple(sorted({int(part) for part in parts})))
    return Selection(numbers, tuple(spans), tuple(joined), tuple(joined_spans))


def _within(holds: Mapping[int, Segment], start: float, end: float) -> list[int]:
    """Numbers of the holds that lie in a span of time, if only in part."""
    return sorted(n for n, hold in holds.items() if hold.t0 <= end and hold.t1 >= start)


def _check(number: int, holds: Mapping[int, Segment], key: str) -> None:
    if number not in holds:
        raise InputError(f"{key}: there is no hold {number}; they are {_names(list(holds))}")


def _names(numbers: Sequence[int]) -> str:
    """Numbers in one line, runs of them by their ends."""
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(f"{r[0]} to {r[-1]}" if len(r) > 2 else ", ".join(map(str, r)) for r in runs)
