"""What a reader's commands print and write, as text that a person can read in a diff."""

import html
import importlib.metadata
import multiprocessing
import os
import re
import runpy
import shlex
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from places import ROOT

# --- files as text -------------------------------------------------------------------------------

LONG_NUMBER = re.compile(r"(?<![\w.])[-−]?\d+\.\d{9,}(?:[eE][-+]?\d+)?")
OF_DIFFERENCES = r"_(?:se|gain)$|_error_simulated"
"""Columns of standard errors and gains, which come from differences of nearly equal numbers."""
ROWS = 40
"""Rows that are shown of a longer table; the line of a column tells of all rows."""
BLOCKS = r"h\d|[duo]l|d[dt]|li|p|div|pre|br|table|tr|section|header|footer|figcaption|summary"
"""Elements of a page that begin a line."""


def masked(text, folder):
    """A text without what differs from run to run, and numbers of many digits with 12 of them."""
    for path, name in ((str(folder), "FOLDER"), (str(ROOT), "ROOT"), (sys.executable, "PYTHON")):
        text = text.replace(path, name)
    version = re.escape(importlib.metadata.version("accelstudy"))
    text = re.sub(rf"(?<![\w.]){version}(?![\w.])", "VERSION", text)
    return LONG_NUMBER.sub(lambda found: f"{float(found[0].replace('−', '-')):.12g}", text)


def table_text(table):
    """The columns of a table with what all rows say together, and rows evenly chosen.

    Of what comes from differences three digits are the same on all processors.
    """
    rough = table.columns[table.columns.str.contains(OF_DIFFERENCES)]
    rounded = {name: [float(f"{value:.3g}") for value in table[name]] for name in rough}
    table = table.assign(**rounded)
    lines = [f"{len(table)} rows"]
    for name, column in table.items():
        numbers = pd.to_numeric(column, errors="coerce").astype(float)
        if numbers.notna().any():
            # Of sizes, as a mean in which signs cancel is rounding.
            found = (numbers.abs().mean(), numbers.min(), numbers.max())
            summary = "mean size {:.12g}, from {:.12g} to {:.12g}".format(*found)
        else:
            summary = f"{column.astype(str).nunique()} different texts"
        lines.append(f"{name}: {column.notna().sum()} values, {summary}")
    chosen = np.unique(np.linspace(0, len(table) - 1, min(ROWS, len(table))).round().astype(int))
    return "\n".join(lines) + "\n" + rows_text(table.iloc[chosen])


def rows_text(table):
    """A table as comma-separated text, a row a line."""
    return table.to_csv(index=False, float_format="%.12g", lineterminator="\n")


def page_text(page):
    """What a reader of an HTML page reads, a paragraph or row a line."""
    page = re.sub(r"<(script|style|title)\b.*?</\1>", "", page, flags=re.DOTALL)
    page = re.sub(r"<svg\b.*?</svg>", lambda found: f"<p>{figure_text(found[0])}</p>", page,
                  flags=re.DOTALL)  # fmt: skip
    page = re.sub(r"</t[dh]>\s*(?=<t[dh])", " | ", re.sub(r"\s+", " ", page))
    page = re.sub(rf"</?(?:{BLOCKS})\b[^>]*>", "\n", page)
    lines = html.unescape(re.sub(r"<[^>]*>", "", page)).splitlines()
    return "\n".join(filter(None, (" ".join(line.split()) for line in lines)))


def figure_text(svg):
    """The size of a drawing, and the texts in it."""
    size = re.search(r"<svg\b[^>]*?(viewBox=\"[^\"]*\")?", svg)[1] or "drawing"
    texts = re.findall(r"<!-- (.*?) -->|<text\b[^>]*>(.*?)</text>", svg)
    return f"{size} {'; '.join(dict.fromkeys(html.unescape(a or b) for a, b in texts))}"


def file_text(path):
    """A file as text that a person reads."""
    content = path.read_bytes()
    if path.suffix == ".parquet":
        return table_text(pd.read_parquet(path))
    if path.suffix == ".png":
        return "picture {} x {}".format(*struct.unpack(">II", content[16:24]))
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError:
        return "not a text"
    if path.suffix == ".csv" and text.count("\n") > 2 * ROWS:
        return table_text(pd.read_csv(path, comment="#"))
    convert = {".html": page_text, ".svg": figure_text}.get(path.suffix, str)
    return convert(text)


# --- commands of a page --------------------------------------------------------------------------

PROGRAMS = r"^ {4,}(accelstudy|cp|eval|for|head|make|mkdir|python|snakemake)\b"


def commands_of_page(text):
    """Commands that a page shows: lines of its indented blocks, then its blocks of Python."""
    python = re.findall(r"^```python\n(import accelstudy.*?)^```", text, re.DOTALL | re.MULTILINE)
    plain = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    blocks = re.findall(r"(?:^ {4}.*\n)+", plain, re.MULTILINE)
    return commands_of_script("".join(b for b in blocks if re.search(PROGRAMS, b, re.M))) + python


def commands_of_script(text):
    """Commands of a shell script; a loop is one command, as are lines that a backslash joins."""
    text = re.sub(r"^ *for (?:.|\n)*?\bdone$", _in_a_line, text, flags=re.MULTILINE)
    lines = (" ".join(line.split()) for line in text.replace("\\\n", " ").splitlines())
    return [re.sub(r" +# .*", "", line) for line in lines if line and not line.startswith("#")]


