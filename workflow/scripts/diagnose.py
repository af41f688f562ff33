import logging

from accelstudy import diagnose
from accelstudy.jobs import script_log

with script_log(snakemake):
    diagnosis = diagnose(snakemake.input[0], **snakemake.params.settings)
    diagnosis.save(snakemake.output[0])
    logging.info("%s", diagnosis.verdict)
