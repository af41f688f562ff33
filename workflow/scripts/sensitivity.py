from accelstudy.jobs.job import job, lists
from accelstudy.study.config import StudyConfig
from accelstudy.study.sensitivity import analyse_sensitivity, analyse_shapley

with job(snakemake) as provenance:
    study = StudyConfig.model_validate(snakemake.config)
    tables, output = lists(snakemake.input), snakemake.output
    analyse_sensitivity(study, tables["summary"], output.sensitivity, provenance)
    analyse_shapley(study, tables["summary"], tables["correlations"], output.shapley, provenance)
