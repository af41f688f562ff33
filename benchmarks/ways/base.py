"""What a way to calibrate is, and the register of all."""

from abc import ABC, abstractmethod
from typing import ClassVar

from accelstudy.basics.registry import Registry


class Way(ABC):
    """A way to calibrate the sessions of `problem` by one approach.

    Making one prepares it: it compiles what needs to be compiled.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    calibrations: ClassVar[int]
    """How many it does in one turn, about a tenth of a second."""
    difference: ClassVar[float]
    """By how much its estimates may differ from those of the compiled code, in σ."""

    @staticmethod
    def missing() -> str:
        """What to install where it cannot run; empty where it can."""
        return ""

    @abstractmethod
    def __init__(self, approach): ...

    @abstractmethod
    def solve(self, observed):
        """Estimates and their standard deviations a posteriori, (2, R, 9), of R sessions."""


WAYS: Registry[type[Way]] = Registry("way")


def register(way):
    """Make a way known under its name."""
    WAYS.add(way.name, way)
    return way
