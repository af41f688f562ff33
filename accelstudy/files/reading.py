"""Files of the user, read strictly: text, JSON, and YAML, of which one file overlays the other.

Errors name the file that was read, and no file is read without end.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from accelstudy.basics.errors import InputError, brief, printable_line, reason_of
from accelstudy.basics.names import check_file_name
from accelstudy.basics.wording import one_line

MAX_BYTES = 100_000_000
"""Bytes of the largest text that is read as a whole, more than a campaign of 100 000 positions."""
LARGEST_YAML = 1_000_000
"""Bytes of the largest YAML file: what people write, and what is slow to read."""
_DEVICES = ("/dev/", "/proc/")
"""Where a pipe is one that a shell has opened, and not one that waits for somebody to write."""


@contextmanager
def readable(path: str | Path) -> Iterator[None]:
    """Turn errors of the system on reading a file into one line that names it.

    A name that no file can have is refused, and so is a named pipe, which could wait for ever.
    """
    check_file_name(path)
    try:
        if stat.S_ISFIFO(os.stat(path).st_mode) and not os.path.abspath(path).startswith(_DEVICES):
            raise InputError(f"{path}: a named pipe; give a file")
        yield
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise InputError(f"{path}: a folder; give a file") from None
    except OSError as error:
        if error.errno is None:  # not of the system, but of a library that finds the file odd
            raise
        raise InputError(f"{path}: cannot be read: {reason_of(error)}") from None


def read_text(path: str | Path, largest: int | None = None) -> str:
    """Read a text in UTF-8, from a file or a pipe; line ends become those of Python.

    Raises
    ------
    InputError
        If it cannot be read, or has more than `largest` bytes, by default `MAX_BYTES`, as a device
        that never ends.
    UnicodeDecodeError
        If it is not UTF-8; the caller knows what it should be.
    """
    largest = MAX_BYTES if largest is None else largest
    with readable(path), Path(path).open("rb") as file:
        content = file.read(largest + 1)
    if len(content) > largest:
        raise InputError(f"{path}: larger than {largest // 10**6} MB; is it the right file?")
    return content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")


def read_json(path: str | Path, kind: str) -> Mapping[str, Any]:
    """Read a JSON file of accelstudy; each text in it becomes one printable line.

    Parameters
    ----------
    path : path
    kind : str
        What to say of a file that holds something else, such as "not a calibration.json".

    Raises
    ------
    InputError
        As `read_text`; if it is no JSON; if a newer version wrote it.
    """
    try:
        content = _in_lines(json.loads(read_text(path)))
    except (UnicodeDecodeError, ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        reason = "nested too deeply" if isinstance(error, RecursionError) else one_line(error)
        raise InputError(f"{path}: {kind}: {reason}") from None
    check_version(content, path)
    return content


def check_version(content: object, path: str | Path) -> None:
    """Refuse what a newer version wrote, before its keys are taken for errors."""
    version = content.get("schema_version") if isinstance(content, Mapping) else None
    if isinstance(version, int) and version > 1:
        raise InputError(
            f"{path}: schema_version: {brief(version)} is of a newer version of accelstudy; to "
            "read this file, get that version: pip install --upgrade accelstudy"
        )


def read_layer(path: str | Path) -> dict[str, Any]:
    """Read one YAML file; each text in it becomes one printable line.

    Raises
    ------
    InputError
        If it cannot be read, is not valid YAML, has aliases or tags, names a key twice, is no
        mapping, or was written by a newer version.
    """
    try:
        layer = _in_lines(yaml.load(read_text(path, LARGEST_YAML), _Loader))
    except InputError:
        raise
    except RecursionError:
        raise InputError(f"{path}: not valid YAML: nested too deeply") from None
    except yaml.MarkedYAMLError as error:
        raise InputError(f"{path}: not valid YAML: {_where(error)}") from None
    except (yaml.YAMLError, ValueError) as error:  # such as an impossible date
        line = " ".join(str(error).split())
        raise InputError(f"{path}: not valid YAML: {line}") from None
    if not isinstance(layer, dict):
        raise InputError(f"{path}: not a mapping of keys to values")
    check_version(layer, path)
    return layer


def overlay(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Lay one configuration over another, key by key; lists are replaced."""
    result = dict(below)
    for key, value in above.items():
        old = result.get(key)
        if isinstance(old, Mapping) and isinstance(value, Mapping):
            value = overlay(old, value)
        result[key] = value
    return result


def config_hash(config: Mapping[str, Any]) -> str:
    """Hash of everything in a configuration that the numbers of a study depend on.

    Parameters
    ----------
    config : mapping, the whole configuration with its defaults, as plain data
    """
    unused = {"angle_unit", "plugins"} | (set() if config.get("schemes") else {"schemes"})
    content = {key: value for key, value in config.items() if key not in unused}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def _in_lines(content: Any) -> Any:
    """Content of a file whose texts are one printable line each."""
    if isinstance(content, str):
        return printable_line(content)
    if isinstance(content, list):
        return list(map(_in_lines, content))
    if isinstance(content, dict):
        return {_in_lines(key): _in_lines(value) for key, value in content.items()}
    return content


def _where(error: yaml.MarkedYAMLError) -> str:
    mark = error.problem_mark or error.context_mark
    place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
    return f"{place}{error.problem or error.context}"


class _Loader(yaml.SafeLoader):
    """A safe loader that refuses a key given twice, aliases and tags.

    Aliases of aliases make a small file huge, and a tag can be of what its value is not.
    """

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        what = "an alias (*)" if isinstance(event, yaml.AliasEvent) else "a tag (!)"
        if isinstance(event, yaml.AliasEvent) or getattr(event, "tag", None) is not None:
            problem = f"{what} is not read; write the value out"
            raise yaml.composer.ComposerError(None, None, problem, event.start_mark)
        node: yaml.Node | None = super().compose_node(parent, index)
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    mark = key.start_mark
                    raise yaml.constructor.ConstructorError(
                        None, None, f"the key {key.value!r} stands twice", mark
                    )
                seen.add(key.value)
        return super().construct_mapping(node, deep)
