rule simulate:
    output:
        estimates=RESULTS + "/estimates/{batch}.parquet",
        correlations=PARTS + "/correlations_adjustment.parquet",
    log:
        RESULTS + "/logs/simulate/{batch}.log",
    benchmark:
        RESULTS + "/benchmarks/simulate/{batch}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        spec=batch_spec,
        code=code_hash("simulate"),
    message:
        "Simulate and calibrate batch {wildcards.batch}"
    script:
        "../scripts/simulate.py"
