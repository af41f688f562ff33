from accelstudy.study.analysis import analyse_sensitivity, analyse_shapley
from accelstudy.study.config import parse_study
from accelstudy.study.job import job

with job(snakemake) as provenance:
    study = parse_study(snakemake.config)
    tables, output = snakemake.input, snakemake.output
    analyse_sensitivity(study, tables.summary, output.sensitivity, provenance)
    analyse_shapley(study, tables.summary, tables.correlations, output.shapley, provenance)