def _in_a_line(loop):
    return "; ".join(line.strip() for line in loop[0].splitlines()).replace("do; ", "do ")


# --- what came of them ---------------------------------------------------------------------------

UNREAD = re.compile(r"/(\.\w+|__pycache__|benchmarks|tables|estimates|logs|parts)/")
"""Folders of times, and of what lies between the steps of a workflow."""
SILENT = "snakemake "
"""Commands that print jobs with their times, in any order, of which nothing is told."""
MANY = 3
"""Folders alike that are read, each; of more, the first."""
FORK = multiprocessing.get_context("fork")
"""A copy of this process has imported already what a command needs."""


class Shell:
    """A folder in which commands are typed one after the other.

    `skipped` says, by beginnings of commands, which are not run and why; of those that run, files
    are told unless `files` is false.
    """

    def __init__(self, folder, skipped=(), files=True, **environment):
        self.top = self.folder = Path(folder).resolve()
        self.skipped, self.files = dict(skipped), files
        settings = {"ACCELSTUDY_ANGLE_UNIT": "gon", "COLUMNS": "80", "MPLBACKEND": "agg"}
        self.environment = settings | environment
        self.known = set()

    def transcript(self, commands):
        """What each command printed and wrote; once only, as a reader would type it."""
        told = []
        for command in commands:
            if command not in self.known:
                self.known.add(command)
                told.append(self.told(command))
        return "".join(told)

    def told(self, command):
        """A command with its exit status, what it printed (>), warned (!) and wrote (---)."""
        if why := self.reason_to_skip(command):
            return f"=== {command}\nnot run: {why}\n\n"
        before = self._files()
        status, printed, warned = self.run(command)
        if command.startswith(SILENT) and not status:
            printed = warned = ""
        lines = [f"=== {command}", *([f"exit status {status}"] if status else [])]
        lines += [f"> {line}".rstrip() for line in printed.splitlines()]
        lines += [f"! {line}".rstrip() for line in warned.splitlines()]
        alike = {}
        for path, stamp in self._files().items():
            if before.get(path) != stamp:
                alike.setdefault((path.parent.parent, path.name), []).append(path)
        for paths in alike.values():
            more = len(paths) - 1 if len(paths) > MANY else 0
            for path in paths[:1] if more else paths:
                name = f"{path.relative_to(self.top)}{f' ({more} more like it)' if more else ''}"
                lines += [f"--- {name}", *file_text(path).splitlines()]
        return masked("\n".join([*lines, "\n"]), self.top)

    def reason_to_skip(self, command):
        """Why a command is not run; None if it is."""
        skipped = self.skipped.items()
        return next((why for x, why in skipped if re.match(rf"{x}(?=\s|$)", command)), None)

    def _files(self):
        if not self.files:
            return {}
        found = sorted(path for path in self.top.rglob("*") if path.is_file())
        read = [path for path in found if not UNREAD.search(f"/{path.relative_to(self.top)}")]
        return {path: (path.stat().st_mtime_ns, path.stat().st_size) for path in read}

    def run(self, command):
        """Exit status and both streams of a command."""
        with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
            status = self._run(command, out, err)
            return status, _content(out), _content(err)

    def _run(self, command, out, err):
        if command.startswith("cd "):
            self.folder /= command.split()[1]
            return 0
        bare = re.sub(r"'[^']*'|\"[^\"]*\"", "", command)
        if re.match(r"import |python \S+\.py|accelstudy [^|<>;&*?$]*(> \S+)?$", bare):
            child = FORK.Process(target=self._execute, args=(command, out, err))
            child.start()
            child.join()
            return child.exitcode
        path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        variables = os.environ | self.environment | {"PATH": path}
        return subprocess.run(["bash", "-c", command], cwd=self.folder, env=variables,
                              stdout=out, stderr=err).returncode  # fmt: skip

    def _execute(self, command, out, err):
        """Execute Python, or a program of it, in the process of this one that was forked for it."""
        os.dup2(out.fileno(), 1)
        os.dup2(err.fileno(), 2)
        sys.stdout = os.fdopen(1, "w", buffering=1, encoding="utf-8")
        sys.stderr = os.fdopen(2, "w", buffering=1, encoding="utf-8")
        os.chdir(self.folder)
        os.environ.update(self.environment)
        sys.path.insert(0, str(self.folder))
        if command.startswith("import "):
            exec(compile(command, "<page>", "exec"), {"__name__": "__main__"})
            return
        command, _, file = command.partition(" > ")
        if file:
            os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 1)
        program, *sys.argv = shlex.split(command, comments=True)
        if program == "python":
            runpy.run_path(sys.argv[0], run_name="__main__")
        else:
            sys.argv.insert(0, program)
            entry_point()()


def _content(file):
    file.seek(0)
    return file.read().decode("utf-8")


def entry_point():
    """The function that the command `accelstudy` calls."""
    (found,) = importlib.metadata.entry_points(group="console_scripts", name="accelstudy")
    return found.load()


def import_all():
    """Import, once, what commands need."""
    import accelstudy

    for name in accelstudy.__all__:
        getattr(accelstudy, name)
    for name in ("matplotlib.pyplot", "pyarrow", "scipy.optimize", "scipy.stats", "sympy"):
        __import__(name)
    entry_point()
