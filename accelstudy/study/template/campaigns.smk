# What config/config.yaml asks for, run by the workflow that comes with accelstudy.
from accelstudy.files.shipped import shipped


configfile: "config/config.yaml"


include: str(shipped("workflow/campaigns.smk"))


# The default target of an included file does not count.
rule all:
    default_target: True
    input:
        rules.campaigns.input,
    message:
        f"All results of the batch {BATCH.batch}"
