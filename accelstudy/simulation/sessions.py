"""Simulated calibration sessions: the observations of R replicates of one set-up."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from accelstudy.adjustment import Observations
from accelstudy.adjustment.observations import AngleErrors
from accelstudy.basics.arrays import Array
from accelstudy.basics.units import MGON, STANDARD_GRAVITY
from accelstudy.effects import HoldConditions
from accelstudy.leveling.angles import angles_of
from accelstudy.noise_effects import get_noise_effect
from accelstudy.sensors.sensor import SensorModel

BLOCK = 500
"""Sessions that are drawn and adjusted together; few enough for the processor's cache."""


@dataclass(frozen=True)
class Noise:
    """The stochastic model of a session.

    Parameters
    ----------
    sigma_force : float, m/s², of the mean of one position, per axis
    sigma_angle : float, rad, of the robot's roll and of its pitch
    sigma_gravity : float, m/s², of the value of gravity; 0 holds it fixed in the adjustment
    gravity_error : float, m/s², error of the value of gravity, in addition to its noise
    effects : tuple of str, noise effects of the forces, in the order in which they act
    """

    sigma_force: float = 0.002
    sigma_angle: float = 3.2 * MGON
    sigma_gravity: float = 0.0
    gravity_error: float = 0.0
    effects: tuple[str, ...] = ()


def sigma_of_mean(sigma_sample: float, rate: float, duration: float) -> float:
    """Return the sd of the mean of a position from white noise per sample.

    Parameters
    ----------
    sigma_sample : float, m/s²
    rate : float, Hz
    duration : float, s
    """
    return sigma_sample / math.sqrt(max(1, round(rate * duration)))


@dataclass(frozen=True)
class Errors:
    """Normal errors of R sessions, before noise effects act on them; None is not drawn.

    force : (R, n, 3), m/s²; angle : (R, n, 2), rad; gravity : (R,), m/s²
    """

    force: Array
    angle: Array | None = None
    gravity: Array | None = None

    def first(self, replicates: int) -> Errors:
        """Return those of the first `replicates` sessions; all if there are fewer."""
        drawn = (None if e is None else e[:replicates] for e in (self.angle, self.gravity))
        return Errors(self.force[:replicates], *drawn)


