# Calibrate many campaigns, each by itself, and write one overview of all:
# snakemake --cores 2 --snakefile workflow/campaigns.smk --configfile config/campaigns.yaml
from pathlib import Path

from accelstudy.campaign.batch.config import parse_batch
from accelstudy.campaign.importing.public import public_path


include: "rules/start.smk"


BATCH, RESULTS = configured(
    parse_batch, "batch", "no campaigns; name them with --configfile config/campaigns.yaml"
)
VERSION = code_version()
TASKS = {task.name: task for task in BATCH.tasks()}
OUTPUTS = [
    f"{RESULTS}/campaigns.parquet",
    f"{RESULTS}/parameters.parquet",
    f"{RESULTS}/overview.html",
]
PUBLIC = {
    task.source: public_path(task.source, BATCH.public_folder)
    for task in TASKS.values()
    if task.kind == "public"
}


wildcard_constraints:
    campaign=r"[^/]+",
    public=one_of(name for name, path in PUBLIC.items() if not path.exists()),
    file=r"[^/]+",


# Files of campaigns that exist. The job reports those that are missing.
MEASURED = {
    name: (
        {"public": str(PUBLIC[task.source])}
        if task.kind == "public"
        else {"files": [local(path) for path in task.files() if "{" not in path]}
    )
    for name, task in TASKS.items()
}
# Times of files with a brace in their names. As inputs, Snakemake would see wildcards in them.
BRACED = {
    name: {path: Path(path).stat().st_mtime_ns for path in task.files() if "{" in path}
    for name, task in TASKS.items()
}


rule campaigns:
    default_target: True
    input:
        OUTPUTS,
    message:
        f"All results of the batch {BATCH.batch}"


rule public:
    output:
        str(Path(BATCH.public_folder, "{public}", "{file}").expanduser()),
    log:
        f"{RESULTS}/logs/public/{{public}}/{{file}}.log",
    localrule: True
    conda:
        "envs/accelstudy.yaml"
    params:
        folder=lambda wildcards: BATCH.public_folder,
    message:
        "Download the public data {wildcards.public}"
    script:
        "scripts/public.py"


rule calibrate:
    input:
        unpack(lambda wildcards: MEASURED[wildcards.campaign]),
    output:
        directory(f"{RESULTS}/campaigns/{{campaign}}"),
    log:
        f"{RESULTS}/logs/campaigns/{{campaign}}.log",
    conda:
        "envs/accelstudy.yaml"
    params:
        task=lambda wildcards: TASKS[wildcards.campaign].as_params(),
        braced=lambda wildcards: BRACED[wildcards.campaign],
        angle_unit=angle_unit(),
        version=VERSION,
    message:
        "Calibrate {wildcards.campaign}"
    script:
        "scripts/calibrate.py"


rule overview:
    input:
        expand(f"{RESULTS}/campaigns/{{campaign}}", campaign=TASKS),
    output:
        campaigns=f"{RESULTS}/campaigns.parquet",
        parameters=f"{RESULTS}/parameters.parquet",
        page=f"{RESULTS}/overview.html",
    log:
        f"{RESULTS}/logs/overview.log",
    conda:
        "envs/accelstudy.yaml"
    params:
        angle_unit=angle_unit(),
        version=VERSION,
    message:
        "Summarise the campaigns"
    script:
        "scripts/overview.py"
