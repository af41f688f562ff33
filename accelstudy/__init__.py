"""Monte Carlo study of the calibration of tri-axial accelerometers for leveling.

What a program needs stands here, and is imported when it is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # what a type checker and an editor read; `as` says that it is for users
    from accelstudy.api.advice import SessionAdvice as SessionAdvice
    from accelstudy.api.catalogues import catalogue as catalogue
    from accelstudy.api.logs import Log as Log
    from accelstudy.api.simulations import Simulation as Simulation
    from accelstudy.basics.errors import InputError as InputError
    from accelstudy.campaign.calibration.result import Calibration as Calibration
    from accelstudy.campaign.session import Campaign as Campaign
    from accelstudy.diagnosis.report.output import Diagnosis as Diagnosis
    from accelstudy.epochs.comparison import Comparison as Comparison
    from accelstudy.epochs.history import History as History
    from accelstudy.lots.output import Lot as Lot
    from accelstudy.planning.plan import Plan as Plan
    from accelstudy.proposal.design import Design as Design
    from accelstudy.study.run import run_study as run_study
    from accelstudy.verbs.calibrations import apply as apply
    from accelstudy.verbs.calibrations import calibrate as calibrate
    from accelstudy.verbs.calibrations import check_sigmas as check_sigmas
    from accelstudy.verbs.calibrations import diagnose as diagnose
    from accelstudy.verbs.calibrations import export as export
    from accelstudy.verbs.calibrations import read_calibration as read_calibration
    from accelstudy.verbs.campaigns import find_holds as find_holds
    from accelstudy.verbs.campaigns import read_campaign as read_campaign
    from accelstudy.verbs.campaigns import read_log as read_log
    from accelstudy.verbs.campaigns import simulate_campaign as simulate_campaign
    from accelstudy.verbs.campaigns import write_campaign as write_campaign
    from accelstudy.verbs.planning import advise as advise
    from accelstudy.verbs.planning import data_sheet as data_sheet
    from accelstudy.verbs.planning import find_positions as find_positions
    from accelstudy.verbs.planning import plan as plan
    from accelstudy.verbs.planning import simulate as simulate
    from accelstudy.verbs.sensors import compare as compare
    from accelstudy.verbs.sensors import history as history
    from accelstudy.verbs.sensors import lot as lot

    __version__: str

_NAMES = {
    "api.advice": "SessionAdvice",
    "api.catalogues": "catalogue",
    "api.logs": "Log",
    "api.simulations": "Simulation",
    "basics.errors": "InputError",
    "campaign.calibration.result": "Calibration",
    "campaign.session": "Campaign",
    "diagnosis.report.output": "Diagnosis",
    "epochs.comparison": "Comparison",
    "epochs.history": "History",
    "lots.output": "Lot",
    "planning.plan": "Plan",
    "proposal.design": "Design",
    "study.run": "run_study",
    "verbs.calibrations": "apply calibrate check_sigmas diagnose export read_calibration",
    "verbs.campaigns": "find_holds read_campaign read_log simulate_campaign write_campaign",
    "verbs.planning": "advise data_sheet find_positions plan simulate",
    "verbs.sensors": "compare history lot",
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names.split()}
__all__ = sorted(_MODULES)


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
