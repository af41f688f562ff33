# Simulate campaigns with hidden effects, diagnose each, and score the diagnoses:
# snakemake --cores 2 --snakefile studies/hidden/hidden.smk
configfile: "studies/hidden/config/hidden-effects.yaml"


include: "rules.smk"


rule hidden_effects:
    default_target: True
    input:
        rules.hidden_score.output.page,
