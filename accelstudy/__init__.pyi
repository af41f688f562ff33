# What users import from accelstudy, for type checkers and editors, and for `__init__.py`.
from accelstudy.basics.errors import InputError as InputError
from accelstudy.campaign.batch import Batch as Batch
from accelstudy.campaign.calibration.result import Calibration as Calibration
from accelstudy.campaign.importing.log import Log as Log
from accelstudy.campaign.session import Campaign as Campaign
from accelstudy.data_sheets.sheet import DataSheet as DataSheet
from accelstudy.diagnosis.report.output import Diagnosis as Diagnosis
from accelstudy.epochs.history import History as History
from accelstudy.lots.output import Lot as Lot
from accelstudy.planning.design import Design as Design
from accelstudy.planning.plan import Plan as Plan
from accelstudy.sequential.advice import Advice as Advice
from accelstudy.study.result import Simulation as Simulation
from accelstudy.study.run import run_study as run_study
from accelstudy.verbs.calibrations import apply as apply
from accelstudy.verbs.calibrations import calibrate as calibrate
from accelstudy.verbs.calibrations import check_sigmas as check_sigmas
from accelstudy.verbs.calibrations import diagnose as diagnose
from accelstudy.verbs.calibrations import export as export
from accelstudy.verbs.calibrations import read_calibration as read_calibration
from accelstudy.verbs.campaigns import find_holds as find_holds
from accelstudy.verbs.campaigns import public as public
from accelstudy.verbs.campaigns import read_campaign as read_campaign
from accelstudy.verbs.campaigns import read_log as read_log
from accelstudy.verbs.campaigns import simulate_campaign as simulate_campaign
from accelstudy.verbs.campaigns import write_campaign as write_campaign
from accelstudy.verbs.planning import advise as advise
from accelstudy.verbs.planning import data_sheet as data_sheet
from accelstudy.verbs.planning import find_positions as find_positions
from accelstudy.verbs.planning import plan as plan
from accelstudy.verbs.planning import simulate as simulate
from accelstudy.verbs.sensors import batch as batch
from accelstudy.verbs.sensors import compare as compare
from accelstudy.verbs.sensors import history as history
from accelstudy.verbs.sensors import lot as lot
from accelstudy.verbs.studies import catalogue as catalogue
from accelstudy.verbs.studies import cells as cells
from accelstudy.verbs.studies import claims as claims
from accelstudy.verbs.studies import config_schema as config_schema
from accelstudy.verbs.studies import init as init
from accelstudy.verbs.studies import list_effects as list_effects
from accelstudy.verbs.studies import list_schemes as list_schemes
from accelstudy.verbs.studies import scheme as scheme

__all__: list[str]
__version__: str
