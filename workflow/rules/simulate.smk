rule simulate:
    output:
        **WRITTEN,
    log:
        f"{RESULTS}/logs/simulate/{{part}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/simulate/{{part}}.tsv"
    threads: 1
    resources:
        mem_mb=megabytes(MEMORY),
    params:
        spec=lambda wildcards: part_spec(wildcards.part),
        code=code_of("simulate"),
    message:
        "Simulate and calibrate batch {wildcards.part}"
    script:
        "../scripts/simulate.py"
