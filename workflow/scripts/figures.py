from pathlib import Path

from accelstudy.jobs.job import job
from accelstudy.study.config import StudyConfig
from accelstudy.study.figures import draw_figures

with job(snakemake):
    draw_figures(
        StudyConfig.model_validate(snakemake.config),
        snakemake.params.captions,
        dict(snakemake.input.items()),
        Path(snakemake.output[0]).parent,
    )
