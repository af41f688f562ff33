# Simulate campaigns with hidden effects, diagnose each, and score the diagnoses:
# snakemake --cores 2 --snakefile studies/hidden/hidden.smk
from accelstudy.jobs.job import setup_digest
from studies.hidden.cells import number_of_chunks
from studies.hidden.config import parse_hidden
from studies.hidden.scoring.page import PARTS, TABLES


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
CODE = {
    stage: code_hash(workflow.source_path(f"scripts/hidden_{stage}.py"), "studies")
    for stage in ("plan", "diagnose", "baselines", "score")
}
NUMBERS = [f"{i:04d}" for i in range(number_of_chunks(STUDY))]
CHUNKS = {part: expand(f"{RESULTS}/{part}/{{chunk}}.parquet", chunk=NUMBERS) for part in PARTS}
# Digest of what each table of a chunk depends on. It tells those of another configuration.
SETUPS = {
    path: setup_digest(COMPARED if part == "baselines" else DIAGNOSED)
    for part, paths in CHUNKS.items()
    for path in paths
}
SCORED = {table: f"{RESULTS}/{table}.parquet" for table in TABLES}

look_at_earlier([f"{RESULTS}/plan.json", *SETUPS, *SCORED.values()], SETUPS, STUDY.seed)


onstart:
    logger.info(f"{STUDY.study}: {STUDY.campaigns} campaigns at most, in {len(NUMBERS)} jobs")


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
    conda:
        "../../workflow/envs/accelstudy.yaml"
    resources:
        mem_mb=megabytes(4000),
    params:
        cells=PLANNED,
        code=CODE["plan"],
    message:
        "Choose the campaigns to simulate"
    script:
        "scripts/hidden_plan.py"


rule hidden_diagnose:
    input:
        rules.hidden_plan.output,
    output:
        **{part: f"{RESULTS}/{part}/{{chunk}}.parquet" for part in PARTS if part != "baselines"},
    log:
        f"{RESULTS}/logs/diagnose/{{chunk}}.log",
    conda:
        "../../workflow/envs/accelstudy.yaml"
    resources:
        mem_mb=megabytes(2000),
    params:
        spec=DIAGNOSED,
        code=CODE["diagnose"],
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
    conda:
        "../../workflow/envs/accelstudy.yaml"
    resources:
        mem_mb=megabytes(2000),
    params:
        spec=COMPARED,
        code=CODE["baselines"],
    message:
        "Diagnose the campaigns of chunk {wildcards.chunk} by simpler methods"
    script:
        "scripts/hidden_baselines.py"


rule hidden_score:
    input:
        **CHUNKS,
    output:
        **SCORED,
        page=f"{RESULTS}/score.md",
        figures=directory(f"{RESULTS}/figures"),
    log:
        f"{RESULTS}/logs/score.log",
    conda:
        "../../workflow/envs/accelstudy.yaml"
    resources:
        mem_mb=megabytes(2000),
    params:
        # What the tables of the chunks do not have: sessions in which nothing is hidden.
        limits=STUDY.model_dump(mode="json", include={"model", "seed", "designs", "approaches"}),
        code=CODE["score"],
    message:
        "Score the diagnoses of all campaigns"
    script:
        "scripts/hidden_score.py"
