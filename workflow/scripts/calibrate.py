import logging
import os

from accelstudy.basics.units import ANGLE_UNIT_VARIABLE, angles_in
from accelstudy.campaign.batch.config import Task
from accelstudy.campaign.batch.run import run_task
from accelstudy.jobs.job import logged

with logged(snakemake), angles_in(os.environ.get(ANGLE_UNIT_VARIABLE)):
    error = run_task(
        Task.model_validate(snakemake.params.task),
        snakemake.output[0],
        snakemake.input.get("record"),
        snakemake.log[0],
    )
    logging.info("%s", error or "calibrated")
