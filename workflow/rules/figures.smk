# A job draws many figures, because starting it takes as long as drawing two of them. There are two
# jobs, because the figures of sensitivity wait for its analysis.
rule figures:
    input:
        **inputs_of_figures(CELL_FIGURES),
    output:
        *files_of_figures(CELL_FIGURES),
    log:
        f"{RESULTS}/logs/figures.log",
    benchmark:
        f"{RESULTS}/benchmarks/figures.tsv"
    priority: 1
    conda:
        "../envs/accelstudy.yaml"
    threads: 1
    resources:
        mem_mb=megabytes(1000),
    params:
        study=DRAWN,
        captions=captions(CELL_FIGURES, STUDY),
        code=code_of("figures"),
    message:
        "Draw the figures of the calibrations"
    script:
        "../scripts/figures.py"


use rule figures as sensitivity_figures with:
    input:
        **inputs_of_figures(SENSITIVITY_FIGURES),
    output:
        *files_of_figures(SENSITIVITY_FIGURES),
    log:
        f"{RESULTS}/logs/sensitivity_figures.log",
    benchmark:
        f"{RESULTS}/benchmarks/sensitivity_figures.tsv"
    params:
        study=DRAWN,
        captions=captions(SENSITIVITY_FIGURES, STUDY),
        code=code_of("figures"),
    message:
        "Draw the figures of the sensitivity analysis"


give_captions(rules.figures.rule)
give_captions(rules.sensitivity_figures.rule)
