# The study in config/config.yaml, run by the workflow that comes with accelstudy.
from accelstudy.files.shipped import shipped


include: str(shipped("workflow/Snakefile"))


# The default target of an included file does not count.
rule study:
    default_target: True
    input:
        rules.all.input,
    message:
        f"All results of the study {STUDY.study}"
