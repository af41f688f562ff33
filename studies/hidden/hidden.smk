# Simulate campaigns with hidden effects, diagnose each, and score the diagnoses:
# snakemake --cores 2 --snakefile studies/hidden/hidden.smk
from studies.hidden.cells import number_of_chunks
from studies.hidden.config import parse_hidden
from studies.hidden.scoring.page import PARTS, TABLES


configfile: "studies/hidden/config/hidden-effects.yaml"


include: "../../workflow/rules/start.smk"


STUDY, RESULTS = configured(parse_hidden, "study")
VERSION = code_version(workflow.basedir)
# That of the diagnoses, which take hours: to score them in another way does not run them anew.
UNUSED = "api commands drawing epochs lots pages planning sequential study/figures study/explorer"
DIAGNOSING = code_version(
    workflow.basedir, without=[*UNUSED.split(), f"{workflow.basedir}/scoring"]
)
# What the jobs use of it.
PLANNED = STUDY.model_dump(
    mode="json", exclude={"study", "model", "seed", "diagnosis_seed", "baselines_every"}
)
DIAGNOSED = STUDY.model_dump(mode="json", exclude={"study", "baselines_every"})
COMPARED = STUDY.model_dump(mode="json", exclude={"study", "diagnosis_seed"})
NUMBERS = [f"{i:04d}" for i in range(number_of_chunks(STUDY))]
CHUNKS = {part: expand(f"{RESULTS}/{part}/{{chunk}}.parquet", chunk=NUMBERS) for part in PARTS}
SCORED = {table: f"{RESULTS}/{table}.parquet" for table in TABLES}


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
        mem_mb=4000,
    params:
        cells=PLANNED,
        version=DIAGNOSING,
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
    params:
        spec=DIAGNOSED,
        version=DIAGNOSING,
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
    params:
        spec=COMPARED,
        version=DIAGNOSING,
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
    params:
        # What the tables of the chunks do not have: sessions in which nothing is hidden.
        limits=STUDY.model_dump(mode="json", include={"model", "seed", "designs", "approaches"}),
        version=VERSION,
    message:
        "Score the diagnoses of all campaigns"
    script:
        "scripts/hidden_score.py"
