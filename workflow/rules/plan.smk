from accelstudy.plan.config import PlanConfig

PLAN = section("plan", PlanConfig)
PLAN_OUTPUTS = [f"{RESULTS}/plan/sensors.parquet"]


rule sensors:
    output:
        f"{RESULTS}/plan/sensors.parquet",
    log:
        f"{RESULTS}/logs/plan/sensors.log",
    benchmark:
        f"{RESULTS}/benchmarks/plan/sensors.tsv"
    threads: 1
    resources:
        mem_mb=1000,
    params:
        sensors=PLAN.chosen_sensors,
        seconds=PLAN.seconds,
        provenance=PROVENANCE,
        code=code_hash("planning"),
    message:
        "Tabulate the sensors"
    script:
        "../scripts/plan_sensors.py"
