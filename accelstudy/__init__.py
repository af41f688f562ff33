"""Monte Carlo study of the calibration of tri-axial accelerometers for leveling.

What a program needs stands here, and is imported when it is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from accelstudy.api.advice import SessionAdvice
    from accelstudy.api.calibrations import Calibration
    from accelstudy.api.catalogues import catalogue
    from accelstudy.api.designs import Design
    from accelstudy.api.diagnoses import Diagnosis
    from accelstudy.api.logs import Log
    from accelstudy.api.lots import Lot
    from accelstudy.api.plans import Plan
    from accelstudy.api.simulations import Simulation
    from accelstudy.basics.errors import InputError
    from accelstudy.campaign.session import Campaign
    from accelstudy.epochs.output import Comparison, History
    from accelstudy.study.run import run_study
    from accelstudy.verbs.calibrations import (
        apply,
        calibrate,
        check_sigmas,
        diagnose,
        export,
        read_calibration,
    )
    from accelstudy.verbs.campaigns import (
        find_holds,
        read_campaign,
        read_log,
        simulate_campaign,
        write_campaign,
    )
    from accelstudy.verbs.planning import advise, data_sheet, find_positions, plan, simulate
    from accelstudy.verbs.sensors import compare, history, lot

    __version__: str

_PLACES = {
    "api.advice": ("SessionAdvice",),
    "api.calibrations": ("Calibration",),
    "api.catalogues": ("catalogue",),
    "api.designs": ("Design",),
    "api.diagnoses": ("Diagnosis",),
    "api.logs": ("Log",),
    "api.lots": ("Lot",),
    "api.plans": ("Plan",),
    "api.simulations": ("Simulation",),
    "basics.errors": ("InputError",),
    "campaign.session": ("Campaign",),
    "epochs.output": ("Comparison", "History"),
    "study.run": ("run_study",),
    "verbs.calibrations": (
        *("apply", "calibrate", "check_sigmas", "diagnose", "export", "read_calibration"),
    ),
    "verbs.campaigns": (
        *("find_holds", "read_campaign", "read_log", "simulate_campaign", "write_campaign"),
    ),
    "verbs.planning": ("advise", "data_sheet", "find_positions", "plan", "simulate"),
    "verbs.sensors": ("compare", "history", "lot"),
}
_MODULES = {name: module for module, names in _PLACES.items() for name in names}

__all__ = [
    "Calibration",
    "Campaign",
    "Comparison",
    "Design",
    "Diagnosis",
    "History",
    "InputError",
    "Log",
    "Lot",
    "Plan",
    "SessionAdvice",
    "Simulation",
    "advise",
    "apply",
    "calibrate",
    "catalogue",
    "check_sigmas",
    "compare",
    "data_sheet",
    "diagnose",
    "export",
    "find_holds",
    "find_positions",
    "history",
    "lot",
    "plan",
    "read_calibration",
    "read_campaign",
    "read_log",
    "run_study",
    "simulate",
    "simulate_campaign",
    "write_campaign",
]


def __getattr__(name: str) -> object:
    """Import a name when it is asked for, since that takes long."""
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
