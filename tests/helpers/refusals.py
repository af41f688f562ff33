"""What commands say of damaged files and wrong options, as tests/golden/refusals.txt lists them.

A command has a line that begins with `accelstudy`, or `parse` and the name of a function that takes
the content of a YAML file and its name. Each indented line below it is one way to go wrong: words
that take the place of `…` in the command, or a change of a file. A line that begins with `acs.` is
a call of a function. Changes are

    FILE = TEXT         other content, with the escapes of Python; of bytes, too
    FILE += {KEY: …}    other keys of YAML or JSON; null removes one
    FILE ~ OLD -> NEW   a regular expression, in all lines; one that finds nothing is an error
    FILE -              no file

and several are joined by ` && `. A line `$ COMMAND` or `$ FILE = TEXT` makes the files that are
damaged below it.
"""

import json
import os
import re
import shlex
import shutil
from contextlib import chdir
from pkgutil import resolve_name
from types import SimpleNamespace
from unittest import mock

import pandas as pd
import stand_ins
import yaml
from calling import call, succeed
from log_helpers import by_hand, table
from places import ROOT
from scipy.io import savemat
from study_helpers import content as study_content

import accelstudy as acs
from accelstudy.basics.errors import InputError
from accelstudy.files.reading import overlay, read_layer

SCRIPT = ROOT / "tests/golden/refusals.txt"
CHANGE = re.compile(r"(\w[\w./-]*) (=|\+=|~|-)(?: (.*))?")
SHORT = re.compile(r"((?:known|Schemes): (?:[^,;)]+, ){2}[^,;)]+), [^;)\n]+")
"""A list of all names that there are, of which the first three are enough."""
ENVIRONMENT = {"ACCELSTUDY_ANGLE_UNIT": "gon", "COLUMNS": "80"}


def texts(folder):
    """What comes of each section of the script, {name: text}."""
    sound = folder / "sound"
    sound.mkdir()
    time, forces = by_hand()
    (sound / "study.yaml").write_text(json.dumps(study_content()))
    for name in ("hidden-effects", "real-noise"):
        shutil.copy(ROOT / f"studies/hidden/config/{name}.yaml", sound)
    table(forces, t=time)[["t", "fx", "fy", "fz"]].to_csv(sound / "log.csv", index=False)
    savemat(sound / "arrays.mat", {"log": forces, "other": forces, "complex": 1j * forces})
    _, *parts = re.split(r"^# (.+)\n", SCRIPT.read_text("utf-8"), flags=re.MULTILINE)
    undrawn = mock.patch.object(stand_ins.saving, "_element", stand_ins.element)
    with mock.patch.dict(os.environ, ENVIRONMENT), undrawn:
        for name, lines in zip(parts[::2], parts[1::2], strict=True):
            yield name, "".join(section(sound, lines.splitlines()))


def section(sound, lines):
    """What comes of some lines of the script, one after the other."""
    command = ""
    for line in filter(None, lines):
        if line.startswith("$ accelstudy"):
            with chdir(sound):
                succeed(*shlex.split(line)[2:])
        elif line.startswith("$ "):
            changed(sound, line[2:])
        elif line.startswith("  "):
            yield f"=== {line.strip()}\n{answer(sound, command, line.strip())}"
        else:
            command = line
            yield f"{line}\n{'' if '…' in line else answer(sound, line)}"


def answer(sound, command, wrong=""):
    """What a command prints in the folder, and what else it does that it must not.

    Files that are changed for it are put back.
    """
    parts = wrong.split(" && ")
    matches = [CHANGE.fullmatch(part) for part in parts]
    paths = {sound / match[1] for match in matches if match}
    originals = {path: path.read_bytes() for path in paths if path.exists()}
    words = [part for part in parts if not changed(sound, part)]
    before = content(sound)
    with chdir(sound):
        if command.startswith("acs."):
            result = outcome(eval, command, {"acs": acs, "pd": pd})
        else:
            program, *words = shlex.split(command.replace("…", " ".join(words)))
            result = call(*words) if program == "accelstudy" else outcome(parse, *words)
    said = [f"! {line}\n" for line in result.stderr.splitlines()]
    said += [f"> {line}\n" for line in result.stdout.splitlines()]
    if result.exit_code != 2:
        said.append(f"exit status {result.exit_code}: {result.exception!r}\n")
    if content(sound) != before:
        said.append("files were written\n")
    for path in paths:
        if path in originals:
            path.write_bytes(originals[path])
        else:
            path.unlink(missing_ok=True)
    return SHORT.sub(r"\1, …", "".join(said))


def parse(function, file):
    """Let a function read a file."""
    resolve_name(function)(read_layer(file), file)


def outcome(function, *given):
    """What a function says of its input, as the result of a command."""
    try:
        function(*given)
    except InputError as error:
        return SimpleNamespace(stderr=f"error: {error}\n", stdout="", exit_code=2)
    return SimpleNamespace(stderr="", stdout="", exit_code=0, exception=None)


def changed(folder, text):
    """Change a file as a text says; whether it says so, and is not words of a command."""
    match = CHANGE.fullmatch(text)
    if match is None:
        return False
    path, how, what = folder / match[1], match[2], match[3] or ""
    if how == "-":
        path.unlink()
    elif how == "=":
        path.write_bytes(what.encode().decode("unicode_escape").encode("latin-1"))
    elif how == "+=":
        keys = yaml.safe_load(what)
        merged = overlay(yaml.safe_load(path.read_text("utf-8")), keys)
        removed = {name for name, value in keys.items() if value is None}
        path.write_text(json.dumps({k: v for k, v in merged.items() if k not in removed}))
    else:
        old, new = map(str.strip, what.split(" ->"))
        damaged, count = re.subn(old, new, path.read_text("utf-8"), flags=re.MULTILINE)
        assert count, f"{match[1]} has no {old}"
        path.write_text(damaged, "utf-8")
    return True


def content(folder):
    """Files and folders, with the time at which each was changed."""
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
