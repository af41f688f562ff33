# Simulate campaigns with hidden effects, diagnose each, and score the diagnoses:
# snakemake --cores 2 --snakefile studies/hidden/hidden.smk
from studies.hidden.cells import number_of_chunks
from studies.hidden.config import parse_hidden
from studies.hidden.campaigns import TABLES
from accelstudy.jobs.job import setup_digest


configfile: "studies/hidden/config/hidden-effects.yaml"


include: "../../workflow/rules/start.smk"


STUDY, RESULTS = configured(parse_hidden, "study")
# Jobs get the checked configuration, with all defaults.
config.update(STUDY.model_dump(mode="json"))
# What the jobs use of it.
PLANNED = STUDY.model_dump(
    mode="json", exclude={"study", "model", "seed", "diagnosis_seed", "baselines_every"}
)
DIAGNOSED = STUDY.model_dump(mode="json", exclude={"study", "baselines_every"})
COMPARED = STUDY.model_dump(mode="json", exclude={"study", "diagnosis_seed"})
CHUNKS = number_of_chunks(STUDY)
NUMBERS = [f"{i:04d}" for i in range(CHUNKS)]
# Digest of what each table of a chunk depends on. It tells those of another configuration.
DIGESTS = {
    **dict.fromkeys(("truths", "outcomes", "seconds"), setup_digest(DIAGNOSED)),
    "baselines": setup_digest(COMPARED),
}
SETUPS = {
    f"{RESULTS}/{table}/{chunk}.parquet": digest
    for table, digest in DIGESTS.items()
    for chunk in NUMBERS
}
OUTPUTS = [
    f"{RESULTS}/plan.json",
    *SETUPS,
    *expand(f"{RESULTS}/{{table}}.parquet", table=TABLES),
]

look_at_earlier(OUTPUTS, SETUPS, STUDY.seed)


onstart:
    logger.info(f"{STUDY.study}: {STUDY.campaigns} campaigns at most, in {CHUNKS} jobs")


wildcard_constraints:
    chunk=r"\d{4}",


rule hidden_effects:
    default_target: True
    input:
        f"{RESULTS}/score.md",


rule hidden_plan:
    output:
        f"{RESULTS}/plan.json",
    log:
        f"{RESULTS}/logs/plan.log",
    benchmark:
        f"{RESULTS}/benchmarks/plan.tsv"
    conda:
        "../../workflow/envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(4000),
    params:
        cells=PLANNED,
        code=code_hash(workflow.source_path("scripts/hidden_plan.py"), "studies"),
    message:
        "Choose the campaigns to simulate"
    script:
        "scripts/hidden_plan.py"


rule hidden_diagnose:
    input:
        rules.hidden_plan.output,
    output:
        truths=f"{RESULTS}/truths/{{chunk}}.parquet",
        outcomes=f"{RESULTS}/outcomes/{{chunk}}.parquet",
        seconds=f"{RESULTS}/seconds/{{chunk}}.parquet",
    log:
        f"{RESULTS}/logs/diagnose/{{chunk}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/diagnose/{{chunk}}.tsv"
    conda:
        "../../workflow/envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(2000),
    params:
        spec=DIAGNOSED,
        code=code_hash(workflow.source_path("scripts/hidden_diagnose.py"), "studies"),
    message:
        "Simulate and diagnose the campaigns of chunk {wildcards.chunk}"
    script:
        "scripts/hidden_diagnose.py"


rule hidden_baselines:
    input:
        rules.hidden_plan.output,
    output:
        f"{RESULTS}/baselines/{{chunk}}.parquet",
    log:
        f"{RESULTS}/logs/baselines/{{chunk}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/baselines/{{chunk}}.tsv"
    conda:
        "../../workflow/envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(2000),
    params:
        spec=COMPARED,
        code=code_hash(workflow.source_path("scripts/hidden_baselines.py"), "studies"),
    message:
        "Diagnose the campaigns of chunk {wildcards.chunk} by simpler methods"
    script:
        "scripts/hidden_baselines.py"


rule hidden_score:
    input:
        truths=expand(f"{RESULTS}/truths/{{chunk}}.parquet", chunk=NUMBERS),
        outcomes=expand(f"{RESULTS}/outcomes/{{chunk}}.parquet", chunk=NUMBERS),
        baselines=expand(f"{RESULTS}/baselines/{{chunk}}.parquet", chunk=NUMBERS),
        seconds=expand(f"{RESULTS}/seconds/{{chunk}}.parquet", chunk=NUMBERS),
    output:
        **{table: f"{RESULTS}/{table}.parquet" for table in TABLES},
        page=f"{RESULTS}/score.md",
        figures=directory(f"{RESULTS}/figures"),
    log:
        f"{RESULTS}/logs/score.log",
    benchmark:
        f"{RESULTS}/benchmarks/score.tsv"
    conda:
        "../../workflow/envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(2000),
    params:
        # What the tables of the chunks do not have: sessions in which nothing is hidden.
        limits=STUDY.model_dump(mode="json", include={"model", "seed", "designs", "approaches"}),
        code=code_hash(workflow.source_path("scripts/hidden_score.py"), "studies"),
    message:
        "Score the diagnoses of all campaigns"
    script:
        "scripts/hidden_score.py"
