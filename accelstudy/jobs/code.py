"""The code on which a job depends, found from its imports."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import accelstudy
from accelstudy.basics import plugins

_FOR_TYPES = re.compile(r"^if \(?\s*TYPE_CHECKING\s*\)?:\n(?:[ \t]+.*\n|\n)+", re.MULTILINE)
_FROM = re.compile(r"^[ \t]*from (\w[\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)
_NAMED = re.compile(r"^[ \t]*import (\w[\w.]*)|\"(accelstudy\.[\w.]+)\"", re.MULTILINE)
_ALL_BESIDE = "import_modules(__name__, __path__)"
_DATA = (".j2", ".yaml")


def code_hash(script: str | Path, *beside: str) -> str:
    """Hash of the package's files on which a script of the workflow depends.

    Snakemake notices that a script has changed, but not that a package has. With this hash as a
    parameter of a rule it does. What depends on a registry depends on the user's plug-ins, too.

    Parameters
    ----------
    script : path of a Python file
    beside : packages in the folder of this one whose files count, too
    """
    root = Path(accelstudy.__file__).parents[1]
    digest = hashlib.sha256()
    files = sorted(code_files(script, *beside))
    for path in files:
        digest.update(f"{path.relative_to(root).as_posix()} {_read_now(path)[0]}".encode())
    if any(_read_now(path)[2] for path in files):
        digest.update("".join(sorted(plugins.digests().values())).encode())
    return digest.hexdigest()[:16]


def code_files(script: str | Path, *beside: str) -> set[Path]:
    """Files of the package, and of packages beside it, on which a script depends.

    Imports are found by reading the files, those within functions included and those for type
    checkers excluded. A registry depends on all modules of its folder, and a module on the
    templates and data next to it.

    For the scripts of a workflow this takes 0.08 to 0.14 s of CPU. The library grimp takes 0.13 s
    for the graph of the package, and sees no registry, quoted name, template or script: a workflow
    would start no sooner, and need one more compiled package. Tests compare the two.
    """
    root, packages = Path(accelstudy.__file__).parents[1], {"accelstudy", *beside}
    files: set[Path] = set()
    waiting = [Path(script)]
    while waiting:
        new = {*_imported(root, packages, waiting.pop())} - files
        files |= new
        waiting += new
    folders = {path.parent for path in files}
    return files.union(*([p for p in each.iterdir() if p.suffix in _DATA] for each in folders))


def _imported(root: Path, packages: set[str], path: Path) -> Iterator[Path]:
    """Files of some packages that a file imports."""
    _, modules, all_beside = _read_now(path)
    for module in modules:
        if module.partition(".")[0] in packages:
            yield from _files(root, module)
    if all_beside:
        yield from path.parent.glob("*.py")


def _read_now(path: Path) -> tuple[str, tuple[str, ...], bool]:
    return _read(path, path.stat().st_mtime_ns)


@cache
def _read(path: Path, modified: int) -> tuple[str, tuple[str, ...], bool]:
    """Hash of a file, modules that it names, and whether it imports all modules beside it.

    With the time of its last change as an argument, a changed file is read again.
    """
    content = path.read_text(encoding="utf-8")
    digest = hashlib.sha256(content.encode()).hexdigest()
    if path.suffix in _DATA:
        return digest, (), False
    text = _FOR_TYPES.sub("", content)
    modules = [imported or quoted for imported, quoted in _NAMED.findall(text)]
    for module, names in _FROM.findall(text):
        modules += [module, *(f"{module}.{name}" for name in re.findall(r"\w+", names))]
    return digest, tuple(dict.fromkeys(modules)), _ALL_BESIDE in text


@cache
def _files(root: Path, module: str) -> tuple[Path, ...]:
    """Files that an import of a module runs: its own, and those of the packages above it."""
    package, *parts = module.split(".")
    path, files = root / package, []
    for part in parts:
        path /= part
        files += [file for file in (path.with_suffix(".py"), path / "__init__.py") if file.exists()]
    return tuple(files)
