import logging

from accelstudy.diagnosis.report.output import diagnose_folder
from accelstudy.diagnosis.report.words import verdict_lines
from accelstudy.jobs import logged

with logged(snakemake):
    diagnosis = diagnose_folder(
        snakemake.input[0], snakemake.output[0], **snakemake.params.settings
    )
    logging.info("%s", " ".join(verdict_lines(diagnosis)))
