"""Monte Carlo study of the calibration of tri-axial accelerometers for leveling."""

from importlib.metadata import version

__version__ = version("accelstudy")
