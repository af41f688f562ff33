"""Gross errors that tests put into the data of a campaign, by formulas of their own."""

import numpy as np


def of_readings(campaign, change):
    """Change all columns of what the sensor reads, (n, 3) each; sds have no sign."""
    sd = None if campaign.sd is None else np.abs(change(campaign.sd))
    return campaign.with_arrays(forces=change(campaign.forces), sd=sd)


def axes(campaign, x, y, z):
    """The channels x, y, z show axis 1, 2 or 3, each with a sign."""
    shown = np.array([x, y, z])
    return of_readings(campaign, lambda v: v[:, np.abs(shown) - 1] * np.sign(shown))


def unit(campaign, force=1.0, angle=1.0):
    """The numbers of the forces, or of the robot's angles, are wrong by a factor."""
    wrong = of_readings(campaign, lambda v: force * v)
    columns = {name: getattr(campaign, name) for name in ("angles", "yaw")}
    return wrong.with_arrays(**{k: angle * v for k, v in columns.items() if v is not None})


def rows(campaign, first, second):
    """The readings in two positions, by their numbers, are exchanged."""
    order = np.arange(campaign.n_positions)
    order[[first - 1, second - 1]] = second - 1, first - 1
    return of_readings(campaign, lambda v: v[order])


def bumped(campaign, position, error=(0.0, 0.1, 0.0)):
    """The mean of a position is wrong by a vector, m/s²."""
    forces = campaign.forces.copy()
    forces[position - 1] += error
    return campaign.with_arrays(forces=forces)
