"""Walk a text as its reader would: run each command in it, in order, in the present folder.

    python walk.py README.md steps.json    # the blocks of a README
    python walk.py help steps.json         # the example at the end of each command's help

Runs with whatever package is installed; test_walk.py installs it and judges the outcome.
"""

import json
import re
import shlex
import subprocess
import sys
import traceback
from pathlib import Path

from click.testing import CliRunner

SKIPPED = {
    "make": "needs the repository, and minutes",
    "snakemake": "needs the repository, and minutes",
    "source": "needs the repository",
    "accelstudy public [a-z-]+": "downloads",
    r".*(zsh|fish)_source": "is for another shell",
}
"""Beginnings of commands that are not run -> why."""
WRITTEN = re.compile(r"^(?:campaign|figure|model|report|table): (\S+)", re.MULTILINE)
"""What a command says that it wrote."""


def readme_commands(text):
    """Commands in the indented blocks of a Markdown text, and its runnable Python blocks."""
    plain = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    for block in re.findall(r"(?:^ {4}.*\n)+", plain, re.MULTILINE):
        yield from joined(block)
    for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        if block.startswith("import "):
            yield block


def help_commands(main):
    """Examples in the help of all commands, in the order of `accelstudy --help`."""
    for name in main.list_commands(None):
        text = CliRunner().invoke(main, [name, "--help"]).output
        _, _, example = text.partition("Example:\n")
        yield from joined(example)


def joined(block):
    """Commands of a block; a line that ends with a backslash goes on."""
    return filter(None, map(str.strip, block.replace("\\\n", " ").splitlines()))


def run(main, command):
    """Exit status and output of a command, in this process where that can be."""
    if command.startswith("import "):
        process = [sys.executable, "-c", command]
    elif command.startswith("accelstudy "):
        result = CliRunner().invoke(main, shlex.split(command, comments=True)[1:])
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            return 1, "".join(traceback.format_exception(result.exception))
        return result.exit_code, result.output
    else:
        process = ["bash", "-c", command]
    done = subprocess.run(process, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def walk(main, command):
    """What came of a command: its exit status, its output, and what it failed to write."""
    for beginning, why in SKIPPED.items():
        if re.match(rf"{beginning}\b", command):
            return {"command": command, "skipped": why}
    status, output = run(main, command)
    words = [] if command.startswith("import ") else shlex.split(command, comments=True)
    claimed = [words[i + 1] for i, word in enumerate(words) if word in ("--out", "--truth")]
    missing = [path for path in claimed + WRITTEN.findall(output) if not Path(path).exists()]
    return {"command": command, "status": status, "output": output, "missing": missing}


if __name__ == "__main__":
    import accelstudy
    from accelstudy.cli import main

    source, out = sys.argv[1:]
    commands = (
        help_commands(main)
        if source == "help"
        else readme_commands(Path(source).read_text(encoding="utf-8"))
    )
    steps = [walk(main, command) for command in commands]
    content = {"package": accelstudy.__file__, "steps": steps}
    Path(out).write_text(json.dumps(content, indent=2, ensure_ascii=False), encoding="utf-8")
