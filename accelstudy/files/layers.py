"""YAML files, of which one overlays the other, read strictly."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from accelstudy.basics.errors import InputError
from accelstudy.files.reading import check_version, read_text

LARGEST = 100_000
"""Most values of a file with its aliases expanded; a file without aliases may have more."""


def read_layer(path: str | Path) -> dict[str, Any]:
    """Read one YAML file.

    Raises
    ------
    InputError
        If it cannot be read, is not valid YAML, names a key twice, is no mapping, becomes very
        large by aliases of aliases, or was written by a newer version.
    """
    try:
        layer = _load(read_text(path))
    except InputError:
        raise
    except RecursionError:
        raise InputError(f"{path}: not valid YAML: nested too deeply") from None
    except yaml.MarkedYAMLError as error:
        raise InputError(f"{path}: not valid YAML: {_where(error)}") from None
    except (LookupError, TypeError, AttributeError):
        # PyYAML trips over explicit tags that do not fit their value, such as !!int "".
        raise InputError(f"{path}: not valid YAML: a tag does not fit its value") from None
    except (yaml.YAMLError, ValueError) as error:  # such as an impossible date
        line = " ".join(str(error).split())
        raise InputError(f"{path}: not valid YAML: {line}") from None
    if not isinstance(layer, dict):
        raise InputError(f"{path}: not a mapping of keys to values")
    check_version(layer, path)
    return layer


def _load(text: str) -> Any:
    loader = _Loader(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        _check_size(node)
        return loader.construct_document(node)
    finally:
        loader.dispose()


def _check_size(root: yaml.Node) -> None:
    """Refuse aliases that make a small file large (`LARGEST`) or put a value into itself."""
    sizes: dict[int, int | None] = {}

    def size(node: yaml.Node) -> int:
        if id(node) in sizes:
            known = sizes[id(node)]
            if known is None:
                raise yaml.YAMLError(f"line {node.start_mark.line + 1}: a value holds itself")
            return known
        sizes[id(node)] = None
        parts: list[yaml.Node] = []
        if isinstance(node, yaml.CollectionNode):
            mapping = isinstance(node, yaml.MappingNode)
            parts = [part for pair in node.value for part in pair] if mapping else node.value
        total = 1 + sum(size(part) for part in parts)
        sizes[id(node)] = total
        return total

    # Without aliases the content is as large as the file.
    if size(root) > max(LARGEST, 2 * len(sizes)):
        raise yaml.YAMLError(f"with its aliases written out it has more than {LARGEST} values")


def overlay(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Lay one configuration over another, key by key; lists are replaced."""
    result = dict(below)
    for key, value in above.items():
        old = result.get(key)
        if isinstance(old, Mapping) and isinstance(value, Mapping):
            value = overlay(old, value)
        result[key] = value
    return result


def _where(error: yaml.MarkedYAMLError) -> str:
    mark = error.problem_mark or error.context_mark
    place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
    return f"{place}{error.problem or error.context}"


class _Loader(yaml.SafeLoader):
    """A safe loader that refuses a key given twice."""

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
