import logging
import os

from accelstudy.basics.units import ANGLE_UNIT_VARIABLE, angles_in
from accelstudy.diagnosis.report.output import diagnose_folder
from accelstudy.diagnosis.report.words import verdict_lines
from accelstudy.jobs.job import logged

with logged(snakemake), angles_in(os.environ.get(ANGLE_UNIT_VARIABLE)):
    diagnosis = diagnose_folder(
        snakemake.input[0], snakemake.output[0], **snakemake.params.settings
    )
    logging.info("%s", " ".join(verdict_lines(diagnosis)))
