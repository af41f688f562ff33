# Calibrate many campaigns, each by itself, and write one overview of all:
# snakemake --cores 2 --snakefile workflow/campaigns.smk --configfile config/campaigns.yaml
from pathlib import Path

from snakemake.exceptions import WorkflowError
from snakemake.utils import min_version

from accelstudy.campaign.batch.config import parse_batch
from accelstudy.campaign.importing.public import next_attempt
from accelstudy.basics.errors import InputError
from accelstudy.files.outputs import BATCH_JOB
from accelstudy.files.reading import read_layer
from accelstudy.jobs.earlier import earlier_run
from accelstudy.jobs.job import killed_notice, prepare_jobs
from accelstudy.files.outputs import check_writable
from accelstudy.jobs.code import code_hash

min_version("9.10")
prepare_jobs()


# Jobs run in the environment of the Makefile. This is for executors that need a container.
container: "docker://python:3.13-slim"


try:
    if not config:
        raise InputError("no campaigns; name them with --configfile config/campaigns.yaml")
    for path in workflow.configfiles:
        read_layer(path)  # Snakemake's own reading is less strict
    BATCH = parse_batch(config, ", ".join(map(str, workflow.configfiles)) or "config")
    RESULTS = f"results/{BATCH.batch}"
    check_writable(RESULTS)
except InputError as error:
    raise WorkflowError(str(error)) from None

TASKS = {task.name: task for task in BATCH.tasks()}
OUTPUTS = [
    f"{RESULTS}/campaigns.parquet",
    f"{RESULTS}/parameters.parquet",
    f"{RESULTS}/overview.html",
]
RECORDS = [
    f"{RESULTS}/public/{task.source}.json" for task in TASKS.values() if task.kind == "public"
]

# Check earlier results before Snakemake decides what to make. On a cluster, jobs read this file
# again; they skip the check.
if workflow.is_main_process:
    try:
        of_tasks = {f"{RESULTS}/campaigns/{name}": BATCH_JOB for name in TASKS}
        for line in earlier_run(RESULTS, OUTPUTS + RECORDS, {}, None, of_tasks):
            logger.warning(line)
    except InputError as error:
        raise WorkflowError(str(error)) from None


onerror:
    if notice := killed_notice(log):
        logger.error(notice)


wildcard_constraints:
    campaign=r"[^/]+",
    public=r"[^/]+",


def measured_files(wildcards):
    """Files of a campaign that exist. The job reports those that are missing."""
    task = TASKS[wildcards.campaign]
    if task.kind == "public":
        return {"record": f"{RESULTS}/public/{task.source}.json"}
    return {"files": [path for path in task.files() if "{" not in path]}


def braced_files(wildcards):
    """Times of files with a brace in their names. As inputs, Snakemake would see wildcards in them."""
    paths = TASKS[wildcards.campaign].files()
    return {path: Path(path).stat().st_mtime_ns for path in paths if "{" in path}


rule campaigns:
    default_target: True
    input:
        OUTPUTS,


# The downloaded file is no output: Snakemake would delete it before a second try.
rule public:
    output:
        f"{RESULTS}/public/{{public}}.json",
    log:
        f"{RESULTS}/logs/public/{{public}}.log",
    localrule: True
    params:
        folder=BATCH.public_folder,
        attempt=lambda wildcards: next_attempt(f"{RESULTS}/public/{wildcards.public}.json"),
    message:
        "Download the public data {wildcards.public}"
    script:
        "scripts/public.py"


rule calibrate:
    input:
        unpack(measured_files),
    output:
        directory(f"{RESULTS}/campaigns/{{campaign}}"),
    log:
        f"{RESULTS}/logs/campaigns/{{campaign}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/campaigns/{{campaign}}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        task=lambda wildcards: TASKS[wildcards.campaign].model_dump(mode="json"),
        braced=braced_files,
        code=code_hash(workflow.source_path("scripts/calibrate.py")),
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
    benchmark:
        f"{RESULTS}/benchmarks/overview.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        code=code_hash(workflow.source_path("scripts/overview.py")),
    message:
        "Summarise the campaigns"
    script:
        "scripts/overview.py"
