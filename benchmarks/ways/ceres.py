"""Ceres, in C++ (`ceres.cpp`), which is compiled here; sessions are drawn in Python, as for all."""

import ctypes
import os
import shutil
import subprocess
from functools import cache
from pathlib import Path

import numpy as np

from accelstudy.basics.units import STANDARD_GRAVITY
from problem import NOISE
from processes import scratch
from ways.base import Way, register

INCLUDE = Path("/usr/include")
NUMBERS = [ctypes.c_int] * 3 + [ctypes.c_void_p] * 2 + [ctypes.c_double] * 3 + [ctypes.c_void_p]
"""Arguments of both functions of `ceres.cpp`."""


@cache
def library():
    """Compile the functions, if this run has not yet, and load them."""
    built = scratch() / "ceres.so"
    if not built.exists():
        source = Path(__file__).with_suffix(".cpp")
        options = ["-O3", "-DNDEBUG", "-march=native", "-std=c++17", "-shared", "-fPIC"]
        options += ["-I", INCLUDE / "eigen3", "-o", built]
        subprocess.run(["g++", *options, source, "-lceres", "-lglog"], check=True)
    return ctypes.CDLL(os.fspath(built))


class Ceres(Way):
    """The residuals of the loops over SciPy, with automatic derivatives."""

    difference = 0.02

    @staticmethod
    def missing():
        """Return what to install."""
        there = (INCLUDE / "ceres/ceres.h").exists() and shutil.which("g++")
        return "" if there else "apt-get install g++ libceres-dev"

    def __init__(self, approach):
        self._robot = approach.uses_angles
        self._function = getattr(library(), self.name.removeprefix("ceres_"))
        self._function.argtypes, self._function.restype = NUMBERS, None

    def solve(self, observed):
        """Solve them."""
        forces = np.ascontiguousarray(observed.forces)
        angles = np.ascontiguousarray(observed.angles if self._robot else forces)
        results = np.empty((2, len(forces), 9))
        self._function(
            self._robot, *forces.shape[:2], forces.ctypes.data, angles.ctypes.data,
            STANDARD_GRAVITY, NOISE.sigma_force, NOISE.sigma_angle, results.ctypes.data,
        )  # fmt: skip
        return results


@register
class Problem(Ceres):
    """A `Problem` of one cost function per position, and its `Covariance`."""

    name, title = "ceres_problem", "Ceres (C++), a `Problem` each"
    calibrations = 500


@register
class TinySolver(Ceres):
    """The solver of Ceres for many small problems."""

    name, title = "ceres_tiny_solver", "Ceres (C++), its `TinySolver`"
    calibrations = 2000
