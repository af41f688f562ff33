# Entry point, so that `snakemake` works in the root folder; the workflow itself is in workflow/.
include: "workflow/Snakefile"


# The default target of an included file does not count.
rule study:
    default_target: True
    input:
        rules.all.input,
    message:
        f"All results of the study {STUDY.study}"