@dataclass(frozen=True)
class Session:
    """A session before noise: what an ideal measurement of the sensor in the scheme would give.

    Parameters
    ----------
    f_b : (n, 3) array, m/s², specific force in the body frame
    forces : (n, 3) array, m/s², sensor output without noise
    angles : (n, 2) array, rad, reading of the robot without noise
    gravity : float, m/s²
    hold : HoldConditions
    """

    f_b: Array
    forces: Array
    angles: Array
    gravity: float
    hold: HoldConditions

    def observations(self, noise: Noise) -> Observations:
        """Return the session as it would be observed without any noise, R = 1."""
        return Observations(
            forces=self.forces[None],
            sigma_force=noise.sigma_force,
            angles=self.angles[None],
            sigma_angle=noise.sigma_angle,
            gravity=np.array([self.gravity + noise.gravity_error]),
            sigma_gravity=noise.sigma_gravity,
            hold=self.hold,
        )

    def draw(
        self, noise: Noise, replicates: int, rng: np.random.Generator, angles: bool = True
    ) -> Observations:
        """Draw the observations of `replicates` sessions.

        The order of the draws is fixed: forces, angles, gravity, then the noise effects. Angles
        that are not used are drawn all the same where other draws follow them. The adjustment does
        not know of the noise effects.
        """
        return self.disturb(self.errors(noise, replicates, rng, angles), noise, rng)

    def errors(
        self, noise: Noise, replicates: int, rng: np.random.Generator, angles: bool = True
    ) -> Errors:
        """Draw the normal errors of `replicates` sessions, as `draw` does first."""
        n = len(self.forces)
        force = rng.standard_normal((replicates, n, 3))
        force *= noise.sigma_force
        if not (angles or noise.sigma_gravity > 0 or noise.effects):
            return Errors(force)
        angle = noise.sigma_angle * rng.standard_normal((replicates, n, 2))
        return Errors(force, angle, noise.sigma_gravity * rng.standard_normal(replicates))

    def disturb(self, errors: Errors, noise: Noise, rng: np.random.Generator) -> Observations:
        """Observations with given normal errors, on which the noise effects act."""
        force = errors.force
        effects = [get_noise_effect(spec) for spec in noise.effects]
        for effect in effects:
            force = effect.disturb(force, noise.sigma_force, self.hold, rng)
        forces = self.forces + force
        for effect in effects:
            forces = effect.read(forces)
        gravity = np.full(len(forces), self.gravity + noise.gravity_error)
        if errors.gravity is not None:
            gravity += errors.gravity
        angles = None if errors.angle is None else self.angles + errors.angle
        return replace(self.observations(noise), forces=forces, angles=angles, gravity=gravity)

    def draw_blocks(
        self,
        noise: Noise,
        replicates: int,
        blocks: Iterable[int],
        rng_of: Callable[[int], np.random.Generator],
        size: int,
        angles: bool = True,
    ) -> Iterator[tuple[Errors, Observations]]:
        """Draw sessions and their normal errors block by block, so that memory does not grow.

        Each block has its own random numbers and is drawn in full. So a larger number of replicates
        extends a smaller one, and no block depends on which others are drawn.

        Parameters
        ----------
        noise, angles : as in `draw`
        replicates : int, of all blocks together; the last block may have fewer than `size`
        blocks : iterable of int, numbers of the blocks to draw, the first is 0
        rng_of : takes the number of a block, returns the generator of its random numbers
        size : int, sessions of a block
        """
        for block in blocks:
            rng, rest = rng_of(block), replicates - block * size
            errors = self.errors(noise, size, rng, angles)
            yield errors.first(rest), self.disturb(errors, noise, rng).first(rest)


def with_angle_errors(
    ideal: Session,
    drawn: Observations,
    errors: AngleErrors | None,
    rng: np.random.Generator,
    scale: float,
) -> Observations:
    """Sessions whose angles were told by a reference, instead of a robot.

    Parameters
    ----------
    ideal : Session
    drawn : Observations, sessions that were drawn of it
    errors : function of angles, as of `Observations`; None leaves the sessions as they are
    rng : Generator, for the errors that all positions share
    scale : float, of the sigmas of the other errors
    """
    if errors is None or drawn.angles is None:
        return drawn
    sigma, common = errors(ideal.angles)
    sigma = scale * sigma
    noise = (drawn.angles - ideal.angles) * sigma / np.asarray(drawn.sigma_angle)
    shared = rng.standard_normal((len(noise), common.shape[-1]))
    angles = ideal.angles + noise + np.einsum("nak,rk->rna", common, shared)
    return replace(drawn, angles=angles, sigma_angle=sigma, common=common)


def session(
    model: SensorModel,
    parameters: Array,
    directions: Array,
    gravity: float = STANDARD_GRAVITY,
    hold: HoldConditions | None = None,
) -> Session:
    """Simulate a session without noise.

    Parameters
    ----------
    model : SensorModel, with all effects that the simulated sensor has
    parameters : (u,) array, SI
    directions : (n, 3) array of unit vectors, gravity in the body frame (f_b = −g · direction)
    gravity : float, m/s²
    hold : HoldConditions, optional
        Columns that the simulation cannot derive from the directions (temperature, time, …).
    """
    f_b = -gravity * np.asarray(directions, dtype=float)
    angles = angles_of(f_b)
    roll, pitch = angles.T
    hold_conditions = replace(hold or HoldConditions(), roll=roll, pitch=pitch).with_steps(f_b)
    return Session(
        f_b=f_b,
        forces=model.sense(f_b, parameters, gravity, hold_conditions),
        angles=angles + model.reading_errors(angles, parameters, hold_conditions),
        gravity=gravity,
        hold=hold_conditions,
    )
