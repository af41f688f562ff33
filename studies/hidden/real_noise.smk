# Put known effects into the readings of public logs, diagnose them, and score the diagnoses:
# snakemake --cores 2 --snakefile studies/hidden/real_noise.smk
from studies.hidden.real_noise import parse_real_noise


configfile: "studies/hidden/config/real-noise.yaml"


include: "../../workflow/rules/start.smk"


STUDY, RESULTS = configured(parse_real_noise, "study")
VERSION = code_version(workflow.basedir)
# What a log's job uses of it; where the logs are does not matter.
DIAGNOSED = STUDY.model_dump(mode="json", exclude={"study", "public_folder"})
LOGS = [f"{RESULTS}/logs/{name}.parquet" for name in STUDY.logs]


wildcard_constraints:
    log=r"[^/]+",


rule real_noise:
    default_target: True
    input:
        f"{RESULTS}/score.md",


rule real_noise_log:
    output:
        f"{RESULTS}/logs/{{log}}.parquet",
    log:
        f"{RESULTS}/logs/{{log}}.log",
    conda:
        "../../workflow/envs/accelstudy.yaml"
    params:
        spec=DIAGNOSED,
        version=VERSION,
    message:
        "Put effects into {wildcards.log}, and diagnose it"
    script:
        "scripts/real_noise_log.py"


rule real_noise_score:
    input:
        LOGS,
    output:
        campaigns=f"{RESULTS}/campaigns.parquet",
        page=f"{RESULTS}/score.md",
    log:
        f"{RESULTS}/logs/score.log",
    conda:
        "../../workflow/envs/accelstudy.yaml"
    params:
        version=VERSION,
    message:
        "Score the diagnoses of all logs"
    script:
        "scripts/real_noise_score.py"
