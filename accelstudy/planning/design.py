"""A design: the best positions for a calibration, in order, with what they bring, and its file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import yaml

from accelstudy import __version__
from accelstudy.approaches import get_approach
from accelstudy.basics import bounds, units
from accelstudy.basics.arguments import tidy
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError, key
from accelstudy.basics.names import path_name
from accelstudy.basics.progress import say, show, stage
from accelstudy.design.criteria import get_criterion, rms_tilt
from accelstudy.design.order import field_order
from accelstudy.design.search import Search, round_directions
from accelstudy.design.spaces import SPACES, angles_to, find_attitudes
from accelstudy.design.task import Task
from accelstudy.drawing.style import FULL
from accelstudy.files.outputs import new_file
from accelstudy.leveling.attitudes import axes_in_words
from accelstudy.pages.result import Result
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise

if TYPE_CHECKING:
    from matplotlib.axes import Axes


REFERENCE = "mclaren-24"


def new_scheme(
    out: Path, inputs: Iterable[str | Path] = (), force: bool = False
) -> AbstractContextManager[Path]:
    """Return the place of a scheme, as which a file is known by its ending; see `new_file`."""
    if not out.name.endswith((".yaml", ".yml")):
        raise InputError(f"{out}: must end in .yaml, by which a file is known as a scheme")
    return new_file(out, inputs, force)


@dataclass(frozen=True, eq=False, repr=False)
class Design(Result):
    """The best positions for a calibration, in the order in which to take them.

    Attributes
    ----------
    search : accelstudy.design.search.Search
    directions : (n, 3) array of unit vectors, in the order of measurement, as in the file
    starts : int, random sets from which they were searched
    after : str, scheme of positions that are measured already, or None
    """

    new_file, size = staticmethod(new_scheme), (FULL, 80.0)

    search: Search
    directions: Array
    starts: int
    after: str | None

    @property
    def name(self) -> str:  # type: ignore[override]
        """How many positions there are."""
        return f"{len(self.directions)} positions"

    @classmethod
    def of(
        cls,
        *,
        model: str,
        approach: str,
        positions: int,
        sigma: float,
        robot_sigma: float,
        gravity_sigma: float,
        criterion: str,
        tilt_range: float,
        after: str | None,
        attitudes: str,
        seed: int,
        starts: int,
        **constraints: Any,
    ) -> Design:
        """Search by the keywords of `accelstudy.find_positions`, and order what is found."""
        bounds.SIGMA_GRAVITY.check_key(key("gravity_sigma"), gravity_sigma)
        noise = Noise(sigma, robot_sigma, gravity_sigma)
        measured = get_scheme(after).directions if after else np.zeros((0, 3))
        with stage("search"):
            task = Task(get_model(model), get_approach(approach), noise, tilt_range, measured)
            allowed = replace(find_attitudes(attitudes, SPACES), **constraints)
            search = Search(task, get_criterion(criterion, task), allowed, seed)
            found = search.optimum(positions, starts)
            order = field_order(task, found)
        return cls(search, found[order], starts, after)

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
        positions = self.to_frame().replace({np.nan: None}).to_dict("records")
        found = {"design": self.provenance, "positions": positions}
        return {"state": self.state, "verdict": self.verdict, **found}

    @cached_property
    def rms(self) -> Array:
        """Expected rms of roll and of pitch, rad, (2,)."""
        return rms_tilt(self.search.task, self.directions)

    @cached_property
    def efficiency(self) -> float:
        """Least share that the positions reach of the best that as many positions can."""
        return self.search.efficiency(self.directions)

    @property
    def provenance(self) -> dict[str, Any]:
        """How it was made and how good it is, as plain data in the units of files."""
        search, task, noise = self.search, self.search.task, self.search.task.noise
        with units.angles_in("gon"):
            constraints = search.allowed.constraints
        content = {
            "version": __version__,
            "criterion": f"{search.criterion.name}: {search.criterion.text}",
            "model": task.model.name,
            "approach": task.approach.name,
            "tilt_range_gon": tidy(task.tilt_range / units.GON, 6),
            "sigma_mps2": tidy(noise.sigma_force, 6),
            "robot_sigma_mgon": tidy(noise.sigma_angle / units.MGON, 6),
            "gravity_sigma_mps2": tidy(noise.sigma_gravity, 6),
            "attitudes": search.allowed.text,
            "constraints": constraints,
            "after": get_scheme(self.after).name if self.after else None,
            "seed": search.seed,
            "starts": self.starts,
            "efficiency": tidy(self.efficiency, 6),
            "rms_roll_mgon": tidy(self.rms[0] / units.MGON, 6),
            "rms_pitch_mgon": tidy(self.rms[1] / units.MGON, 6),
        }
        return {k: v for k, v in content.items() if v not in (None, [], 0.0)}

    def to_frame(self) -> pd.DataFrame:
        """Return the positions, with angles in the unit that the names say."""
        unit = units.attitude_unit()
        cosines = np.sum(self.directions[1:] * self.directions[:-1], axis=1)
        roll, pitch = units.to_attitude(angles_to(self.directions)).T
        return pd.DataFrame(
            {
                "position": range(1, len(roll) + 1),
                f"roll/{unit}": roll.round(2) + 0.0,
                f"pitch/{unit}": pitch.round(2) + 0.0,
                f"turn/{unit}": units.to_attitude([np.nan, *np.arccos(np.clip(cosines, -1, 1))]),
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
        say("\n".join([*self.lines(), f"scheme: {place}"]))

    def lines(self) -> Iterable[str]:
        """What the design brings, in sentences."""
        task, reference = self.search.task, get_scheme(REFERENCE)
        noise = f"noise {units.to_display(task.noise.sigma_force, 'm/s^2'):.3g} mm/s² per position"
        if task.approach.uses_angles:
            robot = units.to_display(task.noise.sigma_angle, "rad")
            noise += f" and robot noise {robot:.3g} {units.display_unit('rad')}"
        tilt = f"{units.to_attitude(task.tilt_range):.4g} {units.attitude_unit()}"
        after = f" after {self.after}" if self.after else ""
        rms = rms_tilt(task, reference.directions)
        theirs = _both(rms) if np.isfinite(rms).all() else "do not determine the model"
        yield "\nturn: angle from the position before; 0 repeats it."
        yield f"Expected rms of leveling for tilts up to {tilt}, with {noise}:"
        yield f"  these {self.name}{after}: {_both(self.rms)}"
        yield f"  the {reference.n_positions} of {REFERENCE}{after}: {theirs}"
        yield (
            f"Efficiency at least {100 * self.efficiency:.1f} % of the best that any "
            f"{len(self.directions)} allowed positions can reach ({self.search.criterion.text})."
        )
        yield f"Noise of a leveled reading comes on top. {units.angle_note()}."

    def write(self, file: Path, place: Path) -> None:
        """Write a file that becomes `place`, by which the scheme is named."""
        name, kind = path_name(place.stem, "scheme"), self.search.criterion.name
        title = f"{name} ({kind}-optimal)" if len(kind) == 1 else f"{name} ({kind})"
        source = f"accelstudy design, seed {self.search.seed}"
        write_scheme(file, name, title, source, self.directions, self.provenance)


def _both(rms: Any) -> str:
    unit = units.display_unit("rad")
    roll, pitch = units.to_display(rms, "rad")
    return f"roll {roll:.2f} {unit}, pitch {pitch:.2f} {unit}"


def write_scheme(
    path: Path, name: str, title: str, source: str, directions: Array, provenance: Mapping[str, Any]
) -> None:
    """Write a scheme that `accelstudy.schemes.get_scheme` reads.

    Parameters
    ----------
    path : Path
    name, title, source : str, of the scheme
    directions : (n, 3) array of unit vectors
    provenance : mapping, plain data: how it was made, and how good it is
    """
    angles = (units.to_recorded(angles_to(directions), "rad") / 1000).round(3) + 0.0
    content = {
        "scheme": name,
        "title": title,
        "source": source,
        "design": dict(provenance),
        "positions": [
            {"position": i, "roll_gon": roll, "pitch_gon": pitch, "axes": axes_in_words(direction)}
            for i, ((roll, pitch), direction) in enumerate(
                zip(angles.tolist(), directions, strict=True), 1
            )
        ],
        "directions": round_directions(directions).tolist(),
    }
    head = (
        "# Positions for a calibration, in the order in which to take them. Any configuration and\n"
        "# command takes this file as a scheme; `directions` is what counts: gravity in the body\n"
        "# frame.\n"
    )
    text = yaml.safe_dump(
        content, sort_keys=False, allow_unicode=True, default_flow_style=None, width=160
    )
    path.write_text(head + text, encoding="utf-8")
