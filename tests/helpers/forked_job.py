"""Execute the script of a job as a new Python would, in a process that has imported all before.

`snakemake_helpers.py` hands over `script`, `folder`, `environment`, and the file that gets what the
job prints. It names no function of its own, as its imports would take longer than most jobs. What
PREPARE_JOB of the environment says is done before the script.
"""

import os
import runpy
import sys

with open(printed, "ab") as file:  # noqa: F821
    for number in (1, 2):
        os.dup2(file.fileno(), number)
os.environ.clear()
os.environ.update(environment)  # noqa: F821
os.chdir(folder)  # noqa: F821
sys.argv = [script]  # noqa: F821
exec(os.environ.pop("PREPARE_JOB", ""), {})
runpy.run_path(script, run_name="__main__")  # noqa: F821
