import logging

from accelstudy.campaign.batch.config import Task
from accelstudy.campaign.batch.run import run_task
from accelstudy.jobs import logged

with logged(snakemake):
    error = run_task(
        Task.model_validate(snakemake.params.task),
        snakemake.output[0],
        snakemake.input.get("public"),
        snakemake.log[0],
    )
    logging.info("%s", error or "calibrated")
