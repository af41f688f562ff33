rule simulate:
    output:
        **WRITTEN,
    log:
        f"{RESULTS}/logs/simulate/{{part}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/simulate/{{part}}.tsv"
    threads: 1
    resources:
        mem_mb=MEMORY,
    params:
        spec=lambda wildcards: part_spec(wildcards.part),
        code=code_hash(workflow.source_path("../scripts/simulate.py")),
    message:
        "Simulate and calibrate batch {wildcards.part}"
    script:
        "../scripts/simulate.py"
