"""Walk pages and the help as their reader would: run each command, in order, in this folder.

    python walk.py steps.json README.md [PAGE ...]

First come the blocks of the pages, then the example at the end of each command's help. What was run
before is left out. Runs with whatever package is installed; test_walk.py installs it and judges.
"""

import json
import re
import shlex
import subprocess
import sys
import traceback
from pathlib import Path

from click.testing import CliRunner

import accelstudy
from accelstudy.commands.main import main

SKIPPED = {
    "make": "needs the repository, and minutes",
    "snakemake": "needs the repository, and minutes",
    "accelstudy public [a-z-]+": "downloads",
    "accelstudy plan": "takes long; test_plan.py asks the same",
    r".*(zsh|fish)_source": "is for another shell",
}
"""Beginnings of commands that are not run -> why."""
WRITTEN = re.compile(r"^(?:campaign|figure|report): (\S+)", re.MULTILINE)
"""What a command says that it wrote."""


def page_commands(page):
    """Commands in the indented blocks of a page; a page or a block of Python is one command."""
    text = page.read_text("utf-8")
    if page.suffix == ".py":
        yield text
        return
    plain = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    for block in re.findall(r"(?:^ {4}.*\n)+", plain, re.MULTILINE):
        yield from joined(block)
    yield from re.findall(r"```python\n(.*?)```", text, re.DOTALL)


def help_commands():
    """Examples in the help of all commands, in the order of `accelstudy --help`."""
    for name in main.list_commands(None):
        text = CliRunner().invoke(main, [name, "--help"]).output
        yield from joined(text.partition("Example:\n")[2])


def joined(block):
    """Commands of a block; a line that ends with a backslash goes on."""
    return filter(None, map(str.strip, block.replace("\\\n", " ").splitlines()))


def words(command):
    return [command] if command.startswith("import ") else shlex.split(command, comments=True)


def run(command):
    """Exit status and output of a command, in this process where that can be."""
    if command.startswith("accelstudy "):
        result = CliRunner().invoke(main, words(command)[1:])
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            return 1, "".join(traceback.format_exception(result.exception))
        return result.exit_code, result.output
    python = command.startswith("import ")
    process = [sys.executable, "-c", command] if python else ["bash", "-c", command]
    done = subprocess.run(process, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def step(source, command):
    """What came of a command: its exit status, its output, and what it failed to write."""
    made = {"source": source, "command": command}
    for beginning, why in SKIPPED.items():
        if re.match(rf"{beginning}\b", command):
            return {**made, "skipped": why}
    status, output = run(command)
    given = words(command)
    claimed = [given[i + 1] for i, word in enumerate(given) if word in ("--out", "--truth")]
    missing = [path for path in claimed + WRITTEN.findall(output) if not Path(path).exists()]
    return {**made, "status": status, "output": output, "missing": missing}


if __name__ == "__main__":
    out, *pages = map(Path, sys.argv[1:])
    wanted = [(page.name, command) for page in pages for command in page_commands(page)]
    wanted += [("help", command) for command in help_commands()]
    steps, known = [], []
    for source, command in wanted:
        given = words(command)
        before = {"source": source, "command": command, "skipped": "was run before"}
        steps.append(before if given in known else step(source, command))
        known.append(given)
    content = {"package": accelstudy.__file__, "steps": steps}
    out.write_text(json.dumps(content, indent=2, ensure_ascii=False), encoding="utf-8")
