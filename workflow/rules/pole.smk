from accelstudy.pole.config import PoleConfig

POLES = section(EXAMPLE, "pole", PoleConfig, SOURCE).cases
POLE_FILES = {
    "summary": "pole.json",
    "budget": "budget.parquet",
    "simulated": "monte-carlo.parquet",
    "svg": "budget.svg",
    "png": "budget.png",
}
OUTPUTS += [f"{RESULTS}/pole/{name}/{path}" for name in POLES for path in POLE_FILES.values()]


rule pole:
    input:
        lambda wildcards: [given(path) for path in POLES[wildcards.pole].files],
    output:
        **{kind: f"{RESULTS}/pole/{{pole}}/{path}" for kind, path in POLE_FILES.items()},
    log:
        f"{RESULTS}/logs/pole/{{pole}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/pole/{{pole}}.tsv"
    conda:
        "../envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(1000),
    params:
        case=lambda wildcards: POLES[wildcards.pole].model_dump(exclude_unset=True),
        seed=EXAMPLE.seed,
        code=code_of("pole"),
    message:
        "Work out the error of the pole's foot: {wildcards.pole}"
    script:
        "../scripts/pole.py"
