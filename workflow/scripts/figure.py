from accelstudy.study.analysis import draw_figure
from accelstudy.study.job import job

with job(snakemake) as (study, _):
    draw_figure(
        study,
        snakemake.wildcards.figure,
        dict(snakemake.input.items()),
        snakemake.output.svg,
        snakemake.output.png,
    )
