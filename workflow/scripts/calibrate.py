import logging
import os

from accelstudy.campaign.batch import run_task
from accelstudy.campaign.batch_config import Task
from accelstudy.study.job import logged
from accelstudy.units import ANGLE_UNIT_VARIABLE, angles_in

with logged(snakemake), angles_in(os.environ.get(ANGLE_UNIT_VARIABLE)):
    error = run_task(
        Task.model_validate(snakemake.params.task),
        snakemake.output[0],
        snakemake.input.get("record"),
        snakemake.log[0],
    )
    logging.info("%s", error or "calibrated")
