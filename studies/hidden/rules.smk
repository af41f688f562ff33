# The rules of both studies: their jobs make and diagnose campaigns, and a score judges the answers.
from studies.hidden.campaigns import parse_hidden


include: "../../workflow/rules/start.smk"


STUDY, RESULTS = configured(parse_hidden, "study")
VERSION = code_version(workflow.basedir)
# That of the diagnoses, which take hours: to score them in another way does not run them anew.
UNUSED = "api commands drawing epochs lots pages planning sequential study/figures study/explorer"
DIAGNOSING = code_version(
    workflow.basedir, without=[*UNUSED.split(), f"{workflow.basedir}/scoring"]
)
# What the jobs use of it; where the logs are does not matter.
DIAGNOSED = STUDY.model_dump(mode="json", exclude={"study", "public_folder"})
SCORED = {table: f"{RESULTS}/{table}.parquet" for table in STUDY.tables}
if "targets" in SCORED:
    SCORED["figures"] = directory(f"{RESULTS}/figures")
PARTS = {part: f"{RESULTS}/{part}/{{job}}.parquet" for part in ("campaigns", "seconds")}


wildcard_constraints:
    job=one_of(STUDY.jobs),


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
        spec=DIAGNOSED,
        version=DIAGNOSING,
    message:
        "Choose the campaigns of {STUDY.study}"
    script:
        "scripts/plan.py"


rule hidden_diagnose:
    input:
        rules.hidden_plan.output,
    output:
        **PARTS,
    log:
        f"{RESULTS}/logs/{{job}}.log",
    conda:
        "../../workflow/envs/accelstudy.yaml"
    params:
        spec=DIAGNOSED,
        version=DIAGNOSING,
    message:
        "Make and diagnose the campaigns of {wildcards.job}"
    script:
        "scripts/diagnose.py"


rule hidden_score:
    input:
        **{part: expand(path, job=STUDY.jobs) for part, path in PARTS.items()},
    output:
        **SCORED,
        page=f"{RESULTS}/score.md",
    log:
        f"{RESULTS}/logs/score.log",
    conda:
        "../../workflow/envs/accelstudy.yaml"
    params:
        spec=DIAGNOSED,
        version=VERSION,
    message:
        "Score the diagnoses of all campaigns"
    script:
        "scripts/score.py"
