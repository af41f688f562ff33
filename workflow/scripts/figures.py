from pathlib import Path

from accelstudy.study.analysis import draw_figures
from accelstudy.study.config import parse_study
from accelstudy.study.job import job

with job(snakemake):
    draw_figures(
        parse_study(snakemake.config),
        snakemake.params.figures,
        dict(snakemake.input.items()),
        Path(snakemake.output[0]).parent,
    )
