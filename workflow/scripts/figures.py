from pathlib import Path

from accelstudy.study.analysis import draw_figures
from accelstudy.study.job import job

with job(snakemake) as (study, _):
    draw_figures(
        study,
        snakemake.params.figures,
        dict(snakemake.input.items()),
        Path(snakemake.output[0]).parent,
    )
