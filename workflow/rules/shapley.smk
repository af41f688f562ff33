rule shapley:
    input:
        summary=f"{RESULTS}/summary.parquet",
        correlations=f"{RESULTS}/correlations.parquet",
    output:
        f"{RESULTS}/shapley.parquet",
    log:
        f"{RESULTS}/logs/shapley.log",
    benchmark:
        f"{RESULTS}/benchmarks/shapley.tsv"
    threads: 1
    resources:
        mem_mb=1000,
    params:
        settings=STUDY.sensitivity.model_dump() if STUDY.sensitivity else None,
        sensor=STUDY.model_dump(include={"seed", "gravity_mps2", "noise", "sensor"}),
        code=code_hash("sensitivity"),
    message:
        "Share out the variance of roll and pitch to correlated parameters"
    script:
        "../scripts/shapley.py"
