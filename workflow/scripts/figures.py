from pathlib import Path

from accelstudy.files.tables import read_table
from accelstudy.jobs.job import job
from accelstudy.study.config import StudyConfig
from accelstudy.study.figures import write_figure

with job(snakemake):
    study = StudyConfig.model_validate(snakemake.config)
    tables = {name: read_table(path) for name, path in snakemake.input.items()}
    for name in snakemake.params.captions:
        write_figure(name, tables, study, Path(snakemake.output[0]).parent)
