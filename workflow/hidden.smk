# Simulate campaigns with hidden effects, diagnose each, and score the diagnoses:
# snakemake --cores 2 --snakefile workflow/hidden.smk
from snakemake.exceptions import WorkflowError
from snakemake.utils import min_version

from accelstudy.basics.errors import InputError
from accelstudy.hidden.cells import number_of_chunks
from accelstudy.hidden.config import parse_hidden
from accelstudy.hidden.campaigns import TABLES
from accelstudy.files.reading import read_layer
from accelstudy.jobs.earlier import earlier_run
from accelstudy.jobs.job import killed_notice, prepare_jobs
from accelstudy.files.outputs import check_writable
from accelstudy.jobs.code import code_hash

min_version("9.10")
prepare_jobs()


configfile: "config/hidden-effects.yaml"


# Jobs run in the environment of the Makefile. This is for executors that need a container.
container: "docker://python:3.13-slim"


try:
    for path in workflow.configfiles:
        read_layer(path)  # Snakemake's own reading is less strict
    STUDY = parse_hidden(config, ", ".join(map(str, workflow.configfiles)) or "config")
    RESULTS = f"results/{STUDY.study}"
    check_writable(RESULTS)
except InputError as error:
    raise WorkflowError(str(error)) from None

CONTENT = STUDY.model_dump(mode="json")
ORIGIN = {"config_hash": STUDY.fingerprint, "seed": STUDY.seed}
CHUNKS = number_of_chunks(STUDY)
NUMBERS = [f"{i:04d}" for i in range(CHUNKS)]
BY_CHUNK = expand(
    f"{RESULTS}/{{table}}/{{chunk}}.parquet",
    table=["truths", "outcomes", "seconds", "baselines"],
    chunk=NUMBERS,
)
OUTPUTS = [
    f"{RESULTS}/plan.json",
    *BY_CHUNK,
    *expand(f"{RESULTS}/{{table}}.parquet", table=TABLES),
]

# Check earlier results before Snakemake decides what to make. On a cluster, jobs read this file
# again; they skip the check.
if workflow.is_main_process:
    try:
        of_this = dict.fromkeys(BY_CHUNK, STUDY.fingerprint)
        for line in earlier_run(RESULTS, OUTPUTS, of_this, STUDY.seed):
            logger.warning(line)
    except InputError as error:
        raise WorkflowError(str(error)) from None


onstart:
    logger.info(f"{STUDY.study}: {STUDY.campaigns} campaigns at most, in {CHUNKS} jobs")


onerror:
    if notice := killed_notice(log):
        logger.error(notice)


wildcard_constraints:
    chunk=r"\d{4}",


rule hidden_effects:
    default_target: True
    input:
        f"{RESULTS}/score.md",


rule plan:
    output:
        f"{RESULTS}/plan.json",
    log:
        f"{RESULTS}/logs/plan.log",
    benchmark:
        f"{RESULTS}/benchmarks/plan.tsv"
    threads: 1
    resources:
        mem_mb=4000,
    params:
        config=CONTENT,
        code=code_hash(workflow.source_path("scripts/hidden_plan.py")),
    message:
        "Choose the campaigns to simulate"
    script:
        "scripts/hidden_plan.py"


rule diagnose:
    input:
        rules.plan.output,
    output:
        truths=f"{RESULTS}/truths/{{chunk}}.parquet",
        outcomes=f"{RESULTS}/outcomes/{{chunk}}.parquet",
        seconds=f"{RESULTS}/seconds/{{chunk}}.parquet",
    log:
        f"{RESULTS}/logs/diagnose/{{chunk}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/diagnose/{{chunk}}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        config=CONTENT,
        provenance=ORIGIN,
        code=code_hash(workflow.source_path("scripts/hidden_diagnose.py")),
    message:
        "Simulate and diagnose the campaigns of chunk {wildcards.chunk}"
    script:
        "scripts/hidden_diagnose.py"


rule baselines:
    input:
        rules.plan.output,
    output:
        f"{RESULTS}/baselines/{{chunk}}.parquet",
    log:
        f"{RESULTS}/logs/baselines/{{chunk}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/baselines/{{chunk}}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        config=CONTENT,
        provenance=ORIGIN,
        code=code_hash(workflow.source_path("scripts/hidden_baselines.py")),
    message:
        "Diagnose the campaigns of chunk {wildcards.chunk} by simpler methods"
    script:
        "scripts/hidden_baselines.py"


rule score:
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
    threads: 1
    resources:
        mem_mb=2000,
    params:
        config=CONTENT,
        provenance=ORIGIN,
        code=code_hash(workflow.source_path("scripts/hidden_score.py")),
    message:
        "Score the diagnoses of all campaigns"
    script:
        "scripts/hidden_score.py"
