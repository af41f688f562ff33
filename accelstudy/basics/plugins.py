"""Plug-ins: effects, schemes and the like of the user's own, from a file or an installed package.

Its code registers what it has when it is imported, as the modules of this package do. A file is
loaded when it is named: `--plugin` of a command, `plugins` of a configuration; a program imports
it, or has its code. A file of data, such as a model.yaml, may be of anybody, so it only names what
it needs. A package names its modules as entry points of the group ``accelstudy.`` and the room,
such as ``accelstudy.effects``; they are imported when something of that room is first looked up.
"""

from __future__ import annotations

import hashlib
import os
import sys
import traceback
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache, lru_cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from accelstudy.basics.errors import InputError, locate_errors, reason_of
from accelstudy.basics.names import check_file_name

PREFIX = "accelstudy."
"""What the groups of entry points begin with; the name of a room follows."""
NOTHING = "registers nothing; expected a class or a function under @register"
HOW = "; of a plug-in: import it, name it with --plugin or, in a configuration, under plugins"
"""What a message adds to the names that are known."""
_CODE = (".py", ".yaml", ".yml", ".json", ".j2")

_files: dict[str, str] = {}
"""Digest by name, of the files that are loaded."""
_loading: list[str] = []
"""Names of the plug-ins that are being loaded, the innermost last."""
_sources: dict[tuple[str, str], tuple[str, str]] = {}
"""Plug-in, and name of the code in it, by kind and name of what it registered."""
_lookups: list[Any] = []
"""Caches of what is looked up by name."""

Lookup = TypeVar("Lookup", bound=Callable[..., Any])


def cached_lookup(function: Lookup) -> Lookup:
    """Cache what a function looks up by name, until a plug-in registers something."""
    _lookups.append(lru_cache(maxsize=None)(function))
    return _lookups[-1]


def note_registration(kind: str, name: str, source: tuple[str, str]) -> None:
    """Note what a plug-in registers, with its source as of `find_source`."""
    _sources[kind, name] = plugin, _ = source
    if not _loading and os.path.isfile(plugin):  # an imported file
        _files[plugin] = _digest(Path(plugin).read_bytes())
    for lookup in _lookups:
        lookup.cache_clear()


def find_source(code: Any) -> tuple[str, str]:
    """Plug-in of a class or function, empty if it is of this package, and its name in it.

    That is what is being loaded, or else its package, its file or, of a notebook, its module.
    """
    module = code.__module__
    if module.startswith(PREFIX):
        return "", ""
    installed = (label(point) for point in _entry_points(tuple(sys.path)) if point.module == module)
    file = getattr(sys.modules.get(module), "__file__", None)
    # A class that a call makes has the module of its metaclass.
    files = [os.path.relpath(file)] if file and module not in sys.stdlib_module_names else []
    return next(chain(_loading[-1:], installed, files, [module])), code.__qualname__


def source_of(kind: str, name: str) -> tuple[str, str]:
    """Return the source of what is registered; its plug-in is empty if it is of accelstudy."""
    return _sources.get((kind, name), ("", ""))


def load_files(paths: Iterable[str | Path]) -> None:
    """Load plug-ins from Python files, each content once.

    Raises
    ------
    InputError
        One line that names the file, what is wrong and what would be right.
    """
    for path in paths:
        _load_file(Path(path))


def load_plugins(content: Mapping[str, Any]) -> None:
    """Load the plug-ins that a configuration names; raises errors like `load_files`."""
    with locate_errors("plugins"):
        load_files(_plugin_names(content))


@contextmanager
def explain_missing(content: Mapping[str, Any], source: str | Path) -> Iterator[None]:
    """Add to an error within the block which plug-ins a file of data names that are not loaded.

    Raises
    ------
    InputError
        Of what is read; it says which plug-ins are named and not loaded.
    """
    try:
        yield
    except InputError as error:
        loaded = {Path(name).name for name in _files}
        missing = [name for name in _plugin_names(content) if Path(name).name not in loaded]
        if not missing:
            raise
        raise InputError(
            f"{error}; {source} needs the plug-in {', '.join(missing[:3])}, and a file of data "
            "loads no code: if you trust that plug-in, give it with --plugin"
        ) from None


def _plugin_names(content: Mapping[str, Any]) -> list[str]:
    """Plug-ins that a file names; what is no text is none, and the schema refuses it."""
    named = as_names(content.get("plugins"))
    return [name for name in named if isinstance(name, str)] if isinstance(named, list) else []


