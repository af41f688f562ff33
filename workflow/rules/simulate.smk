rule simulate:
    output:
        **{name: f"{BATCH}/{name}.parquet" for name in TABLES},
        estimates=ESTIMATES,
    log:
        f"{RESULTS}/logs/simulate/{{batch}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/simulate/{{batch}}.tsv"
    conda:
        "../envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=lambda wildcards, attempt: memory(BATCHES[wildcards.batch]) * attempt,
    params:
        spec=lambda wildcards: batch_spec(wildcards.batch),
        code=code_of("simulate"),
    message:
        "Simulate and calibrate batch {wildcards.batch}"
    script:
        "../scripts/simulate.py"


rule collect:
    input:
        **{table: expand(f"{BATCH}/{table}.parquet", batch=BATCHES) for table in TABLES},
    output:
        **{table: f"{RESULTS}/{table}.parquet" for table in TABLES},
    log:
        f"{RESULTS}/logs/collect.log",
    benchmark:
        f"{RESULTS}/benchmarks/collect.tsv"
    conda:
        "../envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(1000),
    params:
        code=code_of("collect"),
    message:
        "Join the tables of all batches"
    script:
        "../scripts/collect.py"
