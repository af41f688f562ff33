from accelstudy.planning.config import PlanConfig

PLAN = section(EXAMPLE, "plan", PlanConfig, SOURCE)
PLAN_FILES = ["plan.parquet", "plan.md", "plan.svg", "plan.png", "positions.yaml", "study.yaml"]
OUTPUTS += [f"{RESULTS}/plan/cases/{name}/{path}" for name in PLAN.cases for path in PLAN_FILES]


rule plan:
    output:
        [f"{RESULTS}/plan/cases/{{plan}}/{path}" for path in PLAN_FILES],
    log:
        f"{RESULTS}/logs/plan/cases/{{plan}}.log",
    conda:
        "../envs/accelstudy.yaml"
    params:
        case=lambda wildcards: PLAN.cases[wildcards.plan].model_dump(mode="json"),
        replicates=PLAN.replicates,
        seed=EXAMPLE.seed,
        angle_unit=angle_unit(),
        version=VERSION,
    message:
        "Plan the calibration {wildcards.plan}"
    script:
        "../scripts/plan.py"
