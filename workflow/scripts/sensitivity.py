from accelstudy.files.tables import read_table, write_table
from accelstudy.jobs import job
from accelstudy.study.config import Study
from accelstudy.study.sensitivity import sensitivity_table, shapley_table

with job(snakemake) as provenance:
    study = Study.model_validate(snakemake.config)
    tables = {name: read_table(paths) for name, paths in snakemake.input.items()}
    sensitivity = sensitivity_table(study, tables["summary"])
    shapley = shapley_table(study, tables["summary"], tables["correlations"])
    write_table(snakemake.output.sensitivity, sensitivity, provenance)
    write_table(snakemake.output.shapley, shapley, provenance)
