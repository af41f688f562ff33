rule simulate:
    output:
        estimates=f"{RESULTS}/estimates/{{batch}}.parquet",
        correlations=f"{PARTS}/correlations_adjustment.parquet",
    log:
        f"{RESULTS}/logs/simulate/{{batch}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/simulate/{{batch}}.tsv"
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
