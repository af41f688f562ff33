from accelstudy.field.config import FieldConfig

FIELD = section(EXAMPLE, "field", FieldConfig, SOURCE).cases
FIELD_FILES = [f"shares.{kind}" for kind in ("parquet", "svg", "png")]
OUTPUTS += [f"{RESULTS}/field/{name}/{path}" for name in FIELD for path in FIELD_FILES]


rule field:
    input:
        lambda wildcards: [given(path) for path in FIELD[wildcards.case].files],
    output:
        *(f"{RESULTS}/field/{{case}}/{path}" for path in FIELD_FILES),
    log:
        f"{RESULTS}/logs/field/{{case}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/field/{{case}}.tsv"
    conda:
        "../envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(1000),
    params:
        case=lambda wildcards: FIELD[wildcards.case].model_dump(exclude_unset=True),
        seed=EXAMPLE.seed,
        code=code_of("field"),
    message:
        "Work out which errors the variance of roll and pitch comes from: {wildcards.case}"
    script:
        "../scripts/field.py"
