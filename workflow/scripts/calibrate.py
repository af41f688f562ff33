import logging

from accelstudy.campaign.batch.config import CampaignEntry
from accelstudy.campaign.batch.run import run_task
from accelstudy.jobs import script_log

with script_log(snakemake):
    error = run_task(
        CampaignEntry.model_validate(snakemake.params.task),
        snakemake.output[0],
        snakemake.input.get("public"),
        snakemake.log[0],
    )
    logging.info("%s", error or "calibrated")
