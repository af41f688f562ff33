"""Designs of a program: the best positions for a calibration."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from accelstudy.basics import bounds, units
from accelstudy.basics.errors import InputError, key
from accelstudy.basics.given import path_of
from accelstudy.basics.names import MAX_NAME_BYTES
from accelstudy.basics.progress import say, show, stage
from accelstudy.basics.wording import amount
from accelstudy.design.spaces import attitudes
from accelstudy.drawing.style import FULL
from accelstudy.files.outputs import new_file
from accelstudy.pages.result import Result
from accelstudy.proposal.proposal import REFERENCE, Proposal, write_design
from accelstudy.proposal.request import Request
from accelstudy.schemes import get_scheme, is_scheme_file
from accelstudy.simulation.sessions import Noise


class Design(Result):
    """The best positions for a calibration, in the order in which to take them.

    Attributes
    ----------
    proposal : accelstudy.proposal.proposal.Proposal, all of it
    """

    size = FULL, 80.0

    def __init__(self, proposal: Proposal) -> None:
        self.proposal, self.name = proposal, f"{len(proposal.directions)} positions"

    @classmethod
    def of(cls, *, sigma: float, robot_sigma: float, gravity_sigma: float, **given: Any) -> Design:
        """Search by the keywords of `accelstudy.find_positions`, checked."""
        bounds.SIGMA_FORCE.check_key(key("sigma"), sigma)
        bounds.SIGMA_ANGLE.check_key(key("robot_sigma"), robot_sigma / units.MGON)
        bounds.SIGMA_GRAVITY.check_key(key("gravity_sigma"), gravity_sigma)
        request = Request(noise=Noise(sigma, robot_sigma, gravity_sigma), **given)
        with stage("search"):
            return cls(Proposal.of(request))

    @property
    def state(self) -> str:
        """Found: where no positions determine the model, there is no design."""
        return "found"

    @property
    def verdict(self) -> str:
        """What the positions are expected to leave, in a sentence."""
        return f"These {self.name} leave {_both(self.proposal.rms)} (expected rms of leveling)."

    @property
    def content(self) -> dict[str, Any]:
        """State, verdict, how the positions were found, and the positions."""
        positions = self.to_frame().to_dict("records")
        made = {"design": dict(self.proposal.made()), "positions": positions}
        return {"state": self.state, "verdict": self.verdict, **made}

    @property
    def inputs(self) -> list[str]:
        """Files that were read."""
        request = self.proposal.request
        read = [request.attitudes] if request.attitudes.endswith(".csv") else []
        return read + [one for one in (request.after,) if one and is_scheme_file(one)]

    def to_frame(self) -> pd.DataFrame:
        """Return the positions, with angles in the unit that the names say."""
        unit, proposal = units.attitude_unit(), self.proposal
        roll, pitch = units.to_attitude(attitudes(proposal.directions)).T
        rows = pd.DataFrame(
            {
                "position": range(1, len(roll) + 1),
                f"roll/{unit}": roll.round(2) + 0.0,
                f"pitch/{unit}": pitch.round(2) + 0.0,
                f"turn/{unit}": units.to_attitude(proposal.turns),
            }
        )
        return rows.assign(**{"turned about": axes}) if (axes := proposal.axes) else rows

    def table(self) -> str:
        """Return the positions as text."""
        rows = self.to_frame()
        for column, form in zip(rows.columns[1:4], ("{:.2f}", "{:.2f}", "{:.0f}"), strict=True):
            rows[column] = ["" if x != x else form.format(x) for x in rows[column]]
        return rows.to_string(index=False)

    def _table(self) -> str:
        """Return the positions and what they bring as text."""
        return "\n".join([self.table(), *self.lines()])

    def draw(self, ax: Axes) -> None:
        """Draw roll and pitch of the positions, with their numbers."""
        rows = self.to_frame()
        number, roll, pitch = rows.columns[:3]
        ax.plot(rows[roll], rows[pitch], "o")
        for _, row in rows.iterrows():
            ax.annotate(f" {row[number]}", (row[roll], row[pitch]))
        ax.set(xlabel=roll.replace("/", " / "), ylabel=pitch.replace("/", " / "))

    def tell(self, place: Path) -> None:
        """Print the positions and what they bring."""
        show(self.table())
        say("\n".join(self.lines()))
        say(f"scheme: {place}")

    def lines(self) -> Iterable[str]:
        """What the design brings, in sentences."""
        proposal, request, unit = self.proposal, self.proposal.request, units.display_unit("rad")
        n, m = len(proposal.directions), get_scheme(REFERENCE).n_positions
        noise = request.noise
        given = f"noise {units.to_display(noise.sigma_force, 'm/s^2'):.3g} mm/s² per position"
        if request.task.approach.uses_angles:
            given += f" and robot noise {units.to_display(noise.sigma_angle, 'rad'):.3g} {unit}"
        tilt = f"{units.to_attitude(request.tilt_range):.4g} {units.attitude_unit()}"
        effects = ", the neglected effects included" if request.neglect else ""
        after = f" after {request.after}" if request.after else ""
        yield (
            "\nturn: angle from the position before; 0 repeats it."
            f"\nExpected rms of leveling for tilts up to {tilt}, with {given}{effects}:"
        )
        yield f"  these {n} positions{after}: {_both(proposal.rms)}"
        if proposal.placed is not None:
            yield f"  if a hand misses them by 5° (sd per axis): {_both(proposal.placed)}"
        reference = proposal.reference
        theirs = "do not determine the model" if reference is None else _both(reference)
        yield f"  the {m} of {REFERENCE}{after}: {theirs}"
        if sizes := proposal.nameable(proposal.directions):
            there = proposal.nameable(get_scheme(REFERENCE).directions)
            yield "Size from which a parameter is found, and told from the other effect:"
            for name, (size, of) in sizes.items():
                here, other = (amount(s, of) for s in (size, there[name][0]))
                yield f"  {name}: {here} {units.display_unit(of)} ({REFERENCE}: {other})"
        share = 100 * proposal.design.efficiency
        if share == share:
            yield (
                f"Efficiency at least {share:.1f} % of the best that any {n} "
                f"allowed positions can reach ({request.chosen.text})."
            )
        yield f"Noise of a leveled reading comes on top. {units.angle_note()}."

    def save(self, path: str | PathLike[str], *, force: bool = False) -> None:
        """Write the YAML file of a scheme.

        Parameters
        ----------
        path : path, ending in .yaml
        force : bool, whether to replace a file that is there
        """
        place = path_of("path", path)
        with new_scheme(place, self.inputs, force) as file:
            self.write(file, place)

    def write(self, file: Path, place: Path) -> None:
        """Write a file that becomes `place`, by which the scheme is named."""
        proposal = self.proposal
        extra = {"turn_about": proposal.axes} if proposal.axes else None
        name = re.sub(r"[^\w.-]+", "-", place.stem).lstrip(".-")[: MAX_NAME_BYTES // 2] or "scheme"
        kind = proposal.request.chosen.name
        kind = f"{kind}-optimal" if len(kind) == 1 else kind
        title, source = f"{name} ({kind})", f"accelstudy design, seed {proposal.request.seed}"
        write_design(file, name, title, source, proposal.directions, proposal.made(), extra)


@contextmanager
def new_scheme(out: Path, inputs: Iterable[str | Path], force: bool) -> Iterator[Path]:
    """Yield a temporary file that becomes `out`, by whose ending it is known as a scheme."""
    if not out.name.endswith((".yaml", ".yml")):
        raise InputError(f"{out}: must end in .yaml, by which a file is known as a scheme")
    with new_file(out, inputs, force) as file:
        yield file


def _both(rms: Any) -> str:
    unit = units.display_unit("rad")
    roll, pitch = units.to_display(rms, "rad")
    return f"roll {roll:.2f} {unit}, pitch {pitch:.2f} {unit}"
