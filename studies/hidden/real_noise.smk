# Put known effects into the readings of public logs, diagnose them, and score the diagnoses:
# snakemake --cores 2 --snakefile studies/hidden/real_noise.smk
from accelstudy.jobs.job import setup_digest
from studies.hidden.real_noise import parse_real_noise


configfile: "studies/hidden/config/real-noise.yaml"


include: "../../workflow/rules/start.smk"


STUDY, RESULTS = configured(parse_real_noise, "study")
# Jobs get the checked configuration, with all defaults.
config.update(STUDY.model_dump(mode="json"))
# What a log's job uses of it; where the logs are does not matter.
DIAGNOSED = STUDY.model_dump(mode="json", exclude={"study", "public_folder"})
SETUPS = {f"{RESULTS}/logs/{name}.parquet": setup_digest(DIAGNOSED) for name in STUDY.logs}

look_at_earlier([*SETUPS, f"{RESULTS}/campaigns.parquet"], SETUPS, STUDY.seed)


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
    resources:
        mem_mb=megabytes(2000),
    params:
        spec=DIAGNOSED,
        code=code_hash(workflow.source_path("scripts/real_noise_log.py"), "studies"),
    message:
        "Put effects into {wildcards.log}, and diagnose it"
    script:
        "scripts/real_noise_log.py"


rule real_noise_score:
    input:
        [*SETUPS],
    output:
        campaigns=f"{RESULTS}/campaigns.parquet",
        page=f"{RESULTS}/score.md",
    log:
        f"{RESULTS}/logs/score.log",
    conda:
        "../../workflow/envs/accelstudy.yaml"
    resources:
        mem_mb=megabytes(2000),
    params:
        code=code_hash(workflow.source_path("scripts/real_noise_score.py"), "studies"),
    message:
        "Score the diagnoses of all logs"
    script:
        "scripts/real_noise_score.py"
