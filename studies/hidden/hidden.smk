# Studies of the diagnosis: jobs make campaigns and diagnose them, and a score judges the answers. `make hidden-effects` runs the
# one that is simulated, `make real-noise` the one with known effects in public logs.
from studies.hidden.campaigns import parse_hidden


include: "../../workflow/rules/start.smk"


STUDY, RESULTS = configured(parse_hidden, "study")
VERSION = code_version(workflow.basedir)
# That of the diagnoses, which take hours: to score them in another way does not run them anew.
UNUSED = "commands drawing epochs lots planning sequential verbs study/figures study/explorer"
DIAGNOSING = code_version(
    workflow.basedir, without=[*UNUSED.split(), f"{workflow.basedir}/scoring"]
)
# What the jobs use of it; where the logs are does not matter.
DIAGNOSED = STUDY.model_dump(mode="json", exclude={"study", "public_folder"})


wildcard_constraints:
    job=one_of(STUDY.jobs),


rule hidden_diagnose:
    output:
        f"{RESULTS}/campaigns/{{job}}.jsonl",
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
    default_target: True
    input:
        expand(rules.hidden_diagnose.output, job=STUDY.jobs),
    output:
        campaigns=f"{RESULTS}/campaigns.parquet",
        figures=directory(f"{RESULTS}/figures"),
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
