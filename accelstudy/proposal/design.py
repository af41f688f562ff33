"""A design: the best positions for a calibration, in order, with what they bring, and its file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import yaml
from numpy.typing import NDArray

from accelstudy import __version__
from accelstudy.adjustment.quality import noncentrality
from accelstudy.basics import bounds
from accelstudy.basics.arguments import path_of, tidy
from accelstudy.basics.errors import InputError, key
from accelstudy.basics.names import path_name
from accelstudy.basics.progress import say, show, stage
from accelstudy.basics.units import (
    GON,
    MGON,
    angle_note,
    angles_in,
    attitude_unit,
    display_unit,
    to_attitude,
    to_display,
    to_recorded,
)
from accelstudy.basics.wording import amount
from accelstudy.design.search import round_directions
from accelstudy.design.spaces import angles_to
from accelstudy.drawing.style import FULL
from accelstudy.files.outputs import new_file
from accelstudy.pages.result import Result
from accelstudy.proposal.order import field_order
from accelstudy.proposal.request import Request
from accelstudy.schemes import get_scheme, is_scheme_file
from accelstudy.simulation.sessions import Noise

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

REFERENCE = "mclaren-24"


class Design(Result):
    """The best positions for a calibration, in the order in which to take them.

    Attributes
    ----------
    request : Request
    directions : (n, 3) array of unit vectors, in the order of measurement, as in the file
    efficiency : float, least share of the best that as many positions can reach; NaN if unknown
    """

    size = FULL, 80.0

    def __init__(self, request: Request, directions: Array, efficiency: float) -> None:
        self.request, self.directions, self.efficiency = request, directions, efficiency
        self.name = f"{len(directions)} positions"

    @classmethod
    def of(cls, *, sigma: float, robot_sigma: float, gravity_sigma: float, **given: Any) -> Design:
        """Search by the keywords of `accelstudy.find_positions`, checked, and order what is found.

        Errors are those of `Search.optimum`.
        """
        bounds.SIGMA_FORCE.check_key(key("sigma"), sigma)
        bounds.SIGMA_ANGLE.check_key(key("robot_sigma"), robot_sigma / MGON)
        bounds.SIGMA_GRAVITY.check_key(key("gravity_sigma"), gravity_sigma)
        request = Request(noise=Noise(sigma, robot_sigma, gravity_sigma), **given)
        with stage("search"):
            found = request.search.optimum(request.starts)
            order = field_order(request.task, found.directions)
            return cls(request, found.directions[order], found.efficiency)

    @property
    def state(self) -> str:
        """Found: where no positions determine the model, there is no design."""
        return "found"

    @property
    def verdict(self) -> str:
        """What the positions are expected to leave, in a sentence."""
        return f"These {self.name} leave {_both(self.rms)} (expected rms of leveling)."

    @property
    def content(self) -> dict[str, Any]:
        """State, verdict, how the positions were found, and the positions."""
        positions = self.to_frame().to_dict("records")
        found = {"design": self.provenance, "positions": positions}
        return {"state": self.state, "verdict": self.verdict, **found}

    @property
    def turns(self) -> Array:
        """Angle from the position before, rad, (n,); NaN for the first."""
        cosines = np.sum(self.directions[1:] * self.directions[:-1], axis=1)
        return np.array([np.nan, *np.arccos(np.clip(cosines, -1, 1))])

    @cached_property
    def rms(self) -> Array:
        """Expected rms of roll and of pitch, rad, (2,)."""
        return self.request.task.rms_tilt(self.directions)

    def nameable(self, directions: Array) -> dict[str, tuple[float, str]]:
        """Size from which each parameter of two rivals can be told from the other effect, SI."""
        criterion, task = self.request.chosen, self.request.task
        if not self.request.discriminate:
            return {}
        size = np.sqrt(noncentrality(1) * criterion.squares(task.normal(directions)))
        places = np.concatenate([task.places(effect) for effect in task.neglected])
        units = {p.name: p.unit for p in task.extended.parameters}
        return {
            task.names[i]: (float(one / task.scale[i]), units[task.names[i]])
            for i, one in zip(places, size, strict=True)
        }

    @property
    def provenance(self) -> dict[str, Any]:
        """How it was made and how good it is, as plain data in the units of files."""
        request, noise = self.request, self.request.noise
        with angles_in("gon"):
            constraints = request.allowed.constraints
        content = {
            "version": __version__,
            "criterion": f"{request.chosen.name}: {request.chosen.text}",
            "model": request.task.model.name,
            "approach": request.approach,
            "tilt_range_gon": tidy(request.tilt_range / GON, 6),
            "sigma_mps2": tidy(noise.sigma_force, 6),
            "robot_sigma_mgon": tidy(noise.sigma_angle / MGON, 6),
            "gravity_sigma_mps2": tidy(noise.sigma_gravity, 6),
            "attitudes": request.allowed.text,
            "constraints": constraints,
            "prior": list(request.prior),
            "after": None if request.after is None else get_scheme(request.after).name,
            "neglected": list(request.neglect),
            "discriminate": list(request.discriminate or ()),
            "seed": request.seed,
            "starts": request.starts,
            "efficiency": tidy(self.efficiency, 6),
            "rms_roll_mgon": tidy(self.rms[0] / MGON, 6),
            "rms_pitch_mgon": tidy(self.rms[1] / MGON, 6),
        }
        return {k: v for k, v in content.items() if v not in (None, [], 0.0) and v == v}

    def to_frame(self) -> pd.DataFrame:
        """Return the positions, with angles in the unit that the names say."""
        unit = attitude_unit()
        roll, pitch = to_attitude(angles_to(self.directions)).T
        return pd.DataFrame(
            {
                "position": range(1, len(roll) + 1),
                f"roll/{unit}": roll.round(2) + 0.0,
                f"pitch/{unit}": pitch.round(2) + 0.0,
                f"turn/{unit}": to_attitude(self.turns),
            }
        )

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
        request, unit = self.request, display_unit("rad")
        noise, reference = request.noise, get_scheme(REFERENCE)
        given = f"noise {to_display(noise.sigma_force, 'm/s^2'):.3g} mm/s² per position"
        if request.task.approach.uses_angles:
            given += f" and robot noise {to_display(noise.sigma_angle, 'rad'):.3g} {unit}"
        tilt = f"{to_attitude(request.tilt_range):.4g} {attitude_unit()}"
        effects = ", the neglected effects included" if request.neglect else ""
        after = f" after {request.after}" if request.after else ""
        yield (
            "\nturn: angle from the position before; 0 repeats it."
            f"\nExpected rms of leveling for tilts up to {tilt}, with {given}{effects}:"
        )
        yield f"  these {self.name}{after}: {_both(self.rms)}"
        rms = request.task.rms_tilt(reference.directions)
        theirs = _both(rms) if np.isfinite(rms).all() else "do not determine the model"
        yield f"  the {reference.n_positions} of {REFERENCE}{after}: {theirs}"
        if sizes := self.nameable(self.directions):
            there = self.nameable(reference.directions)
            yield "Size from which a parameter is found, and told from the other effect:"
            for name, (size, of) in sizes.items():
                here, other = (amount(s, of) for s in (size, there[name][0]))
                yield f"  {name}: {here} {display_unit(of)} ({REFERENCE}: {other})"
        share = 100 * self.efficiency
        if share == share:
            yield (
                f"Efficiency at least {share:.1f} % of the best that any {len(self.directions)} "
                f"allowed positions can reach ({request.chosen.text})."
            )
        yield f"Noise of a leveled reading comes on top. {angle_note()}."

    def save(self, path: str | PathLike[str], *, force: bool = False) -> None:
        """Write the YAML file of a scheme.

        Parameters
        ----------
        path : path, ending in .yaml
        force : bool, whether to replace a file that is there
        """
        place, asked = path_of("path", path), self.request
        read = [asked.attitudes] if asked.attitudes.endswith(".csv") else []
        read += [one for one in (asked.after,) if one and is_scheme_file(one)]
        with new_scheme(place, read, force) as file:
            self.write(file, place)

    def write(self, file: Path, place: Path) -> None:
        """Write a file that becomes `place`, by which the scheme is named."""
        name = path_name(place.stem, "scheme")
        kind = self.request.chosen.name
        kind = f"{kind}-optimal" if len(kind) == 1 else kind
        title, source = f"{name} ({kind})", f"accelstudy design, seed {self.request.seed}"
        write_design(file, name, title, source, self.directions, self.provenance)


@contextmanager
def new_scheme(out: Path, inputs: Iterable[str | Path], force: bool) -> Iterator[Path]:
    """Yield a temporary file that becomes `out`, by whose ending it is known as a scheme."""
    if not out.name.endswith((".yaml", ".yml")):
        raise InputError(f"{out}: must end in .yaml, by which a file is known as a scheme")
    with new_file(out, inputs, force) as file:
        yield file


def _both(rms: Any) -> str:
    unit = display_unit("rad")
    roll, pitch = to_display(rms, "rad")
    return f"roll {roll:.2f} {unit}, pitch {pitch:.2f} {unit}"


def write_design(
    path: Path,
    name: str,
    title: str,
    source: str,
    directions: Array,
    made: Mapping[str, Any],
) -> None:
    """Write a scheme that `accelstudy.schemes.get_scheme` reads.

    Parameters
    ----------
    path : Path
    name, title, source : str, of the scheme
    directions : (n, 3) array of unit vectors
    made : mapping, plain data: how it was made, and how good it is
    """
    roll, pitch = (to_recorded(angles_to(directions), "rad") / 1000).T
    positions = [
        {"position": i + 1, "roll_gon": _gon(roll[i]), "pitch_gon": _gon(pitch[i])}
        for i in range(len(directions))
    ]
    content = {
        "scheme": name,
        "title": title,
        "source": source,
        "design": dict(made),
        "positions": positions,
        "directions": round_directions(directions).tolist(),
    }
    head = (
        "# Positions for a calibration, in the order in which to take them. Any configuration and\n"
        "# command takes this file as a scheme; `directions` is what counts: gravity in the body\n"
        "# frame.\n"
    )
    text = yaml.safe_dump(
        content, sort_keys=False, allow_unicode=True, default_flow_style=None, width=100
    )
    path.write_text(head + text, encoding="utf-8")


def _gon(angle: float) -> float:
    return round(float(angle), 3) + 0.0