def as_names(value: Any) -> Any:
    """Names of plug-ins as a list: one, several, or each with a digest, as 0.2 wrote them."""
    if isinstance(value, Mapping | tuple):
        return list(value)
    return [value] if isinstance(value, str) else value


def _load_file(path: Path) -> None:
    check_file_name(path)
    try:
        if path.exists() and not path.is_file():  # a folder, or a device that never ends
            raise InputError(f"{path}: is no file; give one with Python code")
        content = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {reason_of(error)}") from None
    digest = _digest(content)
    if digest in _files.values():
        return
    # Under a name that nobody else has, and without a copy in __pycache__ that may be old.
    module = ModuleType(f"plugin_{digest}")
    module.__file__ = str(path)
    with error_as_line(str(path), path):
        code = compile(content, str(path), "exec")
        sys.modules[module.__name__] = module
        with _registering(str(path)):
            exec(code, vars(module))
    _files[str(path)] = digest


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def loaded_files() -> list[str]:
    """Files that are loaded, as they were named."""
    return list(_files)


def file_key() -> dict[str, Any]:
    """Key of a file that names the files that are loaded; empty without any."""
    return {"plugins": loaded_files()} if _files else {}


def load_installed(room: str) -> None:
    """Import what installed packages have for a room, in the order of their names.

    Raises
    ------
    InputError
        One line that names the package, its entry point, and what is wrong.
    """
    for point in installed_entry_points(room):
        if point.module not in sys.modules:
            with error_as_line(label(point), *_folders(point)), _registering(label(point)):
                point.load()


def installed_entry_points(room: str) -> list[EntryPoint]:
    """Entry points of installed packages for a room."""
    points = [point for point in _entry_points(tuple(sys.path)) if point.group == PREFIX + room]
    return sorted(points, key=lambda point: (label(point), point.name))


@cache
def _entry_points(path: tuple[str, ...]) -> list[EntryPoint]:
    """Entry points for this package on Python's path; each look takes as long as a small table."""
    found = entry_points()
    groups = [group for group in found.groups if group.startswith(PREFIX)]
    return [point for group in groups for point in found.select(group=group)]


def label(point: EntryPoint) -> str:
    """Name of an entry point for people: its package, with the version, and the module."""
    package = f"{point.dist.name} {point.dist.version}" if point.dist else "a package"
    return f"{package} ({point.value})"


def digests() -> dict[str, str]:
    """Digest of the content of each plug-in: files that are loaded, and packages."""
    found = dict(_files)
    for room in sorted({point.group for point in _entry_points(tuple(sys.path))}):
        points = installed_entry_points(room.removeprefix(PREFIX))
        found |= {label(point): code_digest(*_folders(point)) for point in points}
    return found


def _folders(point: EntryPoint) -> list[Path]:
    """Folders of the package of an entry point, or its one file; it is not imported."""
    spec = find_spec(point.module.split(".")[0])
    if spec is None:
        return []
    return [Path(folder) for folder in spec.submodule_search_locations or [str(spec.origin)]]


def code_digest(*folders: Path, without: Collection[Path] = ()) -> str:
    """Digest of all code in some folders `without` others; a package may be one file instead."""
    digest = hashlib.sha256()
    for folder in folders:
        for path in sorted(folder.rglob("*")) if folder.is_dir() else [folder]:
            if path.suffix in _CODE and not any(map(path.is_relative_to, without)):
                digest.update(path.relative_to(folder).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:16]


@contextmanager
def _registering(name: str) -> Iterator[None]:
    """Load a plug-in, which has to register something."""
    _loading.append(name)
    try:
        yield
    finally:
        _loading.pop()
    if all(plugin != name for plugin, _ in _sources.values()):
        raise InputError(NOTHING)


@contextmanager
def error_as_line(name: str, *own: Path) -> Iterator[None]:
    """Turn whatever the code of a plug-in raises into one line.

    Parameters
    ----------
    name : str, of the plug-in
    own : files and folders of its code, of which the line names the last that was reached
    """
    try:
        yield
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        where = ""
        for frame in traceback.extract_tb(error.__traceback__):
            path = Path(frame.filename)
            if not {path, *path.parents}.isdisjoint(own):
                where = "" if frame.filename == name else f"{path.name}, "
                where += f"line {frame.lineno}: "
        what = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
        raise InputError(f"{name}: {where}{' '.join(what.split())}") from None
