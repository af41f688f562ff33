rule simulate:
    input:
        # Schemes and plug-ins; the prefix of a module does not move what is `local`.
        map(local, named_files(config)),
    output:
        **{name: f"{RESULTS}/tables/{SET_UP}/{name}.parquet" for name in TABLES},
        # A file system that loses what was written ends here, not in a later job.
        estimates=ensure(f"{RESULTS}/estimates/{SET_UP}.parquet", non_empty=True),
    log:
        f"{RESULTS}/logs/simulate/{SET_UP}.log",
    conda:
        "../envs/accelstudy.yaml"
    resources:
        mem_mb=lambda wildcards, attempt: memory(SET_UPS[SET_UP.format(**wildcards)]) * attempt,
    params:
        cells=lambda wildcards: SET_UPS[SET_UP.format(**wildcards)],
        seed=STUDY.seed,
        version=NUMBERS,
    message:
        "Simulate and calibrate {wildcards}"
    script:
        "../scripts/simulate.py"


rule collect:
    input:
        **{
            name: expand(f"{RESULTS}/tables/{{set_up}}/{name}.parquet", set_up=SET_UPS)
            for name in TABLES
        },
    output:
        **{name: f"{RESULTS}/{name}.parquet" for name in TABLES},
    log:
        f"{RESULTS}/logs/collect.log",
    conda:
        "../envs/accelstudy.yaml"
    params:
        cells=[cell.name for cell in CELLS],
        version=NUMBERS,
    message:
        "Join the tables of all set-ups"
    script:
        "../scripts/collect.py"
